"""Study specs, `schema = "hrg.study/1"`: what is varied, how it is sampled, what is computed.

```toml
schema = "hrg.study/1"
name = "thickness and radius tolerance"
card = "hrg-30mm"                  # a shipped card, or the path of one beside this file

[sampling]
method = "sobol"                   # grid | list | latin-hypercube | sobol | sensitivity | one-at-a-time
cases = 1024                       # not for grid, list and one-at-a-time; a power of two for sobol and sensitivity
seed = 1
# batch = 8                        # cases that are computed and kept together; 1024 with families
# solver = "auto"                  # family: reduced bases with error estimates; full: every design by the solver

[[parameter]]
name = "resonator.thickness_mm"    # a key of the card; or temperature_degC; or user.NAME for a function of yours
tolerance = 0.005                  # nominal ± tolerance; or low and high; or values = [...] for grid and list
# nominal = 0.86                   # the card's value unless given
# distribution = "uniform"         # uniform | normal (standard_deviation) | triangular | log-uniform
# count = 11                       # points of a grid from low to high

[[parameter]]
name = "resonator.radius_mm"
low = 14.99
high = 15.01

[[quantity]]
name = "frequency"                 # frequency, tcf, bryan-factor, mode-separation, compensation-residual, ...
harmonic = 2
theory = "solid"

[[quantity]]
name = "tcf"

[[requirement]]                    # asked of the yield; may change without computing anew
column = "frequency_n2_Hz"
within = 0.5                       # of target, which is the nominal design's value unless given; or low and/or high

[[search]]                         # optional, after the sampled cases
kind = "worst-case"                # the extremes of a column over the box of all parameters
column = "frequency_n2_Hz"

[[search]]
kind = "inversion"                 # the parameters that give wanted values
vary = ["resonator.thickness_mm", "resonator.radius_mm"]
targets = { frequency_n2_Hz = 4432.07, tcf_n2_ppm_per_degC = 79.5 }
```

`grid` takes every combination, `list` the rows of equally long `values`, `sensitivity` the design of Saltelli for Sobol
indices (cases × (parameters + 2) designs), `one-at-a-time` five levels of each parameter about the nominal design.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from studies.errors import InputError, nearest
from studies.files.toml import Section, check_number, read_toml
from studies.instrument.card import Instrument, load_card
from studies.sweeps.parameters import find_nominal, unit_of
from studies.sweeps.quantities import find_quantity
from studies.sweeps.quantity import Column, Quantity

SCHEMA = "hrg.study/1"
METHODS = ("grid", "list", "latin-hypercube", "sobol", "sensitivity", "one-at-a-time")
DISTRIBUTIONS = ("uniform", "normal", "triangular", "log-uniform")
SOLVERS = ("auto", "full", "family")
KEYS = ("schema", "name", "note", "card", "sampling", "parameter", "quantity", "requirement", "search")
PARAMETER_KEYS = (
    "name", "low", "high", "tolerance", "values", "count", "distribution", "standard_deviation", "nominal",
)  # fmt: skip
FREE = ("name", "note", "requirement", "search")  # may change after the first run: no sampled result depends on them
MOST_CASES = 20_000_000


@dataclass(frozen=True)
class Parameter:
    """What is varied, in the unit of its name; `nominal` is text where `values` are.

    A normal parameter that is not `bounded` has no ends: `low` and `high` are then three standard deviations away.
    """

    name: str
    nominal: float | str
    low: float
    high: float
    distribution: str = "uniform"
    standard_deviation: float | None = None
    values: tuple[Any, ...] = ()
    count: int | None = None
    bounded: bool = True

    @property
    def unit(self) -> str:
        """The unit that the name carries, or "1"."""
        return unit_of(self.name)


@dataclass(frozen=True)
class Asked:
    """A quantity with its options, and the columns that it fills."""

    quantity: Quantity
    options: Mapping[str, Any]
    columns: tuple[Column, ...]


@dataclass(frozen=True)
class Sampling:
    """How designs are drawn."""

    method: str
    cases: int
    seed: int
    batch: int | None
    solver: str


@dataclass(frozen=True)
class Requirement:
    """Limits of a column; a `within` alone is about the nominal design's value."""

    column: str
    low: float | None
    high: float | None
    target: float | None
    within: float | None


