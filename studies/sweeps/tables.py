"""The tables of a study's spec, read and checked one by one."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from studies.errors import InputError, nearest
from studies.files.toml import TomlTable, check_number
from studies.instrument.card import Instrument
from studies.sweeps.definition import MOST_CASES, Asked, Requirement, Sampling, Search, StudyParameter
from studies.sweeps.expressions import Derived
from studies.sweeps.parameters import find_nominal
from studies.sweeps.quantities import find_quantity
from studies.sweeps.quantity import Column

METHODS = ("grid", "list", "latin-hypercube", "sobol", "sensitivity", "one-at-a-time")
DISTRIBUTIONS = ("uniform", "normal", "triangular", "log-uniform")
SOLVERS = ("auto", "full", "family")


def read_sampling(top: TomlTable) -> Sampling:
    """Read the `[sampling]` table."""
    part = top.section("sampling", ("method", "cases", "seed", "batch", "solver"))
    method = part.text("method", choices=METHODS)
    free = method in ("latin-hypercube", "sobol", "sensitivity")
    if not free and "cases" in part:
        raise InputError(f"{part.where}: method = '{method}' takes the number of cases from the values; remove cases.")
    cases = _whole(part, "cases", None if free else 1, 1, MOST_CASES)
    if method in ("sobol", "sensitivity") and cases & (cases - 1):
        power = 1 << cases.bit_length()
        raise InputError(
            f"{part.where}: with method = '{method}' cases must be a power of two, such as {power // 2} or {power}, not {cases}."
        )
    batch = _whole(part, "batch", 0, 1, 1_000_000) if "batch" in part else None
    return Sampling(method, cases, _whole(part, "seed", 0, 0, 2**63), batch, part.text("solver", "auto", SOLVERS))


def read_parameter(part: TomlTable, instrument: Instrument, method: str) -> StudyParameter:
    """Read one `[[parameter]]` table."""
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
        raise InputError(f"{where}: standard_deviation is only for distribution = 'normal'.")
    if found is None and "nominal" not in part:
        found = (part.number("low") + part.number("high")) / 2
    middle = part.number("nominal", found)
    low, high = _ends(part, where, middle, deviation)
    if distribution == "log-uniform" and low <= 0:
        raise InputError(f"{where}: a log-uniform parameter must be positive, not from {low:g}.")
    count = _whole(part, "count", None, 2, 1_000_000) if method == "grid" else None
    if method != "grid" and "count" in part:
        raise InputError(f"{where}: count is only for method = 'grid'.")
    bounded = deviation is None or any(key in part for key in ("low", "high", "tolerance"))
    return StudyParameter(name, middle, low, high, distribution, deviation, (), count, bounded)


def read_derived(part: TomlTable, instrument: Instrument, parameters: Sequence[str]) -> Derived:
    """Read one `[[derived]]` table."""
    name = part.text("name")
    if name in parameters:
        raise InputError(f"{part.where}: '{name}' is a parameter too; it cannot be both.")
    find_nominal(instrument, name, part.where)
    one = Derived(name, part.text("expression"), f"{part.where} '{name}'")
    _ = one.names
    return one


def _ends(part: TomlTable, where: str, middle: float, deviation: float | None) -> tuple[float, float]:
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


def _listed(part: TomlTable, name: str, where: str, found: float | str | None, method: str) -> StudyParameter:
    if method not in ("grid", "list"):
        raise InputError(f"{where}: values are only for method = 'grid' or 'list'; for '{method}' give low and high.")
    values = part.raw("values")
    if not isinstance(values, list) or not values:
        raise InputError(f"{where}: values must be a list with at least one entry.")
    for key in ("low", "high", "tolerance", "count", "distribution", "standard_deviation"):
        if key in part:
            raise InputError(f"{where}: give values or {key}, not both.")
    if all(isinstance(value, str) for value in values):
        nominal = part.text("nominal", found if isinstance(found, str) else values[0])
        return StudyParameter(name, nominal, 0.0, float(len(values) - 1), values=tuple(values))
    numbers = tuple(check_number(value, f"{where}: values") for value in values)
    if method == "grid":
        refuse_twins([f"{value:.17g}" for value in numbers], f"{where}: the value")
    nominal_number = part.number("nominal", found if isinstance(found, float) else numbers[len(numbers) // 2])
    return StudyParameter(name, nominal_number, min(numbers), max(numbers), values=numbers)


def split_tables(top: TomlTable, key: str) -> list[Mapping[str, Any]]:
    """Return an array of tables whose keys depend on their name, each with where it stands under the empty key."""
    tables = top.raw(key, [])
    if not isinstance(tables, list) or not all(isinstance(table, Mapping) for table in tables):
        raise InputError(f"{top.where}: {key} must be an array of tables ([[{key}]]).")
    return [{**table, "": f"{top.where} [[{key}]] number {place}"} for place, table in enumerate(tables, 1)]


def read_asked(table: Mapping[str, Any], folder: str) -> Asked:
    """Read one `[[quantity]]` table."""
    where = table[""]
    name = table.get("name")
    if not isinstance(name, str):
        raise InputError(f'{where}: the line name = "..." is missing; add it.')
    quantity = find_quantity(name, where)
    known = ("name", "label", *quantity.options)
    part = TomlTable({key: value for key, value in table.items() if key}, f"{where} '{name}'", known)
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


def read_requirement(part: TomlTable, columns: Sequence[str]) -> Requirement:
    """Read one `[[requirement]]` table."""
    column = part.text("column", choices=columns)
    low, high = (part.number(key) if key in part else None for key in ("low", "high"))
    target, within = (part.number(key) if key in part else None for key in ("target", "within"))
    if within is None and low is None and high is None:
        raise InputError(f"{part.where}: give within (and target), or low and/or high.")
    if (within is None and target is not None) or (within is not None and (low is not None or high is not None)):
        raise InputError(f"{part.where}: give either target and within, or low and/or high.")
    return Requirement(column, low, high, target, within)


SEARCH_KEYS = {"worst-case": ("column",), "inversion": ("vary", "targets"), "tolerance": ("share", "vary")}


def _words(keys: Sequence[str]) -> str:
    return " and ".join(keys)


def read_search(part: TomlTable, columns: Sequence[str], parameters: Sequence[StudyParameter]) -> Search:
    """Read one `[[search]]` table."""
    kind = part.text("kind", choices=("worst-case", "inversion", "tolerance"))
    numeric = [p.name for p in parameters if not isinstance(p.nominal, str)]
    for key in ("vary", "targets", "column", "share"):
        if key in part and key not in SEARCH_KEYS[kind]:
            raise InputError(
                f"{part.where}: a search of the kind '{kind}' takes no {key}; it takes {_words(SEARCH_KEYS[kind])}."
            )
    if kind == "worst-case":
        return Search(kind, part.text("column", choices=columns))
    vary, targets = part.raw("vary", numeric if kind == "tolerance" else None), part.raw("targets", {})
    if (
        not isinstance(vary, list)
        or not vary
        or not isinstance(targets, Mapping)
        or (kind == "inversion" and not targets)
    ):
        raise InputError(f"{part.where}: an inversion needs vary = [parameters] and targets = {{ column = value }}.")
    for name in vary:
        if name not in numeric:
            raise InputError(
                f"{part.where}: vary: '{name}' is not a parameter of this study{nearest(str(name), numeric)}"
            )
    if kind == "tolerance":
        return Search(kind, "", tuple(vary), {}, part.number("share", above=0.0, below=1.0))
    for column in targets:
        if column not in columns:
            raise InputError(f"{part.where}: targets: there is no column '{column}'{nearest(column, columns)}")
    wanted = {column: check_number(value, f"{part.where}: {column}") for column, value in targets.items()}
    return Search(kind, "", tuple(vary), wanted)


def _whole(part: TomlTable, key: str, default: int | None, least: int, most: int) -> int:
    value = part.raw(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise InputError(f"{part.where}: {key} must be a whole number from {least} to {most}, not {value!r}.")
    return value


def refuse_twins(names: Sequence[str], what: str) -> None:
    """Raise InputError when a name stands there twice."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise InputError(f"{what} '{name}' is given twice.")
        seen.add(name)
