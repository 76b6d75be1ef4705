"""Whether any of many random designs is better than the optimiser's, on problems in closed form: python -m tests.benchmarks.bench_design.

Sums of sines with a curved constraint in 2 to 10 parameters, each with several valleys; 20 problems, 10 000 random designs each.
With --shells FILE... the same for tasks on real resonators, as many random designs as --random says, each solved in full.
"""

import argparse
import time
from types import SimpleNamespace

import numpy as np

from studies.design import answer as module
from studies.design.goals import lay_goals
from studies.design.keys import DesignKeys
from studies.design.task import Task, read_task
from studies.schema.reader import read_keys
from studies.sweeps.block import Batch
from studies.sweeps.evaluate import WorkPlan, evaluate_task
from studies.sweeps.store import Stored


class Formulas:
    """Computes columns by a function of the design."""

    def __init__(self, function):
        self.function = function

    def cases(self, designs):
        """Return designs as a store has them."""
        values = [np.array(self.function(row), dtype=float) for row in designs]
        return [Stored("ok", "", v, np.full_like(v, np.nan)) for v in values]


def closed_form(seed: int, d: int, draws: int) -> tuple[float, float, int, float]:
    """Return the optimiser's objective, that of the best random design, evaluations and seconds."""
    rng = np.random.default_rng(seed)
    A, b, c = rng.normal(size=(4, d)), rng.normal(size=d), rng.normal(size=d)

    def columns(row):
        x = np.asarray(row)
        return [float(np.sum(np.sin(A @ x)) + x @ x / 4), float(b @ x + np.cos(c @ x))]

    drawn = np.array([columns(row) for row in rng.uniform(-1, 1, (draws, d))])
    limit = float(np.median(drawn[:, 1]))
    content = {
        "card": "free-dome",
        "parameter": [{"name": f"p{k}", "low": -1.0, "high": 1.0} for k in range(d)],
        "objective": [{"column": "f"}],
        "constraint": [{"column": "g", "high": limit}],
    }
    names = tuple(f"p{k}" for k in range(d))
    study = SimpleNamespace(
        parameters=[SimpleNamespace(name=n, low=-1.0, high=1.0) for n in names],
        names=names,
        columns=[SimpleNamespace(name=n, unit="1", label=n) for n in "fg"],
    )
    task = Task(read_keys(content, DesignKeys, "bench"), "bench", study, d, np.zeros(d))
    began = time.process_time()
    module.evaluate_case = lambda plan, named: SimpleNamespace(values=columns(list(named.values())))
    found = module.answer(task, Formulas(columns), None)
    assert found.after[1] <= limit + 1e-6 * abs(limit)
    return found.after[0], float(drawn[drawn[:, 1] <= limit, 0].min()), found.evaluations, time.process_time() - began


def shells(path: str, draws: int) -> None:
    """Hold the answer of a task against random designs that are solved in full."""
    from studies.design.run import optimise

    began = time.perf_counter()
    found = optimise(path, workers=2)
    seconds = time.perf_counter() - began
    task = read_task(path)
    free = np.random.default_rng(7).random((draws, task.free))
    low = np.array([p.low for p in task.study.parameters])
    width = np.array([p.high - p.low for p in task.study.parameters])
    x = np.hstack([free, np.tile((task.start - low)[task.free :] / width[task.free :], (draws, 1))])
    plan = WorkPlan.of(task.study)
    (cases,) = evaluate_task(plan, [Batch(np.full(draws, -1), low + x * width)])
    good = cases.values[np.isfinite(cases.values).all(axis=1)]
    laid = lay_goals(task, found.values, found.values[0])
    none = np.zeros(len(task.columns))
    held = [v for v in good if laid.violation(v, none) == 0]
    best = min((laid.objectives(v)[0] for v in held), default=np.inf)
    mine = laid.objectives(found.after)[0]
    print(
        f"{task.name}: {found.evaluations} solves, {seconds:.0f} s, objective {mine:.6g}; best of {draws} random ({len(held)} keep the limits) {best:.6g}"
    )


def main() -> None:
    """Print one line for every problem."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--shells", nargs="*", default=[])
    parser.add_argument("--random", type=int, default=10_000)
    given = parser.parse_args()
    for path in given.shells:
        shells(path, given.random)
    worse = 0
    for seed in range(0 if given.shells else 20):
        d = 2 + seed % 9
        mine, drawn, count, seconds = closed_form(seed, d, given.random)
        worse += mine > drawn + 1e-9
        print(
            f"{seed:2d}: {d:2d} parameters, {mine:.5f} against {drawn:.5f} of random designs, {count} evaluations, {seconds:.1f} s{' WORSE' if mine > drawn + 1e-9 else ''}"
        )
    if not given.shells:
        print(f"{worse} of 20 worse than the best of {given.random} random designs")


if __name__ == "__main__":
    main()
