"""Study specs, read and checked against their card (`studies.sweeps.keys` declares the keys)."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from studies.errors import InputError, nearest
from studies.files.reading import find_shipped, list_shipped
from studies.instrument.card import Card, Instrument, load_card
from studies.schema.reader import read_keys, read_text, read_toml
from studies.sweeps.definition import Study, StudyParameter
from studies.sweeps.keys import SCHEMA, ParameterKeys, Search, StudyKeys, ToleranceSearch, WorstCase
from studies.sweeps.parameters import find_nominal
from studies.sweeps.quantity import Quantity
from studies.sweeps.validity import check_nominal, check_sample


def read_study(source: str | Path | Mapping[str, Any], card: Card | None = None, text: str | None = None) -> Study:
    """Read a study from a TOML file (of that `text`), by a shipped one's name, or a mapping; `card` stands in place of its own."""
    if isinstance(source, Mapping):
        content, where, folder, text = {"schema": SCHEMA, **source}, "study", Path(), ""
    else:
        path = find_shipped(source, shipped_specs(), "study")
        text = read_text(path) if text is None else text
        content, folder = read_toml(path, SCHEMA, text), path.parent
        where = f"the shipped study '{source}'" if path in shipped_specs().values() else str(path)
    if card is not None:
        content["card"] = (card.path or card.name) if isinstance(card, Instrument) else str(card)
        text = f"# computed with --card {content['card']} instead of the card below\n{text}"
    named = read_keys(content, StudyKeys, where).card
    instrument = load_card(card or (folder / named if named.endswith(".toml") else named))
    return check_study(content, instrument, where, str(folder.resolve()), text)


def check_study(content: Mapping[str, Any], instrument: Instrument, where: str, folder: str, text: str) -> Study:
    """Make a study from its content and its instrument, as read from a spec or from a store."""
    keys = read_keys(content, StudyKeys, where)

    def numbered(table: str, members: Sequence[Any]) -> list[tuple[str, Any]]:
        return [(f"{where} [[{table}]] number {place}", one) for place, one in enumerate(members, 1)]

    method, stated = keys.sampling.method, numbered("parameter", keys.parameter)
    parameters = tuple(_resolve(place, one, instrument, method) for place, one in stated)
    names = [parameter.name for parameter in parameters]
    _refuse_twins(names, f"{where} [[parameter]]: the name")
    for place, derived in numbered("derived", keys.derived):
        if derived.name in names:
            raise InputError(f"{place}: '{derived.name}' is a parameter too; it cannot be both.")
        find_nominal(instrument, derived.name, place)
    _refuse_twins([one.name for one in keys.derived], f"{where} [[derived]]: the name")
    if not keys.quantity:
        raise InputError(f"{where}: a study needs at least one [[quantity]].")
    columns = [column.name for one in keys.quantity for column in one.columns]
    _refuse_twins(columns, f"{where} [[quantity]]: give one of them another label; the column")
    for place, requirement in numbered("requirement", keys.requirement):
        _check_known(place, "column", [requirement.column], columns)
    numeric = [parameter.name for parameter in parameters if not isinstance(parameter.nominal, str)]
    asked = tuple(_beside(one, folder) for one in keys.quantity)
    searches = tuple(_check_search(place, one, columns, numeric) for place, one in numbered("search", keys.search))
    study = Study(
        keys.name or Path(where).stem, keys.note, instrument, keys.sampling, parameters, keys.derived, asked,
        keys.requirement, searches, content, text, folder,
    )  # fmt: skip
    check_nominal(study, where)
    if any(isinstance(search, ToleranceSearch) for search in study.searches):
        check_sample(study, where)
    return study


def shipped_specs() -> dict[str, Path]:
    """Return name -> path of the specs that ship with the package."""
    return list_shipped(Path(__file__).parent / "templates")


