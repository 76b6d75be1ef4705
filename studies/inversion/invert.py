r"""Values of a card from measured modes: the most probable ones, how well they are known, and which mode to measure next.

    y_i = ln f_{m(i)}(u) + ε_i,   u ~ N(0, 1),   ε_i ~ N(0, σ_i²), σ² the reading's and the solver's,

is minimised in u by Gauss-Newton steps for each likely assignment m; exp(-½ cost), cost = |r|² + |u|² + ln det(1 + JᵀJ),
weighs the assignments (Laplace). A further mode with derivative j would lower the variance s C sᵀ of a value by
(s C j)²/(j C jᵀ + σ²).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.constants import NINETY
from studies.calibration.estimates import Estimate, OfEstimates, find_groups, posterior_card
from studies.calibration.priors import Priors, check_exact, gather_priors
from studies.errors import InputError
from studies.instrument.card import Instrument
from studies.inversion.assignment import assign
from studies.inversion.model import ModeFit, ModeModel, Which
from studies.inversion.readings import USUAL, ModeReadings

Progress = Callable[[str], None]
ACTING = ("resonator.", "material.")
IDLE = ("conductivity", "heat_capacity")
CURVED = 1.5  # of the squared prior width of ln f: what a straight line leaves at that distance
ABOVE = 1.15  # frequency of the highest candidate over the highest reading
OTHER = 0.4  # of ln f, beyond which a reading is of another mode than is said
NEAR, FAR, MOST_STEPS = 0.02, 0.02, 12  # posterior and prior standard deviations, Gauss-Newton steps
RIVALS, UNLIKELY = 4, 20.0  # assignments that are fitted, and their cost above the best's
UNDECIDED = 0.05  # probability of other assignments from which a reading's is not decided
DOUBTED = 1e-3  # probability of so large a misfit, below which the intervals are widened by it


@dataclass(frozen=True)
class NextMode:
    """A mode that would tell most of a value: its deviation now and then, in the card's unit."""

    parameter: str
    harmonic: int
    index: int
    frequency_Hz: float
    sd: float
    sd_then: float


@dataclass(frozen=True, eq=False, repr=False)
class ModeCalibration(OfEstimates):
    """A card and what its modes say of it."""

    # card, instrument: as given; with the values found.
    card: Instrument
    instrument: Instrument
    readings: ModeReadings
    fit: ModeFit  # of the likeliest assignment
    estimates: tuple[Estimate, ...]
    # names of values that share what is known of one that the modes do not tell, as the modulus does of the density.
    groups: tuple[tuple[str, ...], ...]
    # of each reading's assignment; `rivals` are the other modes that it may be, (harmonic, index, chance).
    chance: tuple[float, ...]
    rivals: tuple[tuple[tuple[int, int, float], ...], ...]
    next_modes: tuple[NextMode, ...]
    misfit: float  # squared, over what is expected
    warnings: tuple[str, ...]

    def __repr__(self) -> str:
        return f"ModeCalibration({self.card.name}: {self.determined}; {len(self.readings)} modes)"


def invert(
    instrument: Instrument, readings: ModeReadings, exact: Sequence[str] = (), progress: Progress = lambda _: None
) -> ModeCalibration:
    """Find the card's uncertain dimensions and elastic values from the frequencies of its modes."""
    priors = _priors(instrument, exact)
    T = np.where(np.isnan(readings.temperature), instrument.reference_temperature, readings.temperature)
    relative = readings.sd / readings.frequency
    model = ModeModel(instrument, priors, float(np.clip(0.1 * relative.min(), 1e-8, 1e-6)))
    progress("modes of the card")
    fits = _fit_likely(model, readings, T, relative, progress)
    best = fits[0]
    weights = np.exp(-0.5 * np.array([one.cost - best.cost for one in fits]))
    weights /= weights.sum()
    chances: list[dict[Which, float]] = [{} for _ in range(len(readings))]
    for one, weight in zip(fits, weights, strict=True):
        for row, mode in enumerate(one.modes):
            chances[row][mode] = chances[row].get(mode, 0.0) + float(weight)
    squares = float(np.sum((best.residual / best.noise) ** 2) + best.point @ best.point)
    misfit = squares / len(readings)
    doubted = scipy.stats.chi2.sf(squares, len(readings)) < DOUBTED
    covariance = best.covariance * (misfit if doubted else 1.0)
    estimates = _estimates(priors, best.point, covariance)
    told = {one.parameter: one.told_by for one in estimates}
    progress("the mode to measure next")
    return ModeCalibration(
        instrument,
        posterior_card(instrument, priors, best.point, covariance, estimates),
        readings,
        best,
        estimates,
        tuple(one for one in find_groups(priors, covariance) if {"data", "prior"} <= {told[name] for name in one}),
        tuple(found[mode] for found, mode in zip(chances, best.modes, strict=True)),
        tuple(
            tuple((m.harmonic, m.index, p) for m, p in found.items() if m != mode and p > UNDECIDED)
            for found, mode in zip(chances, best.modes, strict=True)
        ),
        _next_modes(model, best, covariance, readings),
        misfit,
        tuple(warn(best, readings, misfit, bool(doubted), relative)),
    )


