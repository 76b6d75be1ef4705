"""What a calibration by modes says beside its numbers."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from studies.inversion.model import ModeFit, Which
from studies.inversion.readings import USUAL, ModeReadings

Array = NDArray[np.float64]


def warn(fit: ModeFit, readings: ModeReadings, misfit: float, doubted: bool, relative: Array) -> list[str]:
    """Sentences on what makes the result doubtful."""
    found = []
    if not fit.converged:
        found.append("the fit did not converge; keep more values fixed (--exact), or check the assignment.")
    if readings.assumed:
        found.append(f"{readings.path}: where sd_Hz is empty, {USUAL:g} of the frequency was taken.")
    if doubted:
        worst = int(np.argmax(np.abs(fit.residual / fit.noise)))
        found.append(
            f"the readings lie {np.sqrt(misfit):.2g} times as far from the card as expected; the largest residual is"
            f" {1e6 * fit.residual[worst]:+.2g} ppm in line {readings.lines[worst]}. The intervals are widened accordingly; a wrong assignment,"
            " an exact value that is wrong, charged electrodes, films or a wall that is not as the card says can be the cause."
        )
    solver = np.sqrt(np.maximum(fit.noise**2 - relative**2, 0.0))
    if (solver > relative).any():
        found.append(
            f"the solver's own error, up to {1e6 * solver.max():.2g} ppm, is larger than the readings' and counts as noise; a stem with a"
            " fillet is solved more accurately."
        )
    return found


def unexplained(
    readings: ModeReadings, y: Array, allowed: Sequence[Sequence[int]], g: Array, J: Array, every: Sequence[Which]
) -> str:
    """Say which reading is farthest from every mode that it may be."""
    wide = np.linalg.norm(J, axis=1)
    away = [
        min(((abs(y[i] - g[m]) / wide[m], m) for m in found), default=(np.inf, -1)) for i, found in enumerate(allowed)
    ]
    i = max(range(len(away)), key=lambda i: away[i][0])
    distance, m = away[i]
    near = "; the card has no such mode near it"
    if m >= 0:
        mode = f"n = {every[m].harmonic} at {np.exp(g[m]):.6g} Hz"
        near = f"; the nearest, {mode}, is {distance:.2g} standard deviations away"
    return (
        f"{readings.path}: no assignment explains all readings within the card's tolerances; line {readings.lines[i]}"
        f" ({readings.frequency[i]:.6g} Hz) fits least{near}. Leave it out, or widen the tolerances."
    )
