"""Designs of `hrg optimise` against the best of 10 000 random ones on 20 problems: `python tests/benchmarks/designs.py [--ten]`.

Problems: shipped cards with their main dimensions free (± 15 %), an objective and two constraints drawn from frequencies (n = 1 or 0, 2, 3)
and Bryan factors, with limits that a tenth to a half of random designs keep. Their columns come from interpolated families of full
solves, so that 10 000 random designs can be afforded; the search sees them as it sees full solves.

`--ten`: ten variables and five constraints by full solves, by the clock (`ten-variables.toml`).
"""

import argparse
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from shell.family import Axis, build_family
from studies.design import answer as module
from studies.design.answer import answer
from studies.design.keys import DesignKeys
from studies.design.run import optimise
from studies.design.task import Task
from studies.errors import InputError
from studies.instrument.card import load_card
from studies.schema.reader import read_keys
from studies.sweeps.block import Row
from studies.sweeps.parameters import find_nominal, set_parameters

CARDS = {
    "free-dome": ("thickness_mm", "radius_mm"),
    "hrg-30mm": ("thickness_mm", "radius_mm", "stem.radius_mm"),
    "cvg-25mm": ("thickness_mm", "radius_mm", "height_mm", "bottom_thickness_mm"),
    "bvg-bell": ("thickness_mm", "radius_mm", "cylinder_height_mm"),
}
WIDE, RANDOM, EACH = 0.15, 10_000, 5


class Columns:
    """Columns of designs of one card, by families: frequencies and Bryan factors."""

    def __init__(self, name: str) -> None:
        card = load_card(name)
        keys = [f"resonator.{key}" for key in CARDS[name]]
        at = [find_nominal(card, key, name) for key in keys]
        self.axes = [Axis(key, value * (1 - WIDE), value * (1 + WIDE)) for key, value in zip(keys, at, strict=True)]
        elastic = card.material.elastic(card.reference_temperature)
        self.about = {"nu": elastic.nu, "E": elastic.E, "rho": elastic.rho}

        def build(values):
            return set_parameters(card, dict(zip(keys, values.tolist(), strict=True))).resonator

        harmonics = (2, 3) if card.resonator.support == "free" else (2, 3, 1)
        self.families = [
            build_family(build, self.axes, nu=(elastic.nu, elastic.nu), harmonic=n, tolerance=1e-2) for n in harmonics
        ]
        self.names = [f"{what}_n{n}" for n in harmonics for what in ("frequency", "bryan")]

    def __call__(self, designs):
        found = [family.evaluate(np.atleast_2d(designs), **self.about) for family in self.families]
        return np.column_stack([column for one in found for column in (one.frequency, one.bryan_factor)])

    def cases(self, designs):
        return [Row("ok", "", row, np.full_like(row, np.nan)) for row in self(designs)]


def pose(columns: Columns, rng: np.random.Generator, draws):
    """A task whose limits a tenth to a half of the random designs keep."""
    objective, *bound = rng.choice(len(columns.names), 3, replace=False)
    values = columns(draws)
    constraints = []
    for c in bound:
        share, low = rng.uniform(0.3, 0.7), rng.random() < 0.5
        limit = float(np.quantile(values[:, c], share))
        constraints.append({"column": columns.names[c], ("low" if low else "high"): limit})
    goal = str(rng.choice(["least", "greatest"]))
    content = {
        "schema": "hrg.design/1",
        "card": "free-dome",
        "parameter": [{"name": a.name, "low": a.low, "high": a.high} for a in columns.axes],
        "objective": [{"column": columns.names[objective], "goal": goal}],
        "constraint": constraints,
    }
    keys = read_keys(content, DesignKeys, "benchmark")
    known = [SimpleNamespace(name=a.name, low=a.low, high=a.high) for a in columns.axes]
    study = SimpleNamespace(
        parameters=known,
        names=tuple(a.name for a in columns.axes),
        columns=[SimpleNamespace(name=name, unit="1", label=name) for name in columns.names],
    )
    start = np.array([(a.low + a.high) / 2 for a in columns.axes])
    kept = np.ones(len(draws), dtype=bool)
    for one in constraints:
        c = columns.names.index(one["column"])
        kept &= (values[:, c] >= one.get("low", -np.inf)) & (values[:, c] <= one.get("high", np.inf))
    sign = 1.0 if goal == "least" else -1.0
    best = sign * float((sign * values[kept, objective]).min()) if kept.any() else None
    return Task(keys, "benchmark", study, len(known), start), best, sign, int(objective)


def compare() -> None:
    """20 problems: who is better, and after how many designs."""
    module.evaluate_case = lambda plan, named: SimpleNamespace(values=plan(list(named.values()))[0])
    rng = np.random.default_rng(33)
    worse, total = 0, 0
    for name in CARDS:
        columns = Columns(name)
        low, high = (np.array([getattr(a, end) for a in columns.axes]) for end in ("low", "high"))
        for _ in range(EACH):
            task, best, sign, c = pose(columns, rng, rng.uniform(low, high, (RANDOM, len(low))))
            total += 1
            try:
                found = answer(task, columns, columns)
            except InputError as error:
                worse += best is not None
                print(f"{name}: refused ({str(error)[:60]}); random: {best}")
                continue
            behind = best is not None and sign * (found.after[c] - best) > 1e-6 * abs(best)
            worse += behind
            told = "none keeps the limits" if best is None else f"{best:.8g}"
            print(
                f"{name:10} {columns.names[c]:13} {'WORSE' if behind else 'ok':5} {found.after[c]:.8g} after {found.evaluations} designs; random: {told}"
            )
    print(f"worse than the best of {RANDOM} random designs: {worse} of {total}")


def ten() -> None:
    """Ten variables and five constraints by full solves."""
    began, used = time.perf_counter(), time.process_time()
    found = optimise(Path(__file__).with_name("ten-variables.toml"), workers=1)
    seconds = time.process_time() - used
    print(
        f"{found.evaluations} designs, {seconds:.1f} s of one processor, {time.perf_counter() - began:.1f} s; {seconds / found.evaluations:.3f} s a design"
    )
    for column, before, after in zip(found.task.columns, found.before, found.after, strict=True):
        if column in found.task.wanted:
            print(f"  {column}: {before:.6g} -> {after:.6g}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ten", action="store_true")
    (ten if parser.parse_args().ten else compare)()
