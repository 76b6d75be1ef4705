"""The card's own simulation as the baseline: its uncertain values within their priors, initial states free.

f(record) = f(θ) + Σ ∂f/∂θ δθ by the one forward model (`studies.simulation.predict`), driven by the measured housing or
chamber. A value counts by z, its distance from the card in prior standard deviations (of its logarithm where it cannot be
negative), so that every z has the prior 0 ± 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np

from shell.constants import zero_Celsius
from shell.errors import ShellError
from studies.diagnosis.baseline import START, Tangent, View, remembering
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.response import RESPONSES, Response
from studies.diagnosis.verdict import NINETY, Shift
from studies.effects.states import FloatArray, States, average
from studies.law import law_of, moved_law
from studies.simulation.drive import Boundary, Drive
from studies.simulation.holes import bridge_holes
from studies.simulation.prediction import INITIAL, KINK, Prediction, Variations, predict
from thermal.errors import ThermalError
from thermal.profile import Profile

if TYPE_CHECKING:
    from shell.law import FrequencyLaw
    from studies.diagnosis.model import Fit
    from studies.instrument.card import Instrument
    from studies.instrument.uncertain import UncertainValue

LUMPS = ("base", "resonator")
"""Parts of the heat path behind the housing whose initial state is unknown."""
POINTS = 3
"""Predictions to a step of the grid; between them lies a straight line."""
BOLDEST = 1.5
"""Largest change of a z from one linearisation to the next."""
WARMER = 0.01
"""Relative change of what an initial state does with its size, 1/K: radiation and the law's bend."""
STRAIGHT = 0.3
"""Part of the noise up to which a straight line may miss a prediction before it is drawn anew."""
FAR = 2.0
"""Prior standard deviations beyond which a value of the card is wrong."""
AWAY = 1.0
"""Beyond which it is asked whether an effect about the card's own values does the same: several values move less than one."""
STEPS = (1.0, 0.5, 0.25)
"""Parts of a step that are tried."""
SILENT = 0.01
"""Part of the noise, or of the least known level, below which one standard deviation of a value changes nothing."""


@dataclass(frozen=True)
class Point:
    """Prediction of a run at values, by name in the unit of the card, and whether its derivatives were `solved` there."""

    values: dict[str, float]
    found: Prediction
    time: FloatArray
    solved: bool

    def missed(self, values: dict[str, float], found: Prediction, column: str) -> float:
        """Return what a fit with the slopes of here would miss elsewhere, rms.

        A straight line from here misses m of a change c: its slopes are wrong by m/c, and the next step corrects about m.
        """
        slopes = self.found.derivatives
        line = sum((value - self.values[name]) * slopes[name][column] for name, value in values.items())
        change = found.columns[column] - self.found.columns[column]
        missed = float(np.sqrt(np.mean((change - line) ** 2)))
        return missed * min(1.0, missed / max(float(np.sqrt(np.mean(change**2))), 1e-300))


