"""Whether the designs of a study stay where card, material and theory are valid."""

from collections.abc import Iterator, Mapping
from itertools import chain, product
from typing import Any

from shell.constants import zero_Celsius
from studies.errors import UNUSABLE_INPUT, InputError
from studies.sweeps.definition import Study
from studies.sweeps.design import nominal_design
from studies.sweeps.keys import MOST_CORNERS
from studies.sweeps.parameters import TEMPERATURE, set_parameters

SAMPLES = ("latin-hypercube", "sobol")


def check_nominal(study: Study, where: str) -> None:
    """Build the nominal design, and hold its thickness against the theory; temperatures must lie in the law's range."""
    problem = _problem(study, nominal_design(study))
    if problem:
        raise InputError(f"{where}: {problem}")
    given = [asked.options.get(key) for asked in study.asked for key in ("temperature_degC", "from_degC", "to_degC")]
    ends = [float(T) for T in given if T is not None]
    ends += [T for p in study.parameters if p.name == TEMPERATURE for T in (p.low, p.high)]
    try:
        study.instrument.material.check([T + zero_Celsius for T in ends])
    except UNUSABLE_INPUT as error:
        raise InputError(f"{where}: {error}") from error


def find_invalid(study: Study) -> list[str]:
    """Return what is wrong with designs at the ends of each parameter and at the corners of the box; they fail as cases."""
    nominal = nominal_design(study)
    reach = {p.name: p.values if isinstance(p.nominal, str) else (p.low, p.high) for p in study.parameters}
    ends = ({**nominal, name: value} for name, values in reach.items() for value in values)
    problems = (_problem(study, {**nominal, **design}) for design in chain(ends, _corners(study)))
    return list(dict.fromkeys(problem for problem in problems if problem))


def _problem(study: Study, values: Mapping[str, Any]) -> str:
    """Return what makes a design impossible, or nothing."""
    from shell.modes import THICKEST_SHELL

    words = ", ".join(f"{key} = {v:g}" if isinstance(v, float) else f"{key} = {v}" for key, v in values.items())
    try:
        instrument = set_parameters(study.instrument, values, study.derived)
        if any(name.startswith("thermal.") for name in values):
            _ = instrument.heat_path
    except UNUSABLE_INPUT as error:
        return f"with {words or 'the card itself'} the card is not valid: {error}"
    ratio = float(max(h for _, h in instrument.resonator.thickness) / instrument.resonator.size)
    theories = [asked.options["theory"] for asked in study.asked if asked.options.get("theory", "solid") != "solid"]
    if theories and ratio > THICKEST_SHELL:
        return f"with {words or 'the card itself'} h/R is {ratio:.3g}, beyond {THICKEST_SHELL:g} up to which theory = '{theories[0]}' is valid; narrow the range or take theory = 'solid'."
    return ""


def _corners(study: Study) -> Iterator[Mapping[str, Any]]:
    geometry = [p for p in study.parameters if p.name.startswith("resonator.") and not isinstance(p.nominal, str)]
    for ends in product(*((p.low, p.high) for p in geometry)) if len(geometry) <= MOST_CORNERS else ():
        yield {p.name: end for p, end in zip(geometry, ends, strict=True)}


def check_sample(study: Study, where: str) -> None:
    """Raise when a study gives a search for tolerances no sample or nothing to keep."""
    if study.sampling.method not in SAMPLES:
        raise InputError(f"{where}: a search for tolerances needs designs that are drawn: method = 'latin-hypercube' or 'sobol', not '{study.sampling.method}'.")  # fmt: skip
    if not study.requirements:
        raise InputError(f"{where}: a search for tolerances needs a [[requirement]] that the designs must meet.")
