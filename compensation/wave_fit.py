"""Identification from a whole-angle run: damping and frequency splits with their axes, gains of the electronics.

With x = 2 n θ of the turning wave, and to first order (`whole_angle`):

    turn      n k ∫ (Ω_ind − Ω) dt = c₀ + c t + (ψ_m − ψ)(δ, κ) + ∫ ½ c [(δ − δ_d) cos x + (κ − κ_d) sin x] dt
                   + ∫ [½ (C₁ − ε W₁) sin x − ½ (C₂ − ε W₂) cos x] dt
    drive     1/τ + ½ (C₁ cos x + C₂ sin x)
    frequency ω₀ + ω₁ t + ½ (W₁ cos x + W₂ sin x)
    quadrature ½ (W₁ sin x − W₂ cos x)

beside what scale the applied and the commanded turn have, and in drive, frequency and quadrature what the force of a commanded turn leaks, which goes with its rate.
C = Δ(1/τ) (cos 2nθ_τ, sin 2nθ_τ) − (δ + δ_d, κ + κ_d)/τ as the driven wave has it, W = Δω (cos 2nθ_ω, sin 2nθ_ω), δ and κ
difference of gain over its mean and skew of the pick-offs, which also make the amplitude uneven that a commanded turn c (1/s) acts on, ε the phase error of the whole path. A wave that turns at one rate only cannot tell
κ, δ and leakage from damping: turn it both ways. The drives' own gains (index d) act as damping does, and only a run-down without drive
tells them apart; they are taken as given. Drives turned by β against the pick-offs (index d again) let the nulled quadrature shift the frequency and the amplitude's drive
turn the wave: frequency and turn show W and C turned by −nβ, and a commanded turn c needs n β c of drive more, which turning both ways takes out.

Frequency and quadrature both tell W, drive and turn both C, the turn as C − ε W: columns that disagree beyond their errors widen the intervals,
and where they disagree by more than a tenth, none is believed. Rows that their neighbours contradict count as the line between these.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from compensation.arrays import Array
from compensation.electronics import Channels, ratio_of, uneven_of
from compensation.errors import CompensationError
from compensation.noise_regression import fit_coloured
from compensation.ringdown.answer import Estimate
from compensation.row_course import LONGEST, RowCourse
from compensation.samples import read_columns, require_regular, robust_spread
from compensation.spikes import find_spikes
from compensation.split_columns import Conflict, Told, join_columns, polar

LEAST_TURN = 2 * np.pi  # least span of x (rad): one period of what is looked for
LEAKS = ("leak", "leak cos", "leak sin")
LEAST_CONTRAST = 0.05  # least spread of the turn rate over its largest: below it, turning both ways is missing
SENSE = 0.1  # by which a turn may differ from what the applied rate makes, to be known as that
DOUBLED = 5.0  # times as large a wave of x/2 as of x is no wave of x; of a drift it is up to 4
MOST_UNKNOWN = 400  # rows whose course is not known
FEW, ODD = 30, 6.0  # rows whose turns may be unknowns, and robust standard deviations that make one so
LEAST_SPIKE = 1e-3  # of a column's span, by which a spike stands out
MISALIGNED = 5e-4  # rad, usual standard deviation of the drives' misalignment to the pick-offs
UNEVEN = np.array([0.005, 1e-3])  # usual standard deviations of gain ratio and skew (rad) of pick-offs and drives


@dataclass(frozen=True)
class WaveFit:
    """Estimates by name, and sentences on what could not be determined.

    Names: `decay` 1/τ (1/s), `damping_split` Δ(1/τ) (1/s), `damping_axis` (rad), `frequency_split` (rad/s),
    `frequency_axis` (rad), `gain_ratio` g_x/g_y − 1, `skew` κ (rad), `phase_error` ε (rad), `rate` (rad/s, what is left of the rate).
    Columns are named as the arguments; the damping of `rate` takes ε from all (as 0 where they contradict each other).
    """

    estimates: dict[str, Estimate]
    undetermined: tuple[str, ...]
    confidence: float
    alone: dict[str, dict[str, Estimate]]  # what each column says by itself
    conflicts: tuple[Conflict, ...]
    spikes: dict[str, NDArray[np.intp]]  # rows of each column that their neighbours contradict
    wrapped: float  # rad, where the angle was wrapped, which is undone; 0 where it was not
    uneven: NDArray[np.intp]  # rows within which it is not known how the wave turned, which are left out
    doubled: tuple[str, ...]  # columns that go as n θ rather than 2 n θ of the angle


def fit_whole_angle(
    time: ArrayLike, angle: ArrayLike, rate: ArrayLike, *, coupling: float, harmonic: int = 2,
    applied: ArrayLike = 0.0, decay: ArrayLike | None = None, frequency: ArrayLike | None = None,
    quadrature: ArrayLike | None = None, drive_gain_ratio: float = 0.0, drive_skew: float = 0.0,
    pickoff_gain_ratio: float = 0.0, pickoff_skew: float = 0.0, misalignment: tuple[float, float] = (0.0, MISALIGNED),
    stiff: bool = False, late: float = 0.0, confidence: float = 0.95,
) -> WaveFit:  # fmt: skip
    """Fit splits, axes, gain ratio, skew and phase error to a whole-angle run: measured `angle` (rad), `rate` less the command, n k.

    Columns are means over rows; the angle is read `late` rows after each begins. A column that stands still, too coarse to follow the wave,
    tells nothing. The pick-offs' gains count where the run does not tell them. `misalignment` of the drives (rad) is given with its
    deviation; `stiff`: quadrature is nulled by a stiffness, which has none.
    """
    columns = {"angle": angle, "rate": rate}
    more = {"frequency": frequency, "quadrature": quadrature, "decay": decay}
    columns |= {name: column for name, column in more.items() if column is not None and np.ptp(column)}
    t, *read = read_columns(time=time, **columns)
    step = require_regular(t, "the fit of a whole-angle run")
    read[0], wrapped = unwrap(read[0], harmonic)
    pushed = np.broadcast_to(np.asarray(applied, dtype=float), t.shape)
    carried = coupling / harmonic * step * np.concatenate([[0.0], np.cumsum(pushed[:-1])])
    read[0], read[1] = read[0] - carried, read[1] - pushed  # a rate that is applied may change from row to row
    bad = {name: find_spikes(y, LEAST_SPIKE * (name != "angle")) for name, y in zip(columns, read, strict=True)}
    y = {name: np.interp(t, t[~bad[name]], one[~bad[name]]) for name, one in zip(columns, read, strict=True)}
    y["angle"], y["rate"] = y["angle"] + carried, y["rate"] + pushed
    theta, indicated = _begin_rows(y["angle"], late), y["rate"]
    x = 2 * harmonic * theta
    if np.ptp(x) <= LEAST_TURN:
        raise CompensationError(f"the wave precesses by only {np.degrees(np.ptp(theta)):.3g}°; the fit needs more than {180 / harmonic:g}°: precess it faster or record longer.")  # fmt: skip
    turn_rate = np.diff(theta)
    both_ways = np.ptp(_smooth(turn_rate)) > LEAST_CONTRAST * np.max(np.abs(_smooth(turn_rate)))
    z = float(scipy.special.ndtri(0.5 + confidence / 2))
    undetermined: list[str] = []
    # Of the rows' means, all but the last: where the wave is at both ends of the row.
    seen = RowCourse.of(x)
    unknown = _find_unknown(seen, harmonic)
    command = harmonic * turn_rate / step - coupling * indicated[:-1]
    known = pushed[:-1]
    _check_sense(harmonic * turn_rate / step, coupling * known)
    turns = [values for values in (command, known) if _varies(values)]
    leaks = [command, command * seen.cosine, command * seen.sine] if both_ways and turns and turns[0] is command else []
    # What a steady command leaks through uneven gains is not told from the splits: by the gains, which turning one way does not tell.
    leak = 0.0 if leaks else float(np.median(command))
    phi = coupling * np.concatenate([[0.0], np.cumsum(indicated[:-1] - known)]) * step
    card = np.array([uneven_of(pickoff_gain_ratio), pickoff_skew])
    gains, spread = np.zeros(2) if both_ways else card, UNEVEN
    drives, lost = np.array([uneven_of(drive_gain_ratio), drive_skew]), np.flatnonzero(bad["rate"][:-1])[:FEW]
    lost = np.union1d(lost, unknown)
    for _ in range(4):
        behind = straighten(x / 2, *gains)
        mean, turned, missed, spread, odd = _turned(
            t, x, RowCourse.of(x + 2 * behind), phi + behind, command, gains - drives, turns, both_ways, lost
        )
        gains, lost = gains + missed, np.union1d(lost, odd[:FEW])
    bad["rate"][np.setdiff1d(lost, unknown)] = True
    estimates = {"rate": (mean[0] / coupling, mean[1] / coupling)}
    loss, conflicts = 0.0, list[Conflict]()
    if "decay" in y:
        # Where the pick-offs' gains make the amplitude rise and fall, its drive does so too; of a commanded turn it is a leak.
        # The mean of sin x dx/dt over a row is that of −cos x at its ends.
        ends = gains[0] * np.diff(-np.cos(x)) - gains[1] * np.diff(np.sin(x))
        y["decay"][:-1] -= ends / (2 * step) - (gains[0] * seen.sine - gains[1] * seen.cosine) * command
    doubt = spread if both_ways else UNEVEN
    found = _modulated(seen, t, y, bad, leaks, (leak * doubt.max()) ** 2)
    tilt = harmonic * misalignment[0], harmonic * misalignment[1]
    told = {name: one for name, (one, _) in found.items()}
    if "frequency" in told and not stiff:
        told["frequency"] = _turned_back(told["frequency"], tilt, told["frequency"][0])
    if "decay" in told:
        told["decay"] = told["decay"][0] + leak * (gains + drives)[::-1] * [1, -1], told["decay"][1]
        level, spread_of_level = found["decay"][1]
        estimates["decay"] = level - leak * tilt[0], float(np.hypot(spread_of_level, leak * tilt[1]))
        loss = estimates["decay"][0]
    told["rate"] = _turned_back(turned, tilt, told.get("decay", turned)[0] + loss * (gains + drives))
    W = join_columns("frequency", ("frequency", "quadrature"), told, conflicts)[0]
    joined, epsilon = join_columns("damping", ("decay", "rate"), told, conflicts, None if stiff else W)
    wrong = {one.split for one in conflicts if not one.widened}
    if "damping" in wrong:  # nor is what the turn says of the gains believed
        gains, spread = card, UNEVEN
    if epsilon is not None and not wrong:
        estimates["phase_error"] = epsilon
    if both_ways and "damping" not in wrong:
        estimates |= {"gain_ratio": (ratio_of(gains[0]), spread[0]), "skew": (gains[1], spread[1])}

    def true(one: Told) -> Told:
        """Damping as it is without the gains, which the driven wave has in it."""
        return one[0] + loss * (gains + drives), one[1] + np.diag((loss * spread) ** 2 + 2 * (leak * doubt[::-1]) ** 2)

    if epsilon is not None and W is not None:
        turn, spread_of_turn = told["rate"]
        told["rate"] = turn + epsilon[0] * W[0], spread_of_turn + epsilon[1] ** 2 * np.outer(W[0], W[0])
    told |= {name: true(told[name]) for name in ("decay", "rate") if name in told}
    splits = {"rate": "damping", "decay": "damping"}
    alone = {name: polar(splits.get(name, "frequency"), *one, harmonic) for name, one in told.items()}
    if W is None:
        undetermined.append(
            "frequency split, because neither frequency nor quadrature is recorded, or finely enough to vary"
        )
    for name, one in {"frequency": W, "damping": joined and true(joined)}.items():
        own = polar(name, *one, harmonic) if one else {}
        if leak and not both_ways and one and np.divide(*own[f"{name}_split"]) < 2:
            undetermined.append(f"{name} split and axis: in one direction they are not told from what uneven gains make of a commanded turn")  # fmt: skip
        elif name not in wrong:
            estimates |= own
            if own and f"{name}_axis" not in own:
                undetermined.append(f"{name} axis: the split is not told from none")
    if "decay" not in estimates:
        undetermined.append("1/τ, because the drive effort (inverse_q) is not recorded, or finely enough to vary")
    if not both_ways:
        undetermined.append(
            "gain ratio, skew and misalignment: the wave precesses at one rate only; precess it in both directions"
        )
    if epsilon is None and not wrong:
        undetermined.append(
            "phase error, which needs the drive effort (inverse_q), the frequency or quadrature, and quadrature that a force controls"
        )

    def stated(values: dict[str, tuple[float, float]]) -> dict[str, Estimate]:
        widened = _widen(estimates | values, float(np.hypot(*tilt)), harmonic, coupling)
        return {name: Estimate.normal(*widened[name], z) for name in values}

    return WaveFit(
        stated(estimates), tuple(undetermined), confidence,
        {name: stated(one) for name, one in alone.items()}, tuple(conflicts),
        {name: np.flatnonzero(rows) for name, rows in bad.items() if rows.any()},
        wrapped, unknown, tuple(name for name, values in y.items() if name != "angle" and _is_doubled(x, values)),
    )  # fmt: skip


def unwrap(angle: Array, harmonic: int) -> tuple[Array, float]:
    """Return the angle (rad) as it turned, and the period of the wave, its axis or the circle within which it was wrapped (0: it was not)."""
    for period in (np.pi / harmonic, np.pi, 2 * np.pi):
        turned = np.unwrap(angle, period=period)
        if np.ptp(angle) <= period < np.ptp(turned) and np.max(np.abs(np.diff(turned))) < period / 4:
            return turned, period
    return angle, 0.0


def _is_doubled(x: Array, values: Array) -> bool:
    """Tell whether a column goes around with x/2, hardly with x: angles that are n θ have been given for θ."""
    if np.ptp(x) < 2 * LEAST_TURN:
        return False
    X = np.stack([np.ones_like(x), np.cos(x / 2), np.sin(x / 2), np.cos(x), np.sin(x)], axis=1)
    b, varied = np.linalg.lstsq(X, values, rcond=None)[0], float(np.std(values))
    return bool(np.hypot(*b[1:3]) > max(DOUBLED * np.hypot(*b[3:]), varied))


def _turned_back(one: Told, tilt: tuple[float, float], split: Array) -> Told:
    """What drives turned by `tilt` (rad of nθ, and its deviation) show of a split, as those of no tilt do."""
    across = np.array([-split[1], split[0]])
    return one[0] + tilt[0] * across, one[1] + tilt[1] ** 2 * np.outer(across, across)


def _check_sense(turn: NDArray[np.float64], pushed: NDArray[np.float64]) -> None:
    """Refuse a wave that turns (1/s) by what the applied rate makes of it, but in the opposite sense."""
    turn, pushed = turn - turn.mean(), pushed - pushed.mean()
    along, sizes = float(turn @ pushed), (float(np.linalg.norm(turn)), float(np.linalg.norm(pushed)))
    if sizes[1] and abs(along / sizes[1] ** 2 + 1.0) < SENSE and along < -(1.0 - SENSE) * sizes[0] * sizes[1]:
        raise CompensationError("the wave turns against the applied rate, by the Bryan factor: a positive rate must turn the angle positively. Change the sign of the angle, or of applied and measured rate.")  # fmt: skip


def _widen(
    estimates: dict[str, tuple[float, float]], tilt: float, harmonic: int, coupling: float
) -> dict[str, tuple[float, float]]:
    """Add what formulas of first order leave out: of the size of the squares of the errors found, over 1/τ where damping is."""
    errors = [estimates[name][0] for name in ("gain_ratio", "skew", "phase_error") if name in estimates]
    squares = float(np.sum(np.square([tilt, *errors])))
    scale = {name: estimates[name][0] for name in ("decay", "damping_split", "frequency_split") if name in estimates}
    split = scale.get("damping_split", 0.0)
    loss = scale.get("decay", split)
    widths = {"decay": loss, "damping_split": loss, "damping_axis": loss / (split or np.inf) / (2 * harmonic)}
    if "frequency_split" in scale:
        widths |= {"frequency_split": scale["frequency_split"], "frequency_axis": 1 / (2 * harmonic)}
        widths["phase_error"] = loss / scale["frequency_split"]
    left_out = {name: squares * width for name, width in widths.items()}
    uneven = float(np.linalg.norm([estimates.get(name, (0.0, 0.0))[0] for name in ("gain_ratio", "skew")]))
    left_out |= {"gain_ratio": tilt * uneven, "skew": tilt * uneven}  # one as the other, in drives turned by it
    left_out["rate"] = np.sqrt(squares) * split / (4 * coupling)
    return {name: (value, float(np.hypot(sd, left_out.get(name, 0.0)))) for name, (value, sd) in estimates.items()}


def straighten(psi: Array, uneven: float, skew: float) -> Array:
    """Return ψ − ψ_m, what the pick-offs' gains, uneven by δ, and skew take from the angle that they show (rad)."""
    pickoff = Channels(ratio_of(uneven), skew=skew).matrix(1).real
    x, y = np.linalg.solve(pickoff, np.array([np.cos(psi), np.sin(psi)]))
    return np.asarray(np.arctan2(y * np.cos(psi) - x * np.sin(psi), x * np.cos(psi) + y * np.sin(psi)))


