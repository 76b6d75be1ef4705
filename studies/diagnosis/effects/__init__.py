"""The library of physical effects: one file an effect, found by discovery.

A file defines `EFFECT`. Its `columns` are the signatures of the effect for a unit of each coefficient: a change of
resonator temperature in K when the effect `acts_on` the temperature (frequency, bias and 1/Q then follow by
themselves), else a change of the response in its own unit. The same columns fit a record and run forward in a
simulation.
"""

import importlib
import pkgutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from studies.diagnosis.states import FloatArray, States
from studies.errors import InputError, nearest

RESPONSES = ("frequency_Hz", "bias_deg_per_h", "inverse_q")
AROUND = 293.15
"""Temperature at which coefficients count that would otherwise hang on the range a campaign covers, K."""
UNITS = {"frequency_Hz": "Hz", "bias_deg_per_h": "deg_per_h", "inverse_q": "1"}


@dataclass(frozen=True)
class Parameter:
    """A shape parameter that enters the signature nonlinearly; `steady` ones are chosen from the grid only.

    `of_run` bounds it from above by that part of the longest run, besides `high`.
    """

    name: str
    low: float
    high: float
    meaning: str
    logarithmic: bool = True
    steady: bool = False
    of_run: float = np.inf


@dataclass(frozen=True)
class Span:
    """What a campaign covers: the ranges from which shape parameters are drawn; `lines` are frequencies, Hz, that stand out."""

    temperature_low: float
    temperature_high: float
    longest_run: float
    campaign_length: float
    step: float
    tau: float
    runs: int
    bins: tuple[FloatArray, ...] = ()
    lines: tuple[float, ...] = ()

    @property
    def temperature_range(self) -> float:
        """Covered temperature range, K."""
        return self.temperature_high - self.temperature_low


@dataclass(frozen=True)
class Effect:
    """One physical hypothesis about what a simulation leaves out.

    Attributes
    ----------
    name, summary, source, isolate : str
        Contract name; what happens; where the form comes from; the experiment that would isolate it.
    responses : tuple of str
        Responses on which it acts directly.
    acts_on : str
        "temperature": it changes the resonator's true temperature; "response": it adds to the response itself.
    shape : tuple of Parameter
        Parameters that enter nonlinearly.
    coefficients : tuple of str
        Names, with unit, of the linear coefficients; `{unit}` stands for the response's unit.
    columns : callable (states, shape, response) -> (N, k) array
        Signature of a unit of each coefficient.
    grid : callable (span, response) -> list of shapes
        Starting values of the shape, fine enough for a scan.
    needs : tuple of str
        Fields of `States` that must be measured and must vary.
    equivalents : mapping from response to names
        Effects that no record of that response alone can separate from this one.
    kin : mapping from response to names
        Effects whose formula differs from this one's by less than formulas of their kind are sure.
    positive : bool
        Whether its coefficient cannot be negative.
    nested : bool
        Whether the first column alone is a simpler form of the effect.
    fine : bool
        Whether its columns need the fine grid (lags of fast drives) before they are averaged.
    sees_heat : bool
        Whether an effect on the temperature depends on what the others have made of it.
    """

    name: str
    summary: str
    source: str
    isolate: str
    responses: tuple[str, ...]
    coefficients: tuple[str, ...]
    columns: Callable[[States, Sequence[float], str], FloatArray]
    grid: Callable[[Span, str], Sequence[tuple[float, ...]]]
    shape: tuple[Parameter, ...] = ()
    acts_on: str = "response"
    needs: tuple[str, ...] = ()
    equivalents: Mapping[str, tuple[str, ...]] | None = None
    kin: Mapping[str, tuple[str, ...]] | None = None
    positive: bool = False
    nested: bool = False
    fine: bool = False
    sees_heat: bool = False

    def coefficient_names(self, response: str, count: int | None = None) -> tuple[str, ...]:
        """Return the names of the coefficients with the unit of `response` filled in."""
        names = tuple(name.format(unit=UNITS[response]) for name in self.coefficients)
        return names if count is None else names[:count]


@cache
def library() -> dict[str, Effect]:
    """Return every effect of this folder by name."""
    found: dict[str, Effect] = {}
    for module in pkgutil.iter_modules(__path__):
        effect = importlib.import_module(f"{__name__}.{module.name}").EFFECT
        found[effect.name] = effect
    return found


def find_effect(name: str) -> Effect:
    """Return the effect called `name`.

    Raises
    ------
    InputError
        If the library has no such effect; the message names the nearest.
    """
    try:
        return library()[name]
    except KeyError:
        raise InputError(f"no effect is called '{name}'{nearest(name, library())}") from None


def apply_effect(
    name: str, parameters: Mapping[str, float], states: States, response: str = "frequency_Hz"
) -> tuple[str, FloatArray]:
    """Run one effect forward.

    Parameters
    ----------
    name : str
        Contract name of the effect.
    parameters : mapping
        Shape parameters and coefficients by name, as a diagnosis reports them; absent coefficients are zero.
    states : States
        The run, on an even time grid.
    response : str
        The response to change, for effects that act on a response.

    Returns
    -------
    target : str
        "resonator_temperature" or the response.
    change : (N,) array
        What must be added to the target, K or the response's unit. Zero where the effect's drive (amplitude, voltage,
        quadrature, azimuth) is not part of the run: it then stays where it was calibrated.

    Raises
    ------
    InputError
        If a parameter is unknown or missing, or the response is not one of the effect's.
    """
    effect = find_effect(name)
    if response not in effect.responses:
        raise InputError(f"effect '{name}' does not act on {response}{nearest(response, effect.responses)}")
    names = effect.coefficient_names(response)
    known = (*(p.name for p in effect.shape), *names)
    for key in parameters:
        if key not in known:
            raise InputError(f"effect '{name}' has no parameter '{key}'{nearest(key, known)}")
    missing = [p.name for p in effect.shape if p.name not in parameters and not p.steady]
    if missing:
        raise InputError(f"effect '{name}' needs the parameter '{missing[0]}'")
    target = "resonator_temperature" if effect.acts_on == "temperature" else response
    if any(getattr(states, drive) is None for drive in effect.needs):
        return target, np.zeros_like(states.time)
    shape = [float(parameters.get(p.name, p.low)) for p in effect.shape]
    columns = effect.columns(states, shape, response)
    weights = np.array([float(parameters.get(key, 0.0)) for key in names[: columns.shape[1]]])
    return target, np.asarray(columns @ weights)


def apply_effects(entries: Sequence[tuple[str, str, Mapping[str, float]]], states: States) -> dict[str, FloatArray]:
    """Run several effects forward, those on the temperature first: the others see the temperature that they leave.

    Parameters
    ----------
    entries : sequence of (name, response, parameters)
        As `[[effect]]` tables give them.
    states : States
        The run, on an even time grid.

    Returns
    -------
    changes : dict
        What must be added to "resonator_temperature" (K) and to each response.
    """
    changes: dict[str, FloatArray] = {}
    warmed = states
    for stage in range(3):  # on the temperature; on the temperature that these leave; on the responses
        for name, response, parameters in entries:
            effect = find_effect(name)
            if stage == (2 if effect.acts_on != "temperature" else int(effect.sees_heat)):
                target, change = apply_effect(name, parameters, warmed if stage else states, response)
                changes[target] = changes.get(target, np.zeros_like(states.time)) + change
        warmed = replace(states, resonator=states.resonator + changes.get("resonator_temperature", 0.0))
    return changes
