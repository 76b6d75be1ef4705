"""A design task, read and checked: a study of its designs, and what their columns are wanted to be."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from compensation.arrays import Array
from studies.design.keys import SCHEMA, DesignKeys, Objective, Tolerance
from studies.errors import InputError, nearest
from studies.files.reading import find_shipped, list_shipped
from studies.instrument.card import load_card
from studies.schema.reader import read_keys, read_text, read_toml
from studies.sweeps.definition import Study
from studies.sweeps.keys import Requirement
from studies.sweeps.parameters import find_nominal, set_parameters
from studies.sweeps.quantities import library
from studies.sweeps.quantities.split_per_wave import SURFACES
from studies.sweeps.spec import check_study

MOST_HARMONIC = 12  # up to which a column finds its quantity
# a limit of the distance needs no neighbour's frequency to better than the solver finds it at once
NEIGHBOURS: dict[str, Any] = {"name": "mode-separation", "distances": True, "each": 3, "tolerance": 1e-4}


@dataclass(frozen=True)
class Task:
    """A checked task."""

    keys: DesignKeys  # as written
    name: str
    # its parameters are the free ones, then those that have a tolerance only; its quantities all that is asked.
    study: Study
    free: int  # how many of the parameters are free
    start: Array  # the first design, array (parameters,)

    @cached_property
    def columns(self) -> list[str]:
        """The names of all columns."""
        return [column.name for column in self.study.columns]

    def place(self, column: str) -> int:
        """Return where a column stands."""
        return self.columns.index(column)

    @property
    def wanted(self) -> list[str]:
        """The columns of objectives and constraints, each once."""
        return list(dict.fromkeys(goal.column for goal in _goals(self.keys)))

    def named(self, design: Array) -> dict[str, float]:
        """A design by the names of its parameters."""
        return dict(zip(self.study.names, design.tolist(), strict=True))

    def unit(self, column: str) -> str:
        """The unit of a column, as people read it; nothing where it is 1."""
        found = next(one.unit for one in self.study.columns if one.name == column)
        return "" if found == "1" else found

    def tolerance(self, name: str) -> Tolerance | None:
        """The tolerance of a parameter."""
        return next((one for one in self.keys.tolerance if one.name == name), None)


def read_task(source: str | Path, text: str | None = None) -> Task:
    """Read a task from a TOML file (of that `text`), or by the name of one that ships."""
    path = find_shipped(source, shipped_tasks(), "design")
    text = read_text(path) if text is None else text
    content, where = read_toml(path, SCHEMA, text), str(path)
    keys = read_keys(content, DesignKeys, where)
    for table, members in (("parameter", keys.parameter), ("objective", keys.objective)):
        if not members:
            raise InputError(f"{where}: a design needs at least one [[{table}]].")
    beside = path.parent / keys.card
    instrument = load_card(beside if keys.card.endswith(".toml") else keys.card)
    for name in keys.fixed or {}:
        find_nominal(instrument, name, f"{where}: fixed")
    instrument = instrument.with_values(keys.fixed or {})
    free = {one.name for one in keys.parameter}
    parameters: list[dict[str, Any]] = []
    start = []
    for number, one in enumerate(keys.parameter, 1):
        place = f"{where} [[parameter]] number {number}"
        in_card = find_nominal(instrument, one.name, place)
        if isinstance(in_card, str) or (in_card is None and one.start is None):
            raise InputError(f"{place} '{one.name}' has no number in the card; give start = ..., or another key.")
        value = one.start if one.start is not None else min(max(float(in_card or 0.0), one.low), one.high)
        parameters.append({"name": one.name, "low": one.low, "high": one.high, "nominal": value})
        start.append(value)
    for also in keys.tolerance:
        if also.name not in free:
            parameters.append({"name": also.name, "tolerance": also.most})
            start.append(float(find_nominal(instrument, also.name, f"{where} [[tolerance]]") or 0.0))
    spec = {
        "name": keys.name or path.stem,
        "card": keys.card,
        "sampling": {"method": "one-at-a-time"},
        "parameter": parameters,
        "derived": content.get("derived", []),
        "quantity": list(_quantities(keys, content, where)),
    }
    study = check_study(spec, instrument, where, str(path.parent.resolve()), text)
    if study.functions:
        raise InputError(f"{where}: a design asks for no Python function; use hrg study for that.")
    task = Task(keys, keys.name or path.stem, study, len(free), np.array(start))
    for goal in _goals(keys):
        _check_magnitude(goal, where)
    _check_bounds(task, where)
    return task


def shipped_tasks() -> dict[str, Path]:
    """Return name -> path of the worked designs that ship with the package."""
    return list_shipped(Path(__file__).parents[1] / "examples")


def is_magnitude(column: str) -> bool:
    """Whether a column counts by its magnitude: the distance of the nearest mode, whose sign says on which side it is."""
    return "separation_n" in column and column.endswith("_Hz") and "_of_n" not in column


def shown(column: str, value: float) -> float:
    """Return a value as it counts: distances by their magnitude."""
    return abs(float(value)) if is_magnitude(column) else float(value)


def _goals(keys: DesignKeys) -> list[Objective | Requirement]:
    """Return all that is wanted of columns."""
    return [*keys.objective, *keys.constraint]


def _check_magnitude(goal: Objective | Requirement, where: str) -> None:
    """The distance of the nearest mode can be held above something, or be made large: nothing else is smooth."""
    if not is_magnitude(goal.column):
        return
    wrong = goal.goal != "greatest" if isinstance(goal, Objective) else goal.low is None or goal.high is not None
    if wrong:
        raise InputError(f"{where}: '{goal.column}' takes goal = 'greatest', or a constraint with low alone.")


def _check_bounds(task: Task, where: str) -> None:
    """Refuse a bound at which no resonator can be built: not with the first design's other values, nor with all at one end."""
    start, free = task.named(task.start), task.keys.parameter
    others = [start, *({**start, **{one.name: getattr(one, end) for one in free}} for end in ("low", "high"))]
    for number, one in enumerate(free, 1):
        for end in ("low", "high"):
            reasons = []
            for other in others:
                try:
                    set_parameters(task.study.instrument, {**other, one.name: getattr(one, end)}, task.study.derived)
                    break
                except InputError as error:
                    reasons.append(str(error))
            else:
                raise InputError(
                    f"{where} [[parameter]] number {number}: {end} = {getattr(one, end):g} of '{one.name}' allows no resonator"
                    f" ({reasons[0].rstrip('.')}); narrow the bounds, or tie lengths with [[derived]]."
                )