def _begin_rows(angle: Array, late: float) -> Array:
    """Return the angle at which rows begin, from readings `late` rows later: the lines through those before and after, as a reversal lies between."""
    before, after = np.diff(angle, prepend=2 * angle[0] - angle[1]), np.diff(angle, append=2 * angle[-1] - angle[-2])
    behind = angle - before + (1 - late) * np.append(before[:1], before[:-1])
    return np.asarray((1 - late) * (angle - late * after) + late * behind)


def _find_unknown(course: RowCourse, harmonic: int) -> NDArray[np.intp]:
    """Return the rows whose means are of an unknown course; they may not be nearly all."""
    unknown = np.flatnonzero(~course.known)
    if len(course.known) - len(unknown) < FEW or len(unknown) > MOST_UNKNOWN:
        raise CompensationError(f"in {len(unknown)} of {len(course.known)} rows the wave turns unevenly, or by more than {np.degrees(LONGEST / 2 / harmonic):.0f}°: what their means are of is not known. Record shorter rows, or hold each rate for several.")  # fmt: skip
    return unknown


def _varies(values: Array) -> bool:
    """Whether a turn does, beside a few odd rows."""
    low, high = np.percentile(values, [2.0, 98.0])
    return bool(high - low > LEAST_CONTRAST * max(abs(low), abs(high)))