@dataclass(frozen=True)
class Simulated:
    """A card's simulation of one response, linearised at an instrument.

    Attributes
    ----------
    response : Response
    states : tuple of States
        Measured drives, run by run, on the fine grid.
    group : int
    card : Instrument
        As shipped, with its uncertainties.
    boundary : str
    values : tuple of UncertainValue
        Those that move the response.
    z : tuple of float
        Where they are.
    initial : tuple of mapping
        What is free of every run: departure of base and resonator at the start of its record, and of the housing in every hole
        before the run, K.
    """

    from_card: ClassVar[bool] = True
    response: Response
    states: tuple[States, ...]
    group: int
    card: "Instrument"
    boundary: Boundary
    stride: int
    noise: float
    values: "tuple[UncertainValue, ...]"
    z: tuple[float, ...]
    initial: tuple[dict[str, float], ...]
    warmer: tuple[FloatArray, ...] | None = None
    memory: dict[object, Any] = field(default_factory=dict, compare=False, repr=False)

    @property
    def lagged(self) -> bool:
        """It computes the temperature."""
        return True

    @cached_property
    def instrument(self) -> "Instrument":
        """The card with its values where they are."""
        moved = {v.name: at(v, z) for v, z in zip(self.values, self.z, strict=True) if z != 0.0}
        return self.card.with_values(moved)

    @cached_property
    def law(self) -> "FrequencyLaw":
        """Its frequency law over the whole range of the material; solved anew only where dimensions move."""
        if "law" not in self.memory:
            self.memory["law"] = law_of(self.card)
        shipped: FrequencyLaw = self.memory["law"]
        moved = {v.name for v, z in zip(self.values, self.z, strict=True) if z != 0.0}
        if any(name.startswith("resonator.") for name in moved):
            return law_of(self.instrument, shipped.lowest, shipped.highest)
        return moved_law(shipped, self.instrument) if moved else shipped

    @property
    def varied(self) -> Variations:
        """The instrument and its neighbours; built once for every point, whatever the run."""
        key = ("varied", self.values, self.z)
        if key not in self.memory:
            self.memory[key] = Variations(self.instrument, self.law, tuple(v.name for v in self.values))
        return cast("Variations", self.memory[key])

    @cached_property
    def tau(self) -> float:
        """Slowest lag of the resonator behind the housing, s."""
        from studies.simulation.heat_path import slowest_lag

        return slowest_lag(self.varied.network(self.boundary), self.instrument.reference_temperature)

    @cached_property
    def profiles(self) -> tuple[tuple[Profile, dict[int, float]], ...]:
        """What drives each run from the start of its record on, and what may have departed in the holes before it.

        The heat path remembers what was before a hole: each run goes through its record anew, with holes of its own. A chamber in a
        hole is what it was told to be; the run then begins in equilibrium, but for its departures.
        """
        found: list[tuple[Profile, dict[int, float]]] = []
        for k, s in enumerate(self.states):
            before = [o for o in self.states[:k] if o.record == s.record >= 0 and self.boundary == "housing"]
            parts = [*before, s]
            whole = Profile(np.concatenate([o.time for o in parts]), np.concatenate([o.housing for o in parts]))
            found.append(bridge_holes(whole) if before else (whole, {}))
        return tuple(found)

    def free(self, k: int) -> dict[str, float]:
        """Return what is free of run `k`, with its prior standard deviation (K)."""
        starts = {f"initial.{lump}": START for lump in LUMPS}
        return starts | {f"{KINK}{row}": size for row, size in self.profiles[k][1].items()}

    def drive(self, k: int) -> tuple[Drive, FloatArray]:
        """What run `k` is driven with, and the times of its predictions."""
        s = self.states[k]
        time = s.time[:: self.stride]
        time = time if time[-1] == s.time[-1] else np.append(time, s.time[-1])
        commands = {
            name: np.interp(time, s.time, values)
            for name in ("amplitude_squared", "voltage_squared", "quadrature", "pattern_angle")
            if (values := getattr(s, name)) is not None
        }
        initial = {name.removeprefix(INITIAL): v for name, v in self.initial[k].items() if name.startswith(INITIAL)}
        kinks = {int(name.removeprefix(KINK)): v for name, v in self.initial[k].items() if name.startswith(KINK)}
        start = float(s.campaign_time[0])
        return Drive(time, self.boundary, self.profiles[k][0], initial, commands, start=start, kinks=kinks), time

    def predicted(self, k: int) -> tuple[Prediction, FloatArray]:
        """Prediction of run `k` with its derivatives, and its times; computed once for every point.

        The derivatives are those of a point before, where a straight line from there foretells the prediction here.
        """
        run = self.states[k]  # kept beside its points: no other run gets its id
        points: dict[object, Point] = self.memory.setdefault(("run", id(run), self.values), (run, {}))[1]
        initial = {name: self.initial[k].get(name, 0.0) for name in self.free(k)}
        key = (self.z, tuple(initial.values()))
        if key not in points:
            drive, time = self.drive(k)
            here = {v.name: at(v, z) for v, z in zip(self.values, self.z, strict=True)}
            here |= initial
            varied = self.varied.with_names([*(v.name for v in self.values), *initial])
            known = [point for point in points.values() if point.solved]
            found = predict(self.instrument, drive, () if known else varied, self.law)
            misses = [point.missed(here, found, self.response.column) for point in known]
            solved = not known or min(misses) > STRAIGHT * self.noise
            if known and solved:
                found = predict(self.instrument, drive, varied, self.law)
            elif known:
                found = replace(found, derivatives=known[int(np.argmin(misses))].found.derivatives)
            points[key] = Point(here, found, time, solved)
        return points[key].found, points[key].time

    @cached_property
    def known(self) -> Tangent:
        """The linearisation, computed once."""
        owned = [(k, name, sd) for k in range(len(self.states)) for name, sd in self.free(k).items()]
        shift, columns, views = [], [], []
        steps = np.array([slope_of(v, z) for v, z in zip(self.values, self.z, strict=True)])
        reference = self.card.reference_temperature
        for k, s in enumerate(self.states):
            found, time = self.predicted(k)

            def finely(values: FloatArray, time: FloatArray = time, s: States = s) -> FloatArray:
                return np.interp(s.time, time, values)

            resonator = finely(found.columns["resonator_temperature_degC"]) + zero_Celsius
            fine = replace(s, resonator=resonator, tau=self.tau, reference=reference)
            seen_fine = fine if self.warmer is None else replace(fine, resonator=resonator + self.warmer[k])
            coarse, seen = fine.averaged(self.group), seen_fine.averaged(self.group)
            inside = found.law.inside(seen.resonator)  # whatever an effect is tried to add
            steep = np.asarray(found.law.frequency(inside) * found.law.slope(inside))
            views.append(View(fine, coarse, seen_fine, seen, steep))
            column = self.response.column

            def slope(name: str, found: object = found, finely: object = finely, column: str = column) -> FloatArray:
                return average(finely(found.derivatives[name][column]), self.group)  # type: ignore[attr-defined, operator]

            of_values = np.stack([slope(v.name) for v in self.values], axis=1) * steps
            starts = np.zeros((seen.time.size, len(owned)))
            for n, (run, name, _) in enumerate(owned):
                if run == k:
                    starts[:, n] = slope(name)
            predicted = average(finely(found.columns[column]), self.group)
            centre = of_values @ np.array(self.z)
            begin = starts @ np.array([self.initial[run].get(name, 0.0) for run, name, _ in owned])
            shift.append(centre + begin - predicted)
            columns.append(np.concatenate([of_values, starts], axis=1))
        names = (
            *(v.name for v in self.values),
            *(f"{name}@{k}" for k, name, _ in owned),
        )
        prior = np.array([1.0] * len(self.values) + [sd for _, _, sd in owned])
        return Tangent(shift, columns, prior, names, remembering(views))

    def tangent(self) -> Tangent:
        """Linearise where it is."""
        return self.known

    def views(self) -> Sequence[View]:
        """Every run as it is predicted and as it is seen."""
        return self.known.views

    def change(self, excess: FloatArray) -> FloatArray:
        """Change of the response from the reference over its slope there, K."""
        law, reference = self.law, self.card.reference_temperature
        zero = float(law.frequency(reference))
        return np.asarray((law.frequency(law.inside(reference + excess)) - zero) / (zero * float(law.slope(reference))))

    def moved(self, values: dict[str, float], warmer: Sequence[FloatArray] | None) -> "Simulated":
        """Take over the values, a bold step at most, and the initial states; a part of the way where the law ends before."""
        warm = None if warmer is None else tuple(warmer)
        for part in STEPS:
            z = []
            for value, old in zip(self.values, self.z, strict=True):
                new = old + part * float(np.clip(values[value.name] - old, -BOLDEST, BOLDEST))
                z.append(to_z(value, float(np.clip(at(value, new), value.low, value.high))))
            initial = tuple(
                {name: (1.0 - part) * own.get(name, 0.0) + part * values[f"{name}@{k}"] for name in self.free(k)}
                for k, own in enumerate(self.initial)
            )
            if self.bend(z, initial) < STRAIGHT * self.noise:  # a straight line is as good there
                break
            there = replace(self, z=tuple(z), initial=initial, warmer=warm)
            if there.reached:
                return there
        return replace(self, warmer=warm)

    @property
    def reached(self) -> bool:
        """Whether the network can be swept and the law is known at all temperatures that are predicted."""
        try:
            for k in range(len(self.states)):
                self.predicted(k)
        except (ShellError, ThermalError):
            return False
        return True

    def bend(self, z: Sequence[float], initial: Sequence[dict[str, float]]) -> float:
        """Return about how far a straight line from here misses a point: a value that counts by its logarithm, p = p₀ e^(s z), has ½ s J Δz²."""
        columns = np.concatenate(self.known.columns)
        reach = np.std(columns, axis=0)
        rises = [v.sd / v.value if v.logarithmic else 0.0 for v in self.values]
        missed = [0.5 * s * (new - old) ** 2 for s, new, old in zip(rises, z, self.z, strict=True)]
        missed += [
            0.5 * WARMER * (value - old.get(name, 0.0)) ** 2
            for new, old in zip(initial, self.initial, strict=True)
            for name, value in new.items()
        ]
        return float(np.linalg.norm(reach * missed))

    def held(self, values: dict[str, float]) -> "Simulated | None":
        """Nothing is held: the card's own lag of its sensor has a prior."""
        return None

    def released(self) -> "Simulated":
        """Nothing is held."""
        return self

    def stated(self) -> "Simulated | None":
        """Return the card as shipped where a value has gone away from it; else None."""
        if max(map(abs, self.z), default=0.0) <= AWAY:
            return None
        return replace(self, z=(0.0,) * len(self.z), initial=tuple({} for _ in self.initial), warmer=None)

    def elsewhere(self, near: float = 0.0) -> tuple[()]:
        """Its card says where it is."""
        return ()

    def alone(self, states: States) -> "Simulated":
        """Return the same simulation of one further run that starts in equilibrium."""
        return replace(self, states=(states,), initial=({},), warmer=(np.zeros(states.time.size),))


