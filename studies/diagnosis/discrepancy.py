"""A generic witness: is anything left that smooth functions of time, temperature, rate or drives explain?

For each kind of input a set of smooth functions with one common unknown amplitude (a low-rank Gaussian process) is
added to the fitted model; its evidence is twice the log-likelihood ratio at the best amplitude, the share of the
random walk profiled in both. It names no cause: it says that the library has none, and in which input to look.
"""

from dataclasses import dataclass

import numpy as np

from studies.diagnosis.baseline import Problem, View
from studies.diagnosis.fit import Fit, jacobian_of
from studies.diagnosis.likelihood import SHARES, orthonormal, unit
from studies.diagnosis.states import FloatArray, lag

AMPLITUDES = np.geomspace(1e-4, 1e3, 15)


@dataclass(frozen=True)
class Leftover:
    """What the generic witness saw: the input in which structure is left, and its evidence."""

    input: str
    evidence: float


def generic_bases(problem: Problem) -> dict[str, FloatArray]:
    """Return smooth functions of each input, (M, m), by the name of the input."""
    views = problem.views(problem.tau)
    parts: dict[str, list[FloatArray]] = {}
    low = min(float(v.coarse.resonator.min()) for v in views)
    high = max(float(v.coarse.resonator.max()) for v in views)
    for number, view in enumerate(views):
        for name, columns in _functions(problem, view, low, high, number, len(views)).items():
            parts.setdefault(name, []).append(columns)
    out = {}
    for name, pieces in parts.items():
        if len(pieces) != len(views):
            continue
        stacked = problem.stack(pieces)
        size = np.sqrt(np.mean(stacked**2, axis=0))
        kept = size > 0
        if kept.any():
            out[name] = stacked[:, kept] / size[kept]
    return out


def _functions(problem: Problem, view: View, low: float, high: float, number: int, runs: int) -> dict[str, FloatArray]:
    s = view.seen
    x = s.excess / 30.0
    wide = max(high - low, 1e-6)
    rate = s.rate / max(float(np.abs(s.rate).max()), 1e-12)
    out: dict[str, FloatArray] = {}
    if wide > 0.5:
        for name, count in (("temperature", 12), ("temperature, narrow", 28)):
            centres = np.linspace(low, high, count)
            width = 1.1 * wide / (count - 1)
            out[name] = np.exp(-0.5 * ((s.resonator[:, None] - centres) / width) ** 2)
        out["rate"] = np.stack(
            [rate, np.abs(rate), rate * np.abs(rate), rate * x, rate * x**2, np.abs(rate) * x], axis=1
        )
        out["history"] = np.stack(
            [
                view_lag
                for factor in (0.1, 0.3, 0.6, 2.0, 4.0, 10.0)
                for view_lag in [_coarse_lag(view, factor * max(s.tau, 60.0)) - s.resonator]
            ]
            + [(_coarse_lag(view, 3.0 * max(s.tau, 60.0)) - s.resonator) * x],
            axis=1,
        )
    duration = max(float(s.time[-1] - s.time[0]), 1.0)
    longest = max(duration, *(float(np.ptp(other.time)) for other in problem.states))
    waves = np.cos(np.pi * np.arange(1, 13) * ((s.time - s.time[0]) / duration)[:, None])
    own = np.zeros((s.time.size, 12 * runs))
    own[:, 12 * number : 12 * (number + 1)] = waves
    out["time"] = own
    out["time since the start of each run"] = np.cos(
        np.pi * np.arange(1, 25) * ((s.time - s.time[0]) / longest)[:, None]
    )
    drives = []
    for square in (s.voltage_squared, s.amplitude_squared):
        if square is not None:
            unit = square / max(float(square.max()), 1e-300)
            drives += [unit, unit * x, unit * x**2, np.sqrt(unit), unit**2, unit * rate]
    if s.voltage_squared is not None and s.amplitude_squared is not None:
        drives.append(
            s.voltage_squared
            * s.amplitude_squared
            / max(float((s.voltage_squared * s.amplitude_squared).max()), 1e-300)
        )
    if s.quadrature is not None:
        unit = s.quadrature / max(float(np.abs(s.quadrature).max()), 1e-300)
        drives += [unit, unit**2, unit * x]
    if s.pattern_angle is not None:
        turn = 4.0 * s.pattern_angle
        drives += [f(turn) * x**k for f in (np.sin, np.cos) for k in range(4)]
    if drives:
        out["voltage, amplitude, quadrature or azimuth"] = np.stack(drives, axis=1)
    return out


def _coarse_lag(view: View, tau: float) -> FloatArray:
    return np.asarray(lag(view.coarse.resonator, view.coarse.step, tau))


def leftover_evidence(
    fit: Fit, bases: dict[str, FloatArray], targets: FloatArray | None = None
) -> dict[str, FloatArray]:
    """Return the evidence of every generic basis on top of a fit, for the data or for given rotated draws.

    Parameters
    ----------
    fit : Fit
    bases : mapping
        From `generic_bases`.
    targets : (M, B) array, optional
        Rotated draws in the place of the data.
    """
    problem = fit.problem
    basis = problem.basis
    model = basis.rotate(np.concatenate([fit.columns(), jacobian_of(fit)], axis=1))
    data = basis.rotate(problem.values)[:, None] if targets is None else targets
    rows = data.shape[0]
    rotated = {name: basis.rotate(columns) for name, columns in bases.items()}
    null = np.full((data.shape[1],), np.inf)
    best = {name: np.full((data.shape[1],), np.inf) for name in bases}
    for share in near_shares(fit.linear.share):
        root = np.sqrt(basis.weights(share))[:, None]
        ortho = orthonormal(unit(model) * root)
        rest = data * root
        rest = rest - ortho @ (ortho.T @ rest)
        total = np.maximum((rest**2).sum(axis=0), 1e-300)
        determinant = basis.log_determinant(share)
        null = np.minimum(null, rows * np.log(total) + determinant)
        for name, columns in rotated.items():
            white = columns * root
            white = white - ortho @ (ortho.T @ white)
            values, vectors = np.linalg.eigh(white.T @ white)
            kept = values > 1e-8 * max(float(values[-1]), 1e-300)
            values, vectors = values[kept], vectors[:, kept]
            seen = (vectors.T @ (white.T @ rest)) ** 2 / values[:, None]
            for amplitude in AMPLITUDES:
                gain = amplitude * values / (1.0 + amplitude * values)
                score = rows * np.log(np.maximum(total - gain @ seen, 1e-9 * total))
                np.minimum(best[name], score + determinant + np.log1p(amplitude * values).sum(), out=best[name])
    return {name: null - score for name, score in best.items()}


def near_shares(share: float) -> FloatArray:
    """Return the shares of slow noise around a fitted one."""
    near = int(np.argmin(np.abs(SHARES - share)))
    return SHARES[max(0, near - 3) : near + 2]


def strongest(evidence: dict[str, FloatArray], levels: dict[str, float]) -> Leftover:
    """Return the basis with the largest evidence net of its null level."""
    if not evidence:
        return Leftover("", 0.0)
    name = max(evidence, key=lambda key: float(evidence[key][0]) - levels.get(key, LEVEL))
    return Leftover(name, float(evidence[name][0]) - levels.get(name, LEVEL))


LEVEL = 1.0
"""Null level of a generic basis without a calibration of its own: the amplitude pays most of its way."""