def _smooth(values: Array) -> Array:
    width = max(len(values) // 50, 1)
    return np.convolve(values, np.full(width, 1 / width), mode="valid")


def _modulated(
    x: RowCourse,
    t: Array,
    columns: dict[str, Array],
    bad: dict[str, NDArray[np.bool_]],
    leaks: list[Array],
    leaked: float,
) -> dict[str, tuple[Told, tuple[float, float]]]:
    """Return W from frequency and from quadrature, C from the drive's effort, and the level of each with its deviation."""
    ones, slope = np.ones(len(t) - 1), (t[:-1] - t.mean()) / np.ptp(t)
    terms = {
        "frequency": [x.cosine / 2, x.sine / 2, ones, slope],
        "quadrature": [x.sine / 2, -x.cosine / 2, ones],
        "decay": [x.cosine / 2, x.sine / 2, ones],
    }
    found = {}
    for name in [name for name in terms if name in columns]:
        X, mean = np.stack([*terms[name], *leaks], axis=1), columns[name].mean()
        names = [*("first", "second", "mean", "drift")[: len(terms[name])], *LEAKS[: len(leaks)]]
        keep = x.known & ~bad[name][:-1]
        coloured = fit_coloured(X[keep], columns[name][:-1][keep] - mean, names, [slice(0, int(keep.sum()))])
        fit = coloured.regression
        b, covariance = fit.coefficients, fit.covariance + (leaked if name != "decay" else 0.0) * np.eye(X.shape[1])
        covariance[:2, :2] += (2 * _rounding(columns[name], coloured.residuals, np.hypot(*b[:2]) / 2)) ** 2 * np.eye(2)
        found[name] = (b[:2], covariance[:2, :2]), (float(mean + b[2]), float(np.sqrt(covariance[2, 2])))
    return found


def _rounding(values: Array, residuals: Array, amplitude: float) -> float:
    """Return the deviation that rounding to steps r gives the amplitude A of a wave: (2 r/π) J₁(2πA/r) exp(−2π² σ²/r²), σ the noise before it."""
    r = float(np.median(np.diff(np.unique(values))))
    noise = max(float(np.var(residuals)) - r**2 / 12, 0.0)
    bessel = min(1 / np.sqrt(np.pi * (2 * np.pi * amplitude / r)), 0.582)  # rms over phases, at most the largest of J₁
    return float(2 * r / np.pi * bessel * np.exp(-2 * (np.pi / r) ** 2 * noise))


def _turned(
    t: Array,
    x: Array,
    true: RowCourse,
    phi: Array,
    command: Array,
    own: Array,
    turns: list[Array],
    both_ways: bool,
    lost: NDArray[np.intp],
) -> tuple[tuple[float, float], Told, Array, Array, NDArray[np.intp]]:
    """Return the mean turn, C − ε W, what is missing of (δ, κ), with errors, and rows that turn oddly; `lost` ones turn by something unknown."""
    step = (t[-1] - t[0]) / (len(t) - 1)

    def integral(values: Array) -> Array:
        return np.asarray(np.concatenate([[0.0], np.cumsum(values)]) * step)

    along, across = integral(command * true.cosine) / 2, integral(command * true.sine) / 2
    columns = [np.ones_like(t), t - t[0], integral(true.sine) / 2, -integral(true.cosine) / 2]
    gains = [along - np.sin(x) / 2, across + np.cos(x) / 2]
    names = ["start", "rate", "sin", "cos"]
    if both_ways:
        columns += [*gains, *(integral(turn) for turn in turns)]
        names += ["gain ratio", "skew", *("scale", "second scale")[: len(turns)]]
    columns += [np.where(np.arange(len(t)) > row, step, 0.0) for row in lost]
    names += [f"row {row}" for row in lost]
    X, runs = np.stack(columns, axis=1), [slice(0, len(t))]
    fit = fit_coloured(X, phi - own[0] * along - own[1] * across, names, runs)
    b, covariance = fit.regression.coefficients, fit.regression.covariance
    missed, spread = (b[4:6], np.sqrt(np.diag(covariance))[4:6]) if both_ways else (np.zeros(2), UNEVEN)
    new = np.abs(fit.regression.residuals[1:])  # what a row adds that the one before does not foretell
    odd = np.flatnonzero(new > max(ODD * robust_spread(new), LEAST_SPIKE * float(np.ptp(np.diff(phi)))))
    return (float(b[1]), float(np.sqrt(covariance[1, 1]))), (b[2:4], covariance[2:4, 2:4]), missed, spread, odd