def at(value: "UncertainValue", z: float) -> float:
    """Return the number of the card at a distance z."""
    return value.value * float(np.exp(z * value.sd / value.value)) if value.logarithmic else value.value + z * value.sd


def to_z(value: "UncertainValue", number: float) -> float:
    """Return the distance of a number from the card's."""
    if value.logarithmic:
        return float(np.log(number / value.value) * value.value / value.sd)
    return (number - value.value) / value.sd


def slope_of(value: "UncertainValue", z: float) -> float:
    """Return d number / d z."""
    return at(value, z) * value.sd / value.value if value.logarithmic else value.sd


def simulate_baseline(campaign: Campaign, card: "Instrument", noise: float) -> Simulated:
    """Return the card's simulation of the frequency as shipped; values that do not move it by any noise are left out."""
    boundary: Boundary = "chamber" if campaign.temperature_source.startswith("chamber") else "housing"
    own = Simulated(
        RESPONSES["frequency_Hz"],
        tuple(run.states for run in campaign.runs),
        campaign.group,
        card,
        boundary,
        max(1, campaign.group // POINTS),
        noise,
        tuple(card.uncertain),
        (0.0,) * len(card.uncertain),
        tuple({} for _ in campaign.runs),
    )
    columns = np.concatenate(own.known.columns)[:, : len(own.values)]
    varies, level = np.ptp(columns, axis=0), np.abs(columns.mean(axis=0))
    telling = (varies > SILENT * noise) | (level > SILENT * max(noise, float(level.max())))
    values = tuple(v for v, tells in zip(own.values, telling, strict=True) if tells)
    return replace(own, values=values, z=(0.0,) * len(values))


def shifts_of(model: "Fit") -> list[Shift]:
    """Return where a fit has moved the card's values, with 90 % intervals."""
    baseline = model.baseline
    if not isinstance(baseline, Simulated):
        return []
    out = []
    deviations = np.sqrt(np.maximum(np.diag(model.solved.covariance), 0.0))
    for k, value in enumerate(baseline.values):
        z, sd = float(model.solved.coefficients[k]), float(deviations[k])
        ends = (at(value, z - NINETY * sd), at(value, z + NINETY * sd))
        out.append(Shift(value.name, value.value, at(value, z), ends[0], ends[1], z))
    return out