def _quantities(keys: DesignKeys, content: Mapping[str, Any], where: str) -> Iterator[dict[str, Any]]:
    """Yield the tables of all quantities: those of the file, and for columns that these do not give those found by name."""
    known: dict[str, dict[str, Any]] = {}
    for quantity, written in zip(keys.quantity, content.get("quantity", []), strict=True):
        table = {**NEIGHBOURS, **written} if quantity.name == "mode-separation" else written
        known |= dict.fromkeys((column.name for column in quantity.columns), table)
        yield table
    found = _by_column()
    tables = ["objective"] * len(keys.objective) + ["constraint"] * len(keys.constraint)
    numbers = [*range(1, len(keys.objective) + 1), *range(1, len(keys.constraint) + 1)]
    for heading, number, goal in zip(tables, numbers, _goals(keys), strict=True):
        column = goal.column
        if column in known:
            continue
        if column not in found:
            words = nearest(column, {**known, **found})
            raise InputError(f"{where} [[{heading}]] number {number}: column = '{column}' is unknown{words}")
        new = found[column]
        known |= {other: new for other, one in found.items() if one == new}
        yield new


def _by_column() -> dict[str, dict[str, Any]]:
    """Return the table that gives a column, of every quantity with its default keys and every harmonic."""
    found: dict[str, dict[str, Any]] = {}
    for name, quantity in library().items():
        if name == "python":
            continue
        base: dict[str, Any] = NEIGHBOURS if name == "mode-separation" else {"name": name}
        fields = quantity.__struct_fields__
        harmonics = [2, *range(2), *range(3, MOST_HARMONIC + 1)] if "harmonic" in fields else [None]
        waves: list[dict[str, Any]] = [{}]
        if name == "split-per-wave":
            waves += [{"of": of, "order": order} for of, order in product(SURFACES, range(1, MOST_HARMONIC + 1))]
        for n, wave in product(harmonics, waves):
            table = {**base, **wave} if n in (None, 2) else {**base, **wave, "harmonic": n}
            asked = quantity(**{key: value for key, value in table.items() if key != "name"})
            for column in asked.columns:
                found.setdefault(column.name, table)
    return found
