"""A tolerance study: how far thickness and radius of a production run spread its frequency, and the share within limits."""

from typing import Any

import hrg

SPEC = {
    "name": "a production run of domes",
    "card": "free-dome",
    "sampling": {"method": "sobol", "cases": 64, "seed": 1},
    "parameter": [
        {"name": "resonator.thickness_mm", "tolerance": 0.005},
        {"name": "resonator.radius_mm", "tolerance": 0.005},
    ],
    "quantity": [{"name": "frequency", "harmonic": 2, "theory": "shell"}],
    "requirement": [{"column": "frequency_n2_Hz", "within": 25.0}],
}


def study_tolerances() -> tuple[Any, Any]:
    """Run the study in memory, on one process, and judge it; give `out=` a folder to keep and resume it."""
    results = hrg.run_study(SPEC, workers=1)
    return results, hrg.find_yield(results, results.study.requirements)


if __name__ == "__main__":
    found, share = study_tolerances()
    f = found.column("frequency_n2_Hz")
    print(
        f"{len(f)} designs, {len(found.failed)} failed: {f.mean():.1f} Hz on average, from {f.min():.1f} to {f.max():.1f} Hz"
    )
    print(
        f"within limits: {share.passed} of {share.cases}; the true share lies between {100 * (share.low or 0.0):.1f} and {100 * (share.high or 0.0):.1f} %"
    )