def _priors(instrument: Instrument, exact: Sequence[str]) -> Priors:
    check_exact(instrument, exact)
    if instrument.polynomial is not None:
        raise InputError(f"{instrument.path}: a polynomial [law] has no modes; give [resonator] and [material].")
    idle = [v.name for v in instrument.uncertain if not v.name.startswith(ACTING) or any(w in v.name for w in IDLE)]
    priors = gather_priors(instrument, (*exact, *idle))
    if not priors.values:
        raise InputError(f"{instrument.path}: no dimension and no elastic value is uncertain; give one, such as [resonator] thickness_mm = {{ value = …, sd = … }}.")  # fmt: skip
    return priors


def _fit_likely(
    model: ModeModel, readings: ModeReadings, T: Array, relative: Array, progress: Progress
) -> list[ModeFit]:
    y, start = np.log(readings.frequency), np.zeros(len(model.priors.values))
    n, k = readings.harmonic, readings.index
    if not (np.isnan(n) | np.isnan(k)).any():
        modes, exchanged = (
            [Which(int(a), int(b), float(t)) for a, b, t in zip(*both, T, strict=True)] for both in ((n, k), (k, n))
        )
        far = np.abs(y - model.predict(modes, start)[0]).max()
        if far > OTHER and np.abs(y - model.predict(exchanged, start)[0]).max() < far / 4:
            raise InputError(f"{readings.path}: harmonic and index are exchanged: the frequencies are those of modes with the one in place of the other. Exchange the names of the columns.")  # fmt: skip
        return [_fit(model, modes, y, relative, model.derivatives(modes, start))]
    most = int(max(12, np.nan_to_num(n).max()))
    highest = ABOVE * float(readings.frequency.max())
    every = [mode for t in sorted(set(map(float, T))) for mode in model.ladder(start, highest, most, t)]
    allowed = [
        [
            place
            for place, mode in enumerate(every)
            if mode.temperature == t and (np.isnan(a) or mode.harmonic == a) and (np.isnan(b) or mode.index == b)
        ]
        for a, b, t in zip(n, k, T, strict=True)
    ]
    g, _ = model.predict(every, start)
    progress(f"{len(every)} modes up to {highest:.4g} Hz are candidates for the readings")
    J = model.derivatives(every, start)
    bent = CURVED * np.einsum("ij,ij->i", J, J)
    noise = np.array([np.hypot(s, bent[a].max() if a else 0.0) for s, a in zip(relative, allowed, strict=True)])
    likely = assign(y, noise, allowed, g, J)
    if not likely:
        raise InputError(unexplained(readings, y, allowed, g, J, every))
    fits: dict[tuple[int, ...], ModeFit] = {}
    for one in likely[:RIVALS]:
        if one.cost - likely[0].cost < UNLIKELY:
            places = list(one.places)
            progress(f"assignment {len(fits) + 1}")
            fits[one.places] = _fit(model, [every[m] for m in places], y, relative, J[places])
    return sorted(fits.values(), key=lambda one: one.cost)


