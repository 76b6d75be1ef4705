"""Which other names are as right as the true one: what this noise cannot tell from it."""

import numpy as np

from tests.stranger.baseline import Fitted, Rows, orthonormal
from tests.stranger.effects import EFFECTS, JUDGED, Rng
from tests.stranger.network import lag
from tests.stranger.protocol import Run

SEPARABLE_SD = 4.0
DRAWS = 8


def shadow(target: str, shape: np.ndarray, response: str, slope: float, tau: float) -> np.ndarray | None:
    """What a unit shape of `target` does to a response, to first order; None where it does nothing the baseline keeps."""
    if target == response:
        return shape
    factors = {"temperature": slope, "clock": 4432.0}
    if response != "frequency" or target not in (*factors, "reading"):
        return None
    return factors[target] * shape if target in factors else -slope * lag(shape, tau)


def matched(structure: np.ndarray, draws: list[np.ndarray]) -> np.ndarray:
    """What of `structure` free amounts of the best two draws of a rival leave (two, since its constants are free)."""
    left, taken = structure, np.zeros((len(structure), 0))
    for _ in range(2):
        best = left
        for draw in draws:
            columns = np.column_stack([taken, draw])
            basis = orthonormal(columns) if np.linalg.norm(draw) > 0 else taken
            rest = structure - basis @ (basis.T @ structure)
            if rest @ rest < best @ best:
                best, chosen = rest, basis
        if best is left:
            break
        left, taken = best, chosen
    return left


def seen_in(direction: np.ndarray, fit: Fitted, noise: list[np.ndarray]) -> float:
    """Size of `direction` in standard deviations of what noise does along it (matched filter)."""
    size = float(np.linalg.norm(direction))
    return size / (float(np.std([direction / size @ fit.project(n) for n in noise])) + 1e-300) if size > 0 else 0.0


def nearest(
    name: str, response: str, structure: np.ndarray, fit: Fitted,
    rows: Rows, runs: list[Run], slope: float, barred: set[str], rng: Rng,
) -> dict[str, np.ndarray]:  # fmt: skip
    """What every other effect that this campaign could show leaves of the structure."""
    columns = {key for run in runs for key, v in run.drive.items() if np.ptp(v) > 0}
    left: dict[str, np.ndarray] = {}
    later = np.random.default_rng(len(structure))
    for other, effect in EFFECTS.items():
        drives = {n for n in effect.needs if n not in ("returns", "starts", "reference")}
        if other == name or other in barred or not drives <= columns:
            continue
        for target in effect.targets:
            if shadow(target, runs[0].time, response, slope, 1000.0) is not None:
                random = rng if other in JUDGED else later
                cast = [effect.draw(runs, random) for _ in range(DRAWS if other != "hysteresis" else 3)]
                cast = [[shadow(target, part, response, slope, runs[0].main_s) for part in shape] for shape in cast]
                left[other] = matched(structure, [fit.project(rows.at(c)) for c in cast])
    return left


def rivals(name: str, left: dict[str, np.ndarray], fit: Fitted, noise: list[np.ndarray]) -> dict[str, str]:
    """Names that leave less than `SEPARABLE_SD` of the structure in this noise, with the reason."""
    right = {name: "hidden"}
    for other, rest in left.items():
        if (sd := seen_in(rest, fit, noise)) < SEPARABLE_SD:
            right[other] = f"curves of this effect leave {sd:.1f} standard deviations of the true structure"
    return right
