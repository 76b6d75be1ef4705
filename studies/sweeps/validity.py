"""Whether the ranges of a study stay where card, material and theory are valid."""

from collections.abc import Iterator, Mapping
from itertools import product
from typing import TYPE_CHECKING, Any

from studies.errors import UNUSABLE_INPUT, InputError
from studies.instrument.card import ZERO_CELSIUS
from studies.sweeps.parameters import TEMPERATURE, set_parameters

if TYPE_CHECKING:
    from studies.sweeps.definition import Parameter, Study

MOST_CORNERS = 6  # parameters up to which all corners of the box are looked at


def check_ranges(study: "Study", where: str) -> None:
    """Build the instrument at both ends of every parameter, and at the corners hold its thickness against the theory.

    Raises
    ------
    InputError
        An end or corner that the card, the material's law or the chosen theory does not allow.
    """
    for parameter in study.parameters:
        for value in _extremes(parameter):
            _build(study, {parameter.name: value}, where)
    _check_temperatures(study, where)
    thin = [asked.options["theory"] for asked in study.asked if asked.options.get("theory", "solid") != "solid"]
    if thin:
        _check_thickness(study, thin[0], where)


def _extremes(parameter: "Parameter") -> tuple[Any, ...]:
    if isinstance(parameter.nominal, str):
        return parameter.values
    return (parameter.low, parameter.high)


def _build(study: "Study", values: Mapping[str, Any], where: str) -> float:
    """Return the largest thickness over size of the design."""
    words = ", ".join(f"{name} = {value}" for name, value in values.items())
    try:
        instrument = set_parameters(study.instrument, values)
        if any(name.startswith("thermal.") for name in values):
            _ = instrument.heat_path
    except UNUSABLE_INPUT as error:
        raise InputError(f"{where}: with {words} the card is not valid: {error}") from error
    return float(max(h for _, h in instrument.resonator.thickness) / instrument.resonator.size)


def _check_temperatures(study: "Study", where: str) -> None:
    given = [asked.options.get(key) for asked in study.asked for key in ("temperature_degC", "from_degC", "to_degC")]
    ends = [float(T) for T in given if T is not None]
    ends += [T for p in study.parameters if p.name == TEMPERATURE for T in (p.low, p.high)]
    try:
        study.instrument.material.check([T + ZERO_CELSIUS for T in ends])
    except UNUSABLE_INPUT as error:
        raise InputError(f"{where}: {error}") from error


def _corners(study: "Study") -> Iterator[Mapping[str, Any]]:
    geometry = [p for p in study.parameters if p.name.startswith("resonator.") and not isinstance(p.nominal, str)]
    if len(geometry) > MOST_CORNERS:
        yield from ({p.name: value} for p in geometry for value in (p.low, p.high))
        return
    names = [p.name for p in geometry]
    for ends in product(*((p.low, p.high) for p in geometry)):
        yield dict(zip(names, ends, strict=True))


def _check_thickness(study: "Study", theory: str, where: str) -> None:
    from shell.modes import THICKEST_SHELL

    for corner in _corners(study):
        ratio = _build(study, corner, where)
        if ratio > THICKEST_SHELL:
            words = ", ".join(f"{name} = {value:g}" for name, value in corner.items())
            raise InputError(
                f"{where}: with {words or 'the card itself'} h/R is {ratio:.3g}, beyond {THICKEST_SHELL:g} up to which theory"
                f" = '{theory}' is valid; narrow the range or take theory = 'solid'."
            )
