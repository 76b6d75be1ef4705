"""What counts as the simulation before any effect: a law with uncertain values, linearised where it is.

The engine asks a baseline for columns with priors, for the states that effects see, and for a new point after a fit.

f₀ + a₁ x + a₂ x² over a resonator that follows the housing through one free lag from an unknown initial state,
x = T_r − T₀; bias a cubic in the change of frequency (of temperature, where no frequency is measured) with an offset per
run; 1/Q a quadratic in temperature. No sensor reads at once and no resonator is one lump: a delay of 0 ± 10 s between sensor
and resonator is part of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from studies.diagnosis.response import Response
from studies.effects.states import FloatArray, States, average, remembered

DELAY = 10.0
"""Standard deviation of the delay between housing sensor and resonator that every model tolerates, s."""
LAGS = np.geomspace(60.0, 2e4, 7)
"""Lags, s, from which one is looked for."""
SHORTEST_LAG, LONGEST_LAG = 5.0, 1e5
OF_RUN = 0.5
"""Part of the longest run up to which a response that is no thermometer may have a lag by itself."""
START = 10.0
"""Standard deviation of the resonator's unknown initial temperature about the housing's, K."""
FOLLOWED_DELAY = 20.0
"""Standard deviation of the delay between the responses, s."""
LAG_STEP = 0.3
"""Standard deviation of one correction of the logarithm of the lag."""
STEADY = 0.4
"""Largest bend of the law times the farthest temperature, K: the slope keeps its sign, as far as bends are small."""
PART = 1.0
"""Standard deviation of the part by which a response follows the temperature (1) and not the frequency (0), or the other way."""
PARTS = (-0.5, 1.5)
"""Between which it lies: what would need more is something else."""
FARTHEST = 2.5
"""Standard deviations beyond which a delay is no delay of sensors: the baseline holds it there."""
BENT = 3.0
"""Standard deviation of each bend of the static law over the covered range, in parts of what the response varies by: a law
that no data bound goes nowhere."""


@dataclass(frozen=True)
class View:
    """One run on the fine grid and on the coarse one: as the lag gives it, and as static effects see it.

    `steep` is the change of the response for one kelvin of the resonator, on the coarse grid.
    """

    fine: States
    coarse: States
    seen_fine: States
    seen: States
    steep: FloatArray


def remembering(views: Sequence[View]) -> list[View]:
    """Return the views of all runs, each with what a loop may remember of the runs before."""
    pasts = remembered([view.seen_fine for view in views])
    return [
        replace(view, seen_fine=replace(view.seen_fine, before=past), seen=replace(view.seen, before=past))
        for view, past in zip(views, pasts, strict=True)
    ]


@dataclass(frozen=True)
class Tangent:
    """A baseline linearised at a point.

    Attributes
    ----------
    shift : sequence of arrays
        What must be added to the measured values, run by run: zero where the model is linear anyway.
    columns : sequence of (n, p) arrays
    prior : (p,) array
        Standard deviations, inf for a flat prior; the flat ones come first.
    names : tuple of str
        Of the columns; those of one run alone end with "@k", k the number of the run.
    views : sequence of View
    """

    shift: Sequence[FloatArray]
    columns: Sequence[FloatArray]
    prior: FloatArray
    names: tuple[str, ...]
    views: Sequence[View]


class Baseline(Protocol):
    """A law with uncertain values."""

    @property
    def lagged(self) -> bool:
        """Whether effects on the temperature can act: the baseline computes the temperature itself."""

    def tangent(self) -> Tangent:
        """Linearise where it is."""

    def moved(self, values: dict[str, float], warmer: Sequence[FloatArray] | None) -> "Baseline":
        """Return the baseline at new values; `warmer` is what effects add to the temperature, K on the fine grid."""

    def held(self, values: dict[str, float]) -> "Baseline | None":
        """Return the baseline with a nuisance held at its limit, where the values go beyond it; else None."""

    def released(self) -> "Baseline":
        """Return the baseline with nothing held."""

    def elsewhere(self, near: float = 0.0) -> Sequence["Baseline"]:
        """Return the baseline at other points, everywhere or so many e-folds away: an effect may imitate its own values."""

    def alone(self, states: States) -> "Baseline":
        """Return the same law for one further run that starts in equilibrium."""


class Reading(Baseline, Protocol):
    """A baseline that computes the temperature and can be read as a thermometer."""

    @property
    def tau(self) -> float:
        """Slowest lag of the resonator behind the housing, s."""

    def views(self) -> Sequence[View]:
        """Every run as it is seen."""

    def change(self, excess: FloatArray) -> FloatArray:
        """Change of the response from the reference over its slope there, K."""


@dataclass(frozen=True)
class Lagged:
    """A polynomial over a resonator that follows the housing through one lag.

    `tau`, `slope`, `bend` and `warmer` are where it is linearised: lag, s; slope, unit/K, and curvature over slope, 1/K, of
    the law; what initial state, delay and effects add to the lagged temperature, K on the fine grid.
    """

    response: Response
    states: tuple[States, ...]
    group: int
    tau: float
    slope: float
    bend: float = 0.0
    warmer: tuple[FloatArray, ...] | None = None
    delay: float | None = None
    bends: tuple[float, ...] = ()
    starts: tuple[float, ...] = ()

    @property
    def lagged(self) -> bool:
        """It computes the temperature."""
        return True

    def views(self) -> list[View]:
        """Every run as the lag gives it and as it is seen."""
        out = []
        for k, own in enumerate(self.states):
            fine = own.with_lag(self.tau)
            seen_fine = fine if self.warmer is None else replace(fine, resonator=fine.resonator + self.warmer[k])
            coarse, seen = fine.averaged(self.group), seen_fine.averaged(self.group)
            out.append(View(fine, coarse, seen_fine, seen, self.steepness(seen)))
        return remembering(out)

    def steepness(self, seen: States) -> FloatArray:
        """Change of the response for one kelvin of the resonator."""
        return np.asarray(self.slope * (1.0 + 2.0 * self.bend * seen.excess))

    def tangent(self) -> Tangent:
        """f(T₀ + δ) = law(T₀) + f′(T₀) δ about the temperature that is seen."""
        runs, powers = len(self.states), self.response.powers
        views = self.views()
        shift, columns = [], []
        for k, view in enumerate(views):
            seen = view.seen
            x = seen.excess
            static = [x / 10.0, (x**2 + seen.spread) / 1e2, (x**3 + 3.0 * x * seen.spread) / 1e3][:powers]
            level = levels(self.response, k, self.states, x.size)
            start = np.zeros((x.size, runs))
            start[:, k] = view.coarse.fading * view.steep
            delay = -(view.coarse.housing - view.coarse.resonator) / self.tau * view.steep
            ahead, behind = (average(self._free(k, self.tau * factor), self.group) for factor in (1.02, 1.0 / 1.02))
            slower = (ahead - behind) / (2.0 * np.log(1.02)) * view.steep
            warm = 0.0 if self.warmer is None else average(self.warmer[k], self.group)
            shift.append(np.asarray(view.steep * warm))
            if self.delay is not None:
                shift[-1] = shift[-1] - self.delay * delay
                delay = np.zeros_like(delay)
            columns.append(np.concatenate([level, np.stack(static, 1), start, delay[:, None], slower[:, None]], axis=1))
        flat = level_names(self.response, self.states)
        names = (
            *flat,
            *("slope", "quadratic", "cubic")[:powers],
            *(f"start@{k}" for k in range(runs)),
            "delay",
            "log lag",
        )
        bends = self.bends or (np.inf,) * (powers - 1)
        deviations = [*bends, *[START] * runs, DELAY, LAG_STEP]
        prior = np.array([np.inf] * (len(flat) + 1) + deviations)
        return Tangent(shift, columns, prior, names, views)

    def _free(self, k: int, tau: float) -> FloatArray:
        """Temperature of run `k` on the fine grid from its initial state alone, K."""
        fine = self.states[k].with_lag(tau)
        return np.asarray(fine.resonator + (self.starts[k] * fine.fading if self.starts else 0.0))

    def moved(self, values: dict[str, float], warmer: Sequence[FloatArray] | None) -> "Lagged":
        """Take over slope, bend, lag and what warms the resonator."""
        slope = values["slope"] / 10.0
        bend = values["quadratic"] / 100.0 / slope if slope else 0.0
        reach = max(float(np.abs(own.housing - own.reference).max()) for own in self.states)
        most = max(0.02, STEADY / max(reach, 1e-3))
        tau = self.tau * float(np.exp(np.clip(values["log lag"], -0.7, 0.7)))
        tau = float(np.clip(tau, SHORTEST_LAG, self.longest_lag))
        late = values["delay"] if self.delay is None else self.delay
        added = []
        for k, own in enumerate(self.states):
            fine = own.with_lag(tau)
            part = values[f"start@{k}"] * fine.fading - late * (fine.housing - fine.resonator) / tau
            added.append(np.asarray(part + (0.0 if warmer is None else warmer[k])))
        return replace(
            self,
            tau=tau,
            slope=slope,
            bend=float(np.clip(bend, -most, most)),
            warmer=tuple(added),
            starts=tuple(values[f"start@{k}"] for k in range(len(self.states))),
        )

    def held(self, values: dict[str, float]) -> "Lagged | None":
        """Hold the delay at its limit."""
        most = FARTHEST * DELAY
        if self.delay is not None or abs(values["delay"]) <= most:
            return None
        return replace(self, delay=most * float(np.sign(values["delay"])))

    def released(self) -> "Lagged":
        """Let the delay go."""
        return replace(self, delay=None)

    def elsewhere(self, near: float = 0.0) -> list["Lagged"]:
        """Return it with other lags: without an effect of the rate, none at all may seem the best."""
        lags = self.tau * np.exp([-near, near]) if near else LAGS
        return [replace(self, tau=float(tau), warmer=None, starts=()) for tau in lags if tau <= self.longest_lag]

    @property
    def longest_lag(self) -> float:
        """Lag, s, beyond which a bias or 1/Q by itself is not looked for: an initial state would be an offset of the run."""
        if self.response.thermometer:
            return LONGEST_LAG
        return max(OF_RUN * max(float(np.ptp(own.time)) for own in self.states), float(LAGS[0]))

    def alone(self, states: States) -> "Lagged":
        """Return the same law for one further run that starts in equilibrium."""
        return replace(self, states=(states,), warmer=(np.zeros(states.time.size),), starts=())

    def change(self, excess: FloatArray) -> FloatArray:
        """Change of the response from the reference over its slope there, K."""
        return np.asarray(excess + self.bend * excess**2)


@dataclass(frozen=True)
class Followed:
    """A polynomial over what a thermometer reads, here the fitted frequency.

    Attributes
    ----------
    reading, whole : tuple of arrays
        Its reading, K on the coarse grid and on the fine one: between steps, and after the last, it bends.
    instead : tuple of arrays
        What it may follow instead, K: the temperature itself and not the change of the frequency, which bends, or the other way.
    missed : tuple of (n, m) arrays
        What the thermometer's own model cannot explain, and what effects on the thermometer itself add to it, K: temperature
        or not, the data decide.
    slope : float
        Change of the response for one kelvin, for the prior of the two.
    curve : tuple of float
        Coefficients of the second and higher powers, per (10 K)ᵖ: the whole of the law may come late.
    part : float
        By which it follows `instead`, 0 to 1 but for errors, where it is linearised or, with `part_held`, left.
    """

    response: Response
    states: tuple[States, ...]
    group: int
    reading: tuple[FloatArray, ...]
    whole: tuple[FloatArray, ...]
    instead: tuple[FloatArray, ...]
    missed: tuple[FloatArray, ...]
    slope: float = 0.0
    delay: float | None = None
    bends: tuple[float, ...] = ()
    curve: tuple[float, ...] = ()
    part: float = 0.0
    part_held: bool = False

    @property
    def lagged(self) -> bool:
        """The temperature is given."""
        return False

    def tangent(self) -> Tangent:
        """Columns of the polynomial, the missed parts, and a delay against the thermometer."""
        powers, missed = self.response.powers, self.missed[0].shape[1]
        shift, columns, views = [], [], []
        for k, own in enumerate(self.states):
            coarse = own.averaged(self.group)
            beyond = self.instead[k] - self.reading[k]
            u = self.reading[k] + self.part * beyond
            level = levels(self.response, k, self.states, u.size)
            v = coarse.spread
            static = [u / 10.0, (u**2 + v) / 1e2, (u**3 + 3.0 * u * v) / 1e3][:powers]
            along = np.full(u.size, self.slope) + sum(
                p * c * (u / 10.0) ** (p - 1) / 10.0 for p, c in enumerate(self.curve, 2)
            )
            late = -average(own.rate, self.group) * along
            bend = np.zeros_like(u) if self.part_held else beyond * along
            shift.append(self.part * bend)
            if self.delay is not None:
                shift[-1] = shift[-1] - self.delay * late
                late = np.zeros_like(late)
            besides = self.missed[k] * (along / self.slope if self.slope else np.ones(u.size))[:, None]
            ends = np.stack([bend, late], axis=1)
            columns.append(np.concatenate([level, np.stack(static, 1), besides, ends], axis=1))
            steep = np.full(u.size, self.slope)
            views.append(View(own, coarse, own, coarse, steep))
        flat = level_names(self.response, self.states)
        names = (
            *flat,
            *("slope", "quadratic", "cubic")[:powers],
            *(f"missed {m}" for m in range(missed)),
            "part",
            "delay",
        )
        size = max(abs(self.slope), 1e-300)
        bends = self.bends or (np.inf,) * (powers - 1)
        deviations = [*bends, *[1.5 * size] * missed, PART, FOLLOWED_DELAY]
        prior = np.array([np.inf] * (len(flat) + 1) + deviations)
        return Tangent(shift, columns, prior, names, views)

    def moved(self, values: dict[str, float], warmer: Sequence[FloatArray] | None) -> "Followed":
        """Take over the law."""
        powers = ("quadratic", "cubic")[: self.response.powers - 1]
        part = self.part if self.part_held else values["part"]
        return replace(self, slope=values["slope"] / 10.0, curve=tuple(values[p] for p in powers), part=part)

    def held(self, values: dict[str, float]) -> "Followed | None":
        """Hold the delay and the part at their limits."""
        most, part = FARTHEST * FOLLOWED_DELAY, float(np.clip(values["part"], *PARTS))
        out = self
        if self.delay is None and abs(values["delay"]) > most:
            out = replace(out, delay=most * float(np.sign(values["delay"])))
        if not self.part_held and part != values["part"]:
            out = replace(out, part=part, part_held=True)
        return None if out is self else out

    def released(self) -> "Followed":
        """Let delay and part go."""
        return replace(self, delay=None, part_held=False)

    def elsewhere(self, near: float = 0.0) -> tuple[()]:
        """Its temperature is given."""
        return ()

    def alone(self, states: States) -> "Followed":
        """Return the same law for one further run whose states already hold the thermometer's temperature."""
        nothing = np.zeros(states.time.size // self.group)
        return replace(
            self,
            states=(states,),
            reading=(nothing,),
            whole=(np.zeros(states.time.size),),
            instead=(nothing,),
            missed=tuple(np.zeros((nothing.size, part.shape[1])) for part in self.missed[:1]),
        )


def first_stretches(states: Sequence[States]) -> list[int]:
    """Return, for every run, the number of the first run of its record: a gap in a log is no turn-on."""
    records = [own.record if own.record >= 0 else -1 - k for k, own in enumerate(states)]
    return [records.index(record) for record in records]


def level_names(response: Response, states: Sequence[States]) -> tuple[str, ...]:
    """Return the names of the level, or of each record's own."""
    return tuple(f"offset@{k}" for k in dict.fromkeys(first_stretches(states))) if response.own_offset else ("level",)


def levels(response: Response, run: int, states: Sequence[States], size: int) -> FloatArray:
    """Return the columns of one run that `level_names` names."""
    if not response.own_offset:
        return np.ones((size, 1))
    firsts = first_stretches(states)
    return np.tile(np.array(list(dict.fromkeys(firsts))) == firsts[run], (size, 1)).astype(float)


def bends_of(values: FloatArray, reading: FloatArray, powers: int) -> tuple[float, ...]:
    """Return prior standard deviations of the second and higher powers, per (10 K)ᵖ."""
    reach = max(float(np.percentile(np.abs(reading), 95)), 1e-3) / 10.0
    size = BENT * max(float(np.std(values)), 1e-300)
    return tuple(size / reach**power for power in range(2, powers + 1))