@dataclass(frozen=True)
class Search:
    """A worst case of a column over the box, or an inversion to target values."""

    kind: str
    column: str = ""
    vary: tuple[str, ...] = ()
    targets: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Study:
    """A checked spec. `content` is the spec as data, `text` as its author wrote it, `folder` where it lies."""

    name: str
    note: str
    instrument: Instrument
    sampling: Sampling
    parameters: tuple[Parameter, ...]
    asked: tuple[Asked, ...]
    requirements: tuple[Requirement, ...]
    searches: tuple[Search, ...]
    content: Mapping[str, Any] = field(repr=False)
    text: str = field(repr=False)
    folder: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns of results, in order."""
        return tuple(column for asked in self.asked for column in asked.columns)

    @property
    def functions(self) -> tuple[str, ...]:
        """User functions that the study asks for."""
        return tuple(asked.options["function"] for asked in self.asked if asked.quantity.name == "python")


def read_study(source: str | Path | Mapping[str, Any], card: str | None = None) -> Study:
    """Read a study from a TOML file, by the name of a shipped one, or from its content as a mapping.

    Parameters
    ----------
    source : path, name or mapping.
    card : another card than the one that the spec names.

    Raises
    ------
    InputError
        An unknown key, parameter or quantity (the nearest is named), a value of the wrong type or out of range.
    """
    if isinstance(source, Mapping):
        content, where, folder, text = dict(source), "study", Path(), ""
        if content.setdefault("schema", SCHEMA) != SCHEMA:
            raise InputError(f'study: schema must be "{SCHEMA}", not {content["schema"]!r}.')
    else:
        path = find_spec(source)
        content, where, folder = read_toml(path, SCHEMA), str(path), path.parent
        text = path.read_text(encoding="utf-8-sig")
    if card is not None:
        content["card"] = card
    top = Section(content, where, KEYS)
    named = top.text("card")
    beside = folder / named
    instrument = load_card(beside if card is None and named.endswith(".toml") else named)
    return check_study(content, instrument, where, str(folder.resolve()), text)


def check_study(content: Mapping[str, Any], instrument: Instrument, where: str, folder: str, text: str) -> Study:
    """Make a study from its content and its instrument, as read from a spec or from a store."""
    top = Section(content, where, KEYS)
    sampling = _sampling(top)
    parameters = tuple(
        _parameter(part, instrument, sampling.method) for part in top.sections("parameter", PARAMETER_KEYS)
    )
    _no_twins([parameter.name for parameter in parameters], f"{where} [[parameter]]: the name")
    asked = tuple(_asked(part, folder) for part in _tables(top, "quantity"))
    if not asked:
        raise InputError(f"{where}: a study needs at least one [[quantity]].")
    columns = [column.name for one in asked for column in one.columns]
    _no_twins(columns, f"{where} [[quantity]]: give one of them another label; the column")
    study = Study(
        name=top.text("name", Path(where).stem),
        note=top.text("note", "-"),
        instrument=instrument,
        sampling=sampling,
        parameters=parameters,
        asked=asked,
        requirements=tuple(
            _requirement(part, columns)
            for part in top.sections("requirement", ("column", "low", "high", "target", "within"))
        ),
        searches=tuple(
            _search(part, columns, parameters) for part in top.sections("search", ("kind", "column", "vary", "targets"))
        ),
        content=content,
        text=text,
        folder=folder,
    )
    from studies.sweeps.validity import check_ranges

    check_ranges(study, where)
    return study


def find_spec(source: str | Path) -> Path:
    """Return the path of a spec given by path or by the name of a shipped one."""
    path = Path(source)
    if path.suffix == ".toml" or path.exists() or len(path.parts) > 1:
        return path
    shipped = shipped_specs()
    if str(source) in shipped:
        return shipped[str(source)]
    raise InputError(
        f"there is no shipped study '{source}'{nearest(str(source), shipped)} A study of your own: give its path."
    )


def shipped_specs() -> dict[str, Path]:
    """Return name -> path of the specs that ship with the package."""
    return {path.stem: path for path in sorted((Path(__file__).parent / "templates").glob("*.toml"))}


def _sampling(top: Section) -> Sampling:
    part = top.section("sampling", ("method", "cases", "seed", "batch", "solver"))
    method = part.text("method", choices=METHODS)
    free = method in ("latin-hypercube", "sobol", "sensitivity")
    if not free and "cases" in part:
        raise InputError(f"{part.where}: method = '{method}' has as many cases as its values say; leave cases out.")
    cases = _whole(part, "cases", None if free else 1, 1, MOST_CASES)
    if method in ("sobol", "sensitivity") and cases & (cases - 1):
        power = 1 << cases.bit_length()
        raise InputError(
            f"{part.where}: with method = '{method}' cases must be a power of two, such as {power // 2} or {power}, not {cases}."
        )
    batch = _whole(part, "batch", 0, 1, 1_000_000) if "batch" in part else None
    return Sampling(method, cases, _whole(part, "seed", 0, 0, 2**63), batch, part.text("solver", "auto", SOLVERS))


def _parameter(part: Section, instrument: Instrument, method: str) -> Parameter:
    name = part.text("name")
    where = f"{part.where} '{name}'"
    found = find_nominal(instrument, name, part.where)
    if "values" in part:
        return _listed(part, name, where, found, method)
    if method == "list":
        raise InputError(f"{where}: method = 'list' needs values = [...] for every parameter.")
    if isinstance(found, str):
        raise InputError(f"{where} is text in the card; give values = [...] and method = 'grid' or 'list'.")
    if found is None and "nominal" not in part and not ("low" in part and "high" in part):
        raise InputError(f"{where}: the card leaves it open, so nominal, or low and high, must be given.")
    distribution = part.text("distribution", "uniform", DISTRIBUTIONS)
    deviation = part.number("standard_deviation", above=0.0) if distribution == "normal" else None
    if distribution != "normal" and "standard_deviation" in part:
        raise InputError(f"{where}: standard_deviation goes with distribution = 'normal'.")
    if found is None and "nominal" not in part:
        found = (part.number("low") + part.number("high")) / 2
    middle = part.number("nominal", found)
    low, high = _ends(part, where, middle, deviation)
    if distribution == "log-uniform" and low <= 0:
        raise InputError(f"{where}: a log-uniform parameter must be positive, not from {low:g}.")
    count = _whole(part, "count", None, 2, 1_000_000) if method == "grid" else None
    if method != "grid" and "count" in part:
        raise InputError(f"{where}: count goes with method = 'grid'.")
    bounded = deviation is None or any(key in part for key in ("low", "high", "tolerance"))
    return Parameter(name, middle, low, high, distribution, deviation, (), count, bounded)


def _ends(part: Section, where: str, middle: float, deviation: float | None) -> tuple[float, float]:
    """Return the ends of a parameter; a normal one without ends is shown over three standard deviations."""
    if "tolerance" in part:
        if "low" in part or "high" in part:
            raise InputError(f"{where}: give tolerance, or low and high, not both.")
        reach = part.number("tolerance", above=0.0)
        return middle - reach, middle + reach
    if deviation is not None and "low" not in part and "high" not in part:
        return middle - 3 * deviation, middle + 3 * deviation
    low, high = part.number("low"), part.number("high")
    if not low < high:
        raise InputError(f"{where}: low must be below high, not {low:g} and {high:g}.")
    if not low <= middle <= high:
        raise InputError(
            f"{where}: the nominal value {middle:g} lies outside {low:g} to {high:g}; correct one of them."
        )
    return low, high


def _listed(part: Section, name: str, where: str, found: float | str | None, method: str) -> Parameter:
    if method not in ("grid", "list"):
        raise InputError(f"{where}: values go with method = 'grid' or 'list'; with '{method}' give low and high.")
    values = part.raw("values")
    if not isinstance(values, list) or not values:
        raise InputError(f"{where}: values must be a list with at least one entry.")
    for key in ("low", "high", "tolerance", "count", "distribution", "standard_deviation"):
        if key in part:
            raise InputError(f"{where}: give values or {key}, not both.")
    if all(isinstance(value, str) for value in values):
        nominal = part.text("nominal", found if isinstance(found, str) else values[0])
        return Parameter(name, nominal, 0.0, float(len(values) - 1), values=tuple(values))
    numbers = tuple(check_number(value, f"{where}: values") for value in values)
    if method == "grid":
        _no_twins([f"{value:.17g}" for value in numbers], f"{where}: the value")
    nominal_number = part.number("nominal", found if isinstance(found, float) else numbers[len(numbers) // 2])
    return Parameter(name, nominal_number, min(numbers), max(numbers), values=numbers)


def _tables(top: Section, key: str) -> list[Mapping[str, Any]]:
    tables = top.raw(key, [])
    if not isinstance(tables, list) or not all(isinstance(table, Mapping) for table in tables):
        raise InputError(f"{top.where}: {key} must be an array of tables ([[{key}]]).")
    return [{**table, "": f"{top.where} [[{key}]] number {place}"} for place, table in enumerate(tables, 1)]


def _asked(table: Mapping[str, Any], folder: str) -> Asked:
    where = table[""]
    name = table.get("name")
    if not isinstance(name, str):
        raise InputError(f'{where}: the line name = "..." is missing; add it.')
    quantity = find_quantity(name, where)
    known = ("name", "label", *quantity.options)
    part = Section({key: value for key, value in table.items() if key}, f"{where} '{name}'", known)
    options = {key: option.read(part, key) for key, option in quantity.options.items()}
    label = part.text("label", "-")
    try:
        columns = tuple(quantity.columns(options))
    except InputError as error:
        raise InputError(f"{part.where}: {error}") from error
    if label != "-":
        columns = tuple(Column(f"{label}_{c.stem}", c.unit, f"{label}: {c.label}") for c in columns)
    if "function" in options and options["function"].rpartition(":")[0].endswith(".py"):
        options["function"] = str(Path(folder) / options["function"])
    return Asked(quantity, options, columns)


def _requirement(part: Section, columns: Sequence[str]) -> Requirement:
    column = part.text("column", choices=columns)
    low, high = (part.number(key) if key in part else None for key in ("low", "high"))
    target, within = (part.number(key) if key in part else None for key in ("target", "within"))
    if within is None and low is None and high is None:
        raise InputError(f"{part.where}: give within (and target), or low and/or high.")
    if (within is None and target is not None) or (within is not None and (low is not None or high is not None)):
        raise InputError(f"{part.where}: within goes with target, low and high go without them.")
    return Requirement(column, low, high, target, within)


def _search(part: Section, columns: Sequence[str], parameters: Sequence[Parameter]) -> Search:
    kind = part.text("kind", choices=("worst-case", "inversion"))
    numeric = [p.name for p in parameters if not isinstance(p.nominal, str)]
    if kind == "worst-case":
        if "vary" in part or "targets" in part:
            raise InputError(f"{part.where}: a worst case takes column only; it varies every parameter.")
        return Search(kind, part.text("column", choices=columns))
    vary, targets = part.raw("vary"), part.raw("targets")
    if not isinstance(vary, list) or not vary or not isinstance(targets, Mapping) or not targets:
        raise InputError(f"{part.where}: an inversion needs vary = [parameters] and targets = {{ column = value }}.")
    for name in vary:
        if name not in numeric:
            raise InputError(
                f"{part.where}: vary: '{name}' is not a parameter of this study{nearest(str(name), numeric)}"
            )
    for column in targets:
        if column not in columns:
            raise InputError(f"{part.where}: targets: there is no column '{column}'{nearest(column, columns)}")
    wanted = {column: check_number(value, f"{part.where}: {column}") for column, value in targets.items()}
    return Search(kind, "", tuple(vary), wanted)


def _whole(part: Section, key: str, default: int | None, least: int, most: int) -> int:
    value = part.raw(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise InputError(f"{part.where}: {key} must be a whole number from {least} to {most}, not {value!r}.")
    return value


def _no_twins(names: Sequence[str], what: str) -> None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise InputError(f"{what} '{name}' stands there twice.")
        seen.add(name)
