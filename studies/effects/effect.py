"""One physical hypothesis about what a simulation leaves out, and how it runs forward."""

import importlib
import pkgutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from compensation.arrays import Array
from studies.effects.states import States
from studies.errors import InputError, nearest

UNITS = {"frequency_Hz": "Hz", "bias_deg_per_h": "deg_per_h", "inverse_q": "1"}
AROUND = 293.15  # temperature at which coefficients count that would otherwise hang on the range a campaign covers, K
Shape = Sequence[float]
Numbers = float | Sequence[float]


@dataclass(frozen=True)
class Parameter:
    """A shape parameter: it enters the signature nonlinearly, between `low` and `high`.

    `steady` ones come from the grid only; of these, `refined` ones are moved afterwards. `of_run` bounds it from above
    by that part of the longest run, `of_range` of the covered temperatures.
    """

    name: str
    low: float
    high: float
    meaning: str
    logarithmic: bool = True
    steady: bool = False
    of_run: float = np.inf
    of_range: float = np.inf
    refined: bool = False

    def moves(self, value: float) -> bool:
        """Whether a fit moves it away from a value of the grid."""
        return not self.steady or (self.refined and value > self.low)

    @property
    def is_run(self) -> bool:
        """Whether it is the place of a run in the campaign, from 0."""
        return self.name in ("run", "from_run")


@dataclass(frozen=True)
class Coefficient:
    """A linear coefficient, a number, or a list where the effect is a family, whose `spread` are the prior sd in parts of the effect's size."""

    name: str
    spread: tuple[float, ...] = (1.0,)
    most: float = np.inf


@dataclass(frozen=True)
class Span:
    """What a campaign covers: the ranges from which shape parameters are drawn."""

    temperature_low: float
    temperature_high: float
    longest_run: float
    campaign_length: float
    step: float
    tau: float
    runs: int
    bins: tuple[Array, ...] = ()
    turns: bool = False  # whether the wave stands at several azimuths
    timed: bool = True  # whether the starts of the runs are known, so that time goes on from run to run

    @property
    def temperature_range(self) -> float:
        """Covered temperature range, K."""
        return self.temperature_high - self.temperature_low


@dataclass(frozen=True)
class Effect:
    """One physical effect: a family of signatures with a prior on their size."""

    # name, summary, source, isolate, sensor: Contract name; what happens; where the form comes from; the experiment
    # that would isolate it; the sensor or column that would tell it from its kin, with what that costs ("" where none
    # does).
    name: str
    summary: str
    source: str
    isolate: str
    coefficients: tuple[Coefficient, ...]  # one column each, or as many as its `spread` has members
    # callable (states, shape, response) -> (N, k) array: Signature of a unit of each coefficient: a change of resonator
    # temperature in K when the effect `acts_on` the temperature (frequency, bias and 1/Q then follow by themselves),
    # else a change of the response in its own unit.
    columns: Callable[[States, Shape, str], Array]
    # mapping from response to number: How large the first coefficient is in strong cases that sources show; smaller
    # sizes are likely as well, down to a ten thousandth, every decade as much. Frequency and 1/Q count in parts of
    # their level. Its keys are the responses on which the effect acts directly.
    sizes: Mapping[str, float]
    sensor: str = ""
    shape: tuple[Parameter, ...] = ()  # parameters that enter nonlinearly
    # callable (span, response) -> list of shapes: Shapes to look at, fine enough for a scan; all equally likely
    # beforehand. One, without parameters, unless given.
    grid: Callable[[Span, str], Sequence[tuple[float, ...]]] = lambda span, response: [()]
    acts_on: str = "response"  # "temperature" or "response"
    # callable shape -> places of columns: What any law has too, so that no fit looks for it; a card may state it.
    of_law: Callable[[Shape], tuple[int, ...]] = lambda shape: ()
    card_key: str = ""  # value of a card that takes its place in a heat path of several lags
    needs: tuple[str, ...] = ()  # drives (fields of `States`) that must be measured and must vary
    # mapping from response to names: Effects that no record of that response alone can tell from this one, whatever
    # their evidence.
    equivalents: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    # A column of the record that settles whether it is this effect or its equivalent, where it is there.
    judge: str = ""
    positive: bool = False  # whether it cannot go against its first column
    # Whether it looks like a response that comes later (1) or earlier (-1) than one lag predicts, or either (0).
    delay: int | None = None
    event: bool = False  # whether other runs know nothing of it, so that no held-out run can confirm it
    # Whether time alone drives it, so that no programme of temperatures and drives shows it better than another.
    by_clock: bool = False
    alike: bool = False  # whether its columns are the same of every response
    dated: bool = False  # whether it counts its time from the start of the campaign
    # Whether it happens once in a gyro's life rather than in every run, so that a saved card does not repeat it.
    once: bool = False
    # The shape parameter that is the time constant with which fades what it had at the start of a run: of what came
    # before a record nobody knows. "" where it has none.
    memory: str = ""
    sees_heat: bool = False  # whether an effect on the temperature depends on what the others have made of it
    # callable (span, response, shape) -> list of shapes: Where the grid is coarser than what records tell apart: the
    # shapes that one of it stands for.
    near: Callable[[Span, str, Shape], Sequence[tuple[float, ...]]] | None = None
    # callable (span, times of runs, what is left weighed by its noise) -> shape: The strongest of such a grid, found
    # without weighing each.
    strongest: Callable[[Span, Sequence[Array], Sequence[Array]], tuple[float, ...]] | None = None
    # callable (temperature - reference, shape) -> (N, k) array: What is left of it in a steady state, for tables, with
    # `steady_grid` (low, high) -> shapes, both in K.
    steady: Callable[[Array, Shape], Array] | None = None
    steady_grid: Callable[[float, float], Sequence[tuple[float, ...]]] | None = None
    steady_words: str = ""  # what such a form means, in words

    @property
    def responses(self) -> tuple[str, ...]:
        """Responses on which it acts directly."""
        return tuple(self.sizes)

    @property
    def thermal(self) -> bool:
        """Whether it changes the temperature of the resonator."""
        return self.acts_on == "temperature"

    @property
    def settled(self) -> "Effect":
        """It in a steady state: a change of the response in its own unit, of either sign."""
        return replace(self, coefficients=(Coefficient("settled_{unit}"),), acts_on="response", positive=False)

    @property
    def spread(self) -> Array:
        """Prior standard deviations of all columns over the effect's size."""
        return np.array([value for coefficient in self.coefficients for value in coefficient.spread])

    def members(self, shape: Shape) -> tuple[int, ...]:
        """Return the places of the columns that a fit looks for."""
        return tuple(int(k) for k in np.flatnonzero(self.spread > 0) if k not in self.of_law(shape))

    def coefficient_names(self, response: str) -> tuple[str, ...]:
        """Return the names of the coefficients with the unit of `response` filled in."""
        return tuple(c.name.format(unit=UNITS[response]) for c in self.coefficients)

    def numbers(self, values: Array, response: str) -> dict[str, float | list[float]]:
        """Return coefficients by name from one value a column."""
        out: dict[str, float | list[float]] = {}
        begin = 0
        for name, coefficient in zip(self.coefficient_names(response), self.coefficients, strict=True):
            part = [float(v) for v in values[begin : begin + len(coefficient.spread)]]
            out[name] = part[0] if len(part) == 1 else part
            begin += len(part)
        return out


