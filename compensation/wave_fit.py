"""Identification from a whole-angle run: damping and frequency splits with their axes, gains of the electronics.

With x = 2 n θ of the turning wave, and to first order (`whole_angle`):

    turn      n k ∫ (Ω_ind − Ω) dt = c₀ + c t + (ψ_m − ψ)(δ, κ) + ∫ ½ c [(δ − δ_d) cos x + (κ − κ_d) sin x] dt
                   + ∫ [½ (C₁ − ε W₁) sin x − ½ (C₂ − ε W₂) cos x] dt
    drive     1/τ + ½ (C₁ cos x + C₂ sin x)
    frequency ω₀ + ω₁ t + ½ (W₁ cos x + W₂ sin x)
    quadrature ½ (W₁ sin x − W₂ cos x)

beside what scale the applied and the commanded turn have, and in drive, frequency and quadrature what the force of a commanded turn leaks, which goes with its rate.
C = Δ(1/τ) (cos 2nθ_τ, sin 2nθ_τ) − (δ + δ_d, κ + κ_d)/τ as the driven wave has it, W = Δω (cos 2nθ_ω, sin 2nθ_ω), δ and κ
gain ratio and skew of the pick-offs, which also make the amplitude uneven that a commanded turn c (1/s) acts on, ε the phase error of the whole path. A wave that turns at one rate only cannot tell
κ, δ and leakage from damping: turn it both ways. The drives' own gains (index d) act as damping does, and only a run-down without drive
tells them apart; they are taken as given.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from compensation.arrays import Array
from compensation.errors import CompensationError
from compensation.noise_regression import fit_coloured
from compensation.ringdown.answer import Estimate
from compensation.samples import read_columns, require_regular

LEAST_TURN = 2 * np.pi  # least span of x (rad): one period of what is looked for
LEAKS = ("leak", "leak cos", "leak sin")
LEAST_CONTRAST = 0.05  # least spread of the turn rate over its largest: below it, turning both ways is missing


@dataclass(frozen=True)
class WaveFit:
    """Estimates by name, and sentences on what could not be determined.

    Names: `decay` 1/τ (1/s), `damping_split` Δ(1/τ) (1/s), `damping_axis` (rad), `frequency_split` (rad/s),
    `frequency_axis` (rad), `gain_ratio` δ, `skew` κ (rad), `phase_error` ε (rad), `rate` (rad/s, what is left of the rate).
    """

    estimates: dict[str, Estimate]
    undetermined: tuple[str, ...]
    confidence: float


def fit_whole_angle(
    time: ArrayLike, angle: ArrayLike, rate: ArrayLike, *, coupling: float, harmonic: int = 2,
    applied: ArrayLike = 0.0, decay: ArrayLike | None = None, frequency: ArrayLike | None = None,
    quadrature: ArrayLike | None = None, drive_gain_ratio: float = 0.0, drive_skew: float = 0.0,
    confidence: float = 0.95,
) -> WaveFit:  # fmt: skip
    """Fit splits, axes, gain ratio, skew and phase error to a whole-angle run: measured `angle` (rad), `rate` less the command, n k."""
    t, theta, indicated = read_columns(time=time, angle=angle, rate=rate)
    step = require_regular(t, "the fit of a whole-angle run")
    x = 2 * harmonic * theta
    if np.ptp(x) < LEAST_TURN:
        raise CompensationError(f"the wave precesses by only {np.degrees(np.ptp(theta)):.3g}°; the fit needs {180 / harmonic:g}° or more: precess it faster or record longer.")  # fmt: skip
    turn_rate = np.diff(theta)
    both_ways = np.ptp(_smooth(turn_rate)) > LEAST_CONTRAST * np.max(np.abs(_smooth(turn_rate)))
    z = float(scipy.special.ndtri(0.5 + confidence / 2))
    undetermined: list[str] = []
    estimates: dict[str, tuple[float, float]] = {}
    # Of the rows' means, all but the last: where the wave is at both ends of the row.
    seen = _Turn(x)
    command = harmonic * turn_rate / step - coupling * indicated[:-1]
    known = np.broadcast_to(np.asarray(applied, dtype=float), t.shape)[:-1]
    turns = [values for values in (command, known) if np.ptp(values) > LEAST_CONTRAST * np.max(np.abs(values))]
    leaks = [command, command * seen.cosine, command * seen.sine] if both_ways and turns and turns[0] is command else []
    W = _detuned(seen, t, frequency, quadrature, leaks, undetermined)
    phi = coupling * np.concatenate([[0.0], np.cumsum(indicated[:-1] - known)]) * step
    delta, kappa = (0.0, 0.0), (0.0, 0.0)
    for _ in range(4):
        behind = straighten(x / 2, delta[0], kappa[0])
        own = delta[0] - drive_gain_ratio, kappa[0] - drive_skew
        true = _Turn(x + 2 * behind)
        mean, S, S_cov, more = _turned(t, x, true, phi + behind, command, own, turns, both_ways)
        delta, kappa = (delta[0] + more[0][0], more[0][1]), (kappa[0] + more[1][0], more[1][1])
    gains = delta, kappa
    # Where the pick-offs' gains make the amplitude rise and fall, its drive does so too; of a commanded turn it is a leak.
    swell = (delta[0] * seen.sine - kappa[0] * seen.cosine) * (harmonic * turn_rate / step - command)
    driven = _driven(seen, decay, swell, leaks, undetermined)
    if driven is not None:
        estimates["decay"] = driven[2], driven[3]
    C, C_cov, epsilon = _join(S, S_cov, driven, W)
    if not both_ways:
        undetermined.append("gain ratio and skew: the wave precesses at one rate only; precess it in both directions")
    if epsilon is None:
        undetermined.append("phase error, which needs the drive effort (inverse_q) and the frequency or quadrature")
    else:
        estimates["phase_error"] = epsilon
    estimates["rate"] = mean[0] / coupling, mean[1] / coupling
    if both_ways:
        estimates["gain_ratio"], estimates["skew"] = gains[0], gains[1]
    if driven is not None:
        given = np.array([gains[0][0] + drive_gain_ratio, gains[1][0] + drive_skew])
        spread = np.array([gains[0][1], gains[1][1]])
        C, C_cov = C + given * driven[2], C_cov + np.diag((spread * driven[2]) ** 2)
    estimates |= _polar("damping", C, C_cov, harmonic)
    if W is not None:
        estimates |= _polar("frequency", *W, harmonic)
    estimates = _widen(estimates, harmonic, coupling)
    found = {name: Estimate.normal(value, sd, z) for name, (value, sd) in estimates.items()}
    return WaveFit(found, tuple(undetermined), confidence)


def _widen(estimates: dict[str, tuple[float, float]], harmonic: int, coupling: float) -> dict[str, tuple[float, float]]:
    """Add what formulas of first order leave out: of the size of the squares of the errors found, over 1/τ where damping is."""
    squares = sum(estimates[name][0] ** 2 for name in ("gain_ratio", "skew", "phase_error") if name in estimates)
    scale = {name: estimates[name][0] for name in ("decay", "damping_split", "frequency_split") if name in estimates}
    loss = scale.get("decay", scale["damping_split"])
    widths = {"decay": loss, "damping_split": loss, "damping_axis": loss / scale["damping_split"] / (2 * harmonic)}
    if "frequency_split" in scale:
        widths |= {"frequency_split": scale["frequency_split"], "frequency_axis": 1 / (2 * harmonic)}
        widths["phase_error"] = loss / scale["frequency_split"]
    left_out = {name: squares * width for name, width in widths.items()}
    left_out["rate"] = np.sqrt(squares) * scale["damping_split"] / (4 * coupling)
    return {name: (value, float(np.hypot(sd, left_out.get(name, 0.0)))) for name, (value, sd) in estimates.items()}


def straighten(psi: Array, gain_ratio: float, skew: float) -> Array:
    """Return ψ − ψ_m, what the pick-offs' gain ratio and skew take from the angle that they show (rad)."""
    stretch = np.eye(2) + np.array([[gain_ratio, skew], [skew, -gain_ratio]]) / 2
    x, y = np.linalg.solve(stretch, np.array([np.cos(psi), np.sin(psi)]))
    return np.asarray(np.arctan2(y * np.cos(psi) - x * np.sin(psi), x * np.cos(psi) + y * np.sin(psi)))