def _fit(model: ModeModel, modes: Sequence[Which], y: Array, relative: Array, J: Array) -> ModeFit:
    u, converged, exact = np.zeros(J.shape[1]), False, True
    size, unit = np.inf, np.eye(len(u))
    g, error = model.predict(modes, u)
    for _ in range(MOST_STEPS):
        noise = np.hypot(relative, error)
        both = np.vstack([J / noise[:, None], unit])
        step = np.linalg.lstsq(both, np.concatenate([(y - g) / noise, -u]), rcond=None)[0]
        size = float(np.linalg.norm(both @ step))
        if size < NEAR and exact:
            converged = True
            break
        if size < NEAR:
            J, exact = model.derivatives(modes, u), True
            continue
        before, last = u, g
        u = model.priors.inside(u + step * min(1.0, 3.0 / float(np.linalg.norm(step))))
        g, error = model.predict(modes, u)
        moved = u - before
        if np.linalg.norm(moved) > FAR:  # Broyden's update: the derivatives that it stands for cost fifteen predictions
            J, exact = J + np.outer(g - last - J @ moved, moved) / (moved @ moved), False
    noise = np.hypot(relative, error)
    precision = (J / noise[:, None]).T @ (J / noise[:, None]) + unit
    r = (y - g) / noise
    cost = float(r @ r + u @ u + np.linalg.slogdet(precision)[1] + 2 * np.log(noise).sum())
    return ModeFit(tuple(modes), u, np.asarray(np.linalg.inv(precision), dtype=float), y - g, noise, cost, converged)


def _estimates(priors: Priors, u: Array, covariance: Array) -> tuple[Estimate, ...]:
    z, at, bounds = priors.standard(u), priors.at(u), priors.bound(u)
    widths = np.sqrt(np.diag(priors.covariance(covariance)))
    return tuple(
        Estimate.of(value, at[value.name], float(own), float(sd), (own - NINETY * sd, own + NINETY * sd), bound)
        for value, own, sd, bound in zip(priors.values, z, widths, bounds, strict=True)
    )


def _next_modes(model: ModeModel, fit: ModeFit, covariance: Array, readings: ModeReadings) -> tuple[NextMode, ...]:
    """For every value that the modes tell, the unmeasured mode that would lower its variance most."""
    T = model.instrument.reference_temperature
    measured = {(one.harmonic, one.index) for one in fit.modes}
    most = max(one.harmonic for one in fit.modes) + 2
    highest = 2.0 * float(readings.frequency.max())
    ladder = model.ladder(fit.point, highest, most, T)
    modes = [one for one in ladder if (one.harmonic, one.index) not in measured and one.index < 2]
    if not modes:
        return ()
    J, g = model.derivatives(modes, fit.point), model.predict(modes, fit.point)[0]
    away = J @ covariance
    variance = np.einsum("ij,ij->i", away, J) + float(np.median(readings.sd / readings.frequency)) ** 2
    found = []
    for value, s in zip(model.priors.values, model.priors.slopes(fit.point), strict=True):
        now = float(s @ covariance @ s)
        falls = (away @ s) ** 2 / variance
        best = int(np.argmax(falls))
        if falls[best] > 1e-3 * now:
            left = float(np.sqrt(max(now - falls[best], 0.0)))
            mode = modes[best]
            found.append(
                NextMode(value.name, mode.harmonic, mode.index, float(np.exp(g[best])), float(np.sqrt(now)), left)
            )
    return tuple(found)


def decided(found: ModeCalibration) -> bool:
    """Whether every reading's mode is certain enough."""
    return all(p > 1 - UNDECIDED for p in found.chance)


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
            f"the solver's own error, up to {1e6 * solver.max():.2g} ppm, is larger than the readings' and counts as noise; a stem with a fillet is solved more accurately."
        )
    return found


def unexplained(
    readings: ModeReadings, y: Array, allowed: Sequence[Sequence[int]], g: Array, J: Array, every: Sequence[Which]
) -> str:
    """Say which reading is farthest from every mode that it may be."""
    wide = np.linalg.norm(J, axis=1)
    away = [min(((abs(y[i] - g[m]) / wide[m], m) for m in own), default=(np.inf, -1)) for i, own in enumerate(allowed)]
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
