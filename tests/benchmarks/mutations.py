"""Faults put into the product on purpose, each with the tests that must notice it: `python tests/benchmarks/mutations.py [NAME …]`.

Every fault runs in a process of its own, where this file is a plugin of pytest that puts the fault in before any test is read.
A line each: caught, with how many tests failed, or MISSED; exit status 1 if one is missed. Nothing is written to the project.
"""

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from pathlib import Path
from types import SimpleNamespace
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
CHOSEN = "HRG_MUTATION"


def scale_prediction() -> None:
    """The predicted frequency is 1 % too high."""
    from studies.simulation import prediction

    true = prediction.predict

    @wraps(true)
    def predict(*given: Any, **more: Any) -> prediction.Prediction:
        found = true(*given, **more)
        return replace(found, columns={**found.columns, "frequency_Hz": 1.01 * found.columns["frequency_Hz"]})

    prediction.predict = predict


def scale_modes() -> None:
    """Every frequency of the solver is 1e-4 too high."""
    from shell import modes

    true = modes.solve_modes

    @wraps(true)
    def solve_modes(*given: Any, **more: Any) -> tuple[modes.Mode, ...]:
        return tuple(replace(mode, frequency=mode.frequency * (1.0 + 1e-4)) for mode in true(*given, **more))

    modes.solve_modes = solve_modes


def drop_a_row() -> None:
    """The store gives all sampled cases but the last of each read."""
    from studies.sweeps.store import Store

    true = Store.read

    def read(self: Store, columns: Any) -> Any:
        for places, values in true(self, columns):
            yield places[:-1], values[:, :-1]

    Store.read = read  # type: ignore[method-assign]


BLIND: dict[str, tuple[str, Callable[[list[str]], list[str]]]] = {
    "adequate": ("adequate", lambda every: []),
    "first": ("explained", lambda every: every[:1]),
    "all": ("not-identifiable", lambda every: every),
}
"""Engines that give the same verdict and the same names of the library, whatever they are asked."""


def blind_engine(name: str) -> Callable[..., Any]:
    """Return a `diagnose_records` that does not look, as confident as its form allows."""
    from studies.calibration.observed import RESPONSES
    from studies.diagnosis.verdict import Cause, ResponseResult, Verdict
    from studies.effects import library

    state, names = BLIND[name]

    def diagnose_records(records: Any, *_: Any, **__: Any) -> Any:
        there = [one for one in RESPONSES if any(one in record for record in records)]
        named = names(sorted(library()))
        causes = (Cause(named[0], there[0], 0.99, tuple(named[1:]), {}, 1e3),) if named else ()
        result = ResponseResult(state, 1e-3, (1.0, 1.0), (1e-3, 1e-3) if named else None, "none")
        return SimpleNamespace(verdict=Verdict(state, causes, dict.fromkeys(there, result), None))

    return diagnose_records


def blind(name: str) -> Callable[[], None]:
    def put_in() -> None:
        from studies import workbench

        workbench.diagnose_records = blind_engine(name)  # type: ignore[assignment]

    return put_in


TABLE = "tests/stranger/test_planted_campaigns.py::test_share"
"""The batch of campaigns is drawn anew for each stub: some twenty seconds of processor time."""
MUTATIONS: dict[str, tuple[Callable[[], None], list[str]]] = {
    "prediction": (scale_prediction, ["tests/studies/test_limits_prediction.py"]),
    "solver": (scale_modes, ["tests/shell/test_published_modes.py::test_solid_frequencies_of_two_spectral_codes"]),
    "store": (
        drop_a_row,
        ["tests/studies/sweeps/test_limits_store.py::test_of_a_case_computed_twice_the_later_counts"],
    ),
    **{name: (blind(name), [TABLE]) for name in BLIND},
}


def pytest_configure() -> None:
    MUTATIONS[os.environ[CHOSEN]][0]()


def main() -> int:
    missed = 0
    for name in sys.argv[1:] or MUTATIONS:
        command = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "-p", "tests.benchmarks.mutations"]  # fmt: skip
        done = subprocess.run(
            [*command, *MUTATIONS[name][1]], cwd=ROOT, env={**os.environ, CHOSEN: name, "PYTHONPATH": str(ROOT)},
            capture_output=True, text=True,
        )  # fmt: skip
        missed += done.returncode != 1
        print(f"{name:12}{'caught' if done.returncode == 1 else 'MISSED'}  {done.stdout.splitlines()[-1:]}", flush=True)
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