def _smooth(values: Array) -> Array:
    width = max(len(values) // 50, 1)
    return np.convolve(values, np.full(width, 1 / width), mode="valid")


def _white(X: Array, y: Array, names: list[str]) -> tuple[Array, Array]:
    """Return coefficients and covariance of a fit in white noise plus a random walk."""
    fit = fit_coloured(X, y, names, [slice(0, len(y))])
    return fit.regression.coefficients, fit.regression.covariance


class _Turn:
    """Means of cos x and sin x over rows in which x (at their ends) grows evenly."""

    def __init__(self, x: Array) -> None:
        middle, share = (x[1:] + x[:-1]) / 2, np.sinc(np.diff(x) / (2 * np.pi))
        self.cosine, self.sine = share * np.cos(middle), share * np.sin(middle)


def _driven(
    x: _Turn, decay: ArrayLike | None, swell: Array, leaks: list[Array], undetermined: list[str]
) -> tuple[Array, Array, float, float] | None:
    """Return C, its covariance, and 1/τ with its deviation, from the drive's effort."""
    if decay is None:
        undetermined.append("1/τ, because the drive effort (inverse_q) is not recorded")
        return None
    (column,) = read_columns(decay=decay)
    X = np.stack([np.ones_like(swell), x.cosine / 2, x.sine / 2, *leaks], axis=1)
    b, covariance = _white(X, column[:-1] - swell, ["1/τ", "cos", "sin", *LEAKS[: len(leaks)]])
    return b[1:3], covariance[1:3, 1:3], float(b[0]), float(np.sqrt(covariance[0, 0]))


def _detuned(
    x: _Turn, t: Array, frequency: ArrayLike | None, quadrature: ArrayLike | None, leaks: list[Array],
    undetermined: list[str],
) -> tuple[Array, Array] | None:  # fmt: skip
    """Return W and its covariance from frequency and quadrature, weighed by their precision."""
    ones, slope = np.ones(len(t) - 1), (t[:-1] - t.mean()) / np.ptp(t)
    names = [*LEAKS[: len(leaks)]]
    found = []
    if frequency is not None:
        (column,) = read_columns(frequency=frequency)
        X = np.stack([x.cosine / 2, x.sine / 2, ones, slope, *leaks], axis=1)
        b, covariance = _white(X, (column - column.mean())[:-1], ["cos", "sin", "mean", "drift", *names])
        found.append((b[:2], covariance[:2, :2]))
    if quadrature is not None:
        (column,) = read_columns(quadrature=quadrature)
        X = np.stack([x.sine / 2, -x.cosine / 2, ones, *leaks], axis=1)
        b, covariance = _white(X, column[:-1], ["sin", "cos", "mean", *names])
        found.append((b[:2], covariance[:2, :2]))
    if not found:
        undetermined.append("frequency split, because neither frequency nor quadrature is recorded")
        return None
    return _combine(found)


def _turned(
    t: Array, x: Array, true: _Turn, phi: Array, command: Array, own: tuple[float, float], turns: list[Array],
    both_ways: bool,
) -> tuple[tuple[float, float], Array, Array, tuple[tuple[float, float], tuple[float, float]]]:  # fmt: skip
    """Return the mean turn, (S_sin, S_cos) of the damping with their covariance, and (δ, κ) with deviations."""
    step = (t[-1] - t[0]) / (len(t) - 1)

    def integral(values: Array) -> Array:
        return np.asarray(np.concatenate([[0.0], np.cumsum(values)]) * step)

    along, across = integral(command * true.cosine) / 2, integral(command * true.sine) / 2
    columns = [np.ones_like(t), t - t[0], integral(true.sine), integral(true.cosine)]
    names = ["start", "rate", "sin", "cos"]
    if both_ways:
        columns += [along - np.sin(x) / 2, across + np.cos(x) / 2, *(integral(turn) for turn in turns)]
        names += ["gain ratio", "skew", *("scale", "second scale")[: len(turns)]]
    b, covariance = _white(np.stack(columns, axis=1), phi - own[0] * along - own[1] * across, names)
    sd = np.sqrt(np.diag(covariance))
    gains = ((float(b[4]), float(sd[4])), (float(b[5]), float(sd[5]))) if both_ways else ((0.0, 0.0), (0.0, 0.0))
    return (float(b[1]), float(sd[1])), b[2:4], covariance[2:4, 2:4], gains


def _join(
    S: Array, S_cov: Array, driven: tuple[Array, Array, float, float] | None, W: tuple[Array, Array] | None
) -> tuple[Array, Array, tuple[float, float] | None]:
    """Return C, its covariance and ε by drive and turn together: 2 S_sin = C₁ − ε W₁ and −2 S_cos = C₂ − ε W₂."""
    flip = np.array([2.0, -2.0])
    turned, turned_cov = flip * S, np.outer(flip, flip) * S_cov
    if driven is None or W is None:
        return (*_combine([(turned, turned_cov), *([driven[:2]] if driven else [])]), None)
    epsilon = 0.0
    for _ in range(3):  # the uncertainty of W counts with ε
        X = np.block([[np.eye(2), np.zeros((2, 1))], [np.eye(2), -W[0][:, None]]])
        V = np.block([[driven[1], np.zeros((2, 2))], [np.zeros((2, 2)), turned_cov + epsilon**2 * W[1]]])
        weight = np.linalg.inv(V)
        covariance = np.linalg.inv(X.T @ weight @ X)
        b = covariance @ X.T @ weight @ np.concatenate([driven[0], turned])
        epsilon = float(b[2])
    return b[:2], covariance[:2, :2], (epsilon, float(np.sqrt(covariance[2, 2])))


def _combine(found: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Return the mean of vectors with their covariances, weighed by their precision, and its covariance."""
    weights = [np.linalg.inv(covariance) for _, covariance in found]
    covariance = np.linalg.inv(sum(weights, np.zeros((2, 2))))
    return covariance @ sum((w @ b for w, (b, _) in zip(weights, found, strict=True)), np.zeros(2)), covariance


def _polar(name: str, vector: Array, covariance: Array, harmonic: int) -> dict[str, tuple[float, float]]:
    """Return a split and its axis from its two components, their deviations to first order."""
    size = float(np.hypot(*vector))
    along, across = vector / size, np.array([-vector[1], vector[0]]) / size
    return {
        f"{name}_split": (size, float(np.sqrt(along @ covariance @ along))),
        f"{name}_axis": (
            float(np.arctan2(vector[1], vector[0])) / (2 * harmonic),
            float(np.sqrt(across @ covariance @ across)) / size / (2 * harmonic),
        ),
    }