def _resolve(place: str, keys: ParameterKeys, instrument: Instrument, method: str) -> StudyParameter:
    """Return a parameter with its nominal value and its ends, from the card where the spec leaves them open."""
    where = f"{place} '{keys.name}'"
    found = find_nominal(instrument, keys.name, place)
    if keys.values is not None:
        return _list_values(where, keys, keys.values, found, method)
    if method == "list":
        raise InputError(f"{where}: method = 'list' needs values = [...] for every parameter.")
    if method != "grid" and keys.count is not None:
        raise InputError(f"{where}: count is only for method = 'grid'.")
    if method == "grid" and keys.count is None:
        raise InputError(f"{where}: the key 'count' is missing; add it, or values = [...].")
    if isinstance(found, str):
        raise InputError(f"{where} is text in the card; give values = [...] and method = 'grid' or 'list'.")
    middle = found if keys.nominal is None else float(keys.nominal)
    if middle is None:
        if keys.low is None or keys.high is None:
            raise InputError(f"{where}: the card leaves it open, so nominal, or low and high, must be given.")
        middle = (keys.low + keys.high) / 2
    low, high = _find_ends(where, keys, middle)
    if keys.distribution == "log-uniform" and low <= 0:
        raise InputError(f"{where}: a log-uniform parameter must be positive, not from {low:g}.")
    deviation = keys.standard_deviation
    bounded = deviation is None or any(one is not None for one in (keys.low, keys.high, keys.tolerance))
    return StudyParameter(keys.name, middle, low, high, keys.distribution, deviation, (), keys.count, bounded)


def _find_ends(where: str, keys: ParameterKeys, middle: float) -> tuple[float, float]:
    """Return the ends of a parameter; a normal one without ends is shown over three standard deviations."""
    if keys.tolerance is not None:
        return middle - keys.tolerance, middle + keys.tolerance
    low, high = keys.low, keys.high
    if keys.standard_deviation is not None and low is None and high is None:
        return middle - 3 * keys.standard_deviation, middle + 3 * keys.standard_deviation
    if low is None or high is None:
        raise InputError(f"{where}: give tolerance, or low and high.")
    if not low < high:
        raise InputError(f"{where}: low must be below high, not {low:g} and {high:g}.")
    if not low <= middle <= high:
        raise InputError(f"{where}: the nominal value {middle:g} is outside {low:g} to {high:g}; correct one of them.")
    return low, high


def _list_values(
    where: str, keys: ParameterKeys, values: tuple[Any, ...], found: float | str | None, method: str
) -> StudyParameter:
    if method not in ("grid", "list"):
        raise InputError(f"{where}: values are only for method = 'grid' or 'list'; for '{method}' give low and high.")
    kind = str if isinstance(values[0], str) else float
    if keys.nominal is not None and not isinstance(keys.nominal, kind):
        raise InputError(f"{where}: nominal must be of the kind of values, not {keys.nominal!r}.")
    if kind is str:
        texts = keys.nominal or (found if isinstance(found, str) else values[0])
        return StudyParameter(keys.name, texts, 0.0, float(len(values) - 1), values=values)
    if method == "grid":
        _refuse_twins([f"{value:.17g}" for value in values], f"{where}: the value")
    stated = found if keys.nominal is None else keys.nominal
    nominal = stated if isinstance(stated, float) else values[len(values) // 2]
    return StudyParameter(keys.name, nominal, min(values), max(values), values=values)


def _beside(asked: Quantity, folder: str) -> Quantity:
    """Return a quantity whose function, where it has one in a file, is found from anywhere."""
    function = asked.options.get("function", "")
    file = function.rpartition(":")[0].endswith(".py")
    return replace(asked, function=str(Path(folder) / function)) if file else asked


def _check_search(where: str, search: Search, columns: Sequence[str], numeric: Sequence[str]) -> Search:
    """Return a search whose columns and parameters are there; one for tolerances that names none varies all."""
    if isinstance(search, WorstCase):
        _check_known(where, "column", [search.column], columns)
    if isinstance(search, ToleranceSearch):
        _check_known(where, "vary", search.vary, numeric)
    return replace(search, vary=tuple(numeric)) if isinstance(search, ToleranceSearch) and not search.vary else search


def _check_known(where: str, key: str, names: Sequence[str], known: Sequence[str]) -> None:
    for name in names:
        if name not in known:
            raise InputError(f"{where}: {key}: '{name}' is unknown{nearest(name, known)}")


def _refuse_twins(names: Sequence[str], what: str) -> None:
    """Raise InputError when a name stands there twice."""
    twice = [name for place, name in enumerate(names) if name in names[:place]]
    if twice:
        raise InputError(f"{what} '{twice[0]}' is given twice.")