@cache
def library() -> dict[str, Effect]:
    """Return every effect of the library by name."""
    folder = importlib.import_module("studies.effects.entries")
    found: dict[str, Effect] = {}
    for module in pkgutil.iter_modules(folder.__path__):
        effect = importlib.import_module(f"{folder.__name__}.{module.name}").EFFECT
        found[effect.name] = effect
    return found


def find_effect(name: str) -> Effect:
    """Return the effect called `name`."""
    try:
        return library()[name]
    except KeyError:
        raise InputError(f"no effect is called '{name}'{nearest(name, library())}") from None


def spell_out(effect: Effect, parameters: Mapping[str, Numbers], response: str) -> tuple[list[float], Array]:
    """Return the shape and one value a column of an effect from the numbers of a card, which its reader has checked."""
    shape = [float(np.ravel(parameters.get(p.name, p.low))[0]) for p in effect.shape]
    weights: list[float] = []
    for key, coefficient in zip(effect.coefficient_names(response), effect.coefficients, strict=True):
        given = np.atleast_1d(parameters.get(key, 0.0)).tolist()
        weights += given + [0.0] * (len(coefficient.spread) - len(given))
    return shape, np.array(weights)


def apply_effect(
    name: str, parameters: Mapping[str, Numbers], states: States, response: str | None = None
) -> tuple[str, Array]:
    """Run one effect forward, on an even grid: return its target and the change of it, zero where its drive is no part of the run."""
    effect = find_effect(name)
    response = effect.responses[0] if response is None else response
    shape, weights = spell_out(effect, parameters, response)
    target = "resonator_temperature" if effect.thermal else response
    if any(getattr(states, drive) is None for drive in effect.needs):
        return target, np.zeros_like(states.time)
    return target, np.asarray(effect.columns(states, shape, response) @ weights)


def apply_effects(entries: Sequence[tuple[str, str, Mapping[str, Numbers], float]], states: States) -> dict[str, Array]:
    """Run effects (name, response, parameters, its time (s) at the start of the run) forward, those on the temperature first; return the change of each target."""
    changes: dict[str, Array] = {}
    warmed = states
    for stage in range(3):  # on the temperature; on the temperature that these leave; on the responses
        for name, response, parameters, begun in entries:
            effect = find_effect(name)
            if stage == (2 if not effect.thermal else int(effect.sees_heat)):
                own = replace(warmed if stage else states, campaign_time=states.time + begun)
                target, change = apply_effect(name, parameters, own, response)
                changes[target] = changes.get(target, np.zeros_like(states.time)) + change
        if "resonator_temperature" in changes:
            warmed = states.warmed(changes["resonator_temperature"])
    return changes
