"""The model file `hrg.model/1`: a fitted compensation as a small TOML with all digits, and comments how well each number is known."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np

from compensation.arrays import Array
from studies.errors import InputError, nearest
from studies.files.reading import as_path
from studies.files.writing import write_text
from studies.instrument.units import unit_of
from studies.record import Record
from studies.schema.keys import Keys, number, says, spell_value
from studies.schema.reader import read_file, read_keys

SCHEMA = "hrg.model/1"
WIDENED = 0.05  # of a fitted range, on each side
Setting = float | str | tuple[float, ...]


class Coefficient(Keys, frozen=True, kw_only=True):
    """A coefficient of a formula."""

    name: Annotated[str, says("of the term", example="constant")]
    value: Annotated[float, number("all digits", example=1.5)]
    unit: Annotated[str, says("of the value", example="deg/h")]


class ModelPart(Keys, frozen=True, kw_only=True):
    """One set of coefficients that was fitted together, with their covariance (k, k), or none ()."""

    name: Annotated[str, says("by which the kind knows it", example="bias")]
    coefficients: Annotated[tuple[Coefficient, ...], says("one or more", least=1)]
    covariance: Annotated[tuple[tuple[float, ...], ...], says("of the coefficients in this order; [] unknown")] = ()

    def __post_init__(self) -> None:
        names = self.names
        if len(set(names)) < len(names):
            raise ValueError("two coefficients have the same name; rename one.")
        if len(self.covariance) not in (0, len(names)) or any(len(row) != len(names) for row in self.covariance):
            raise ValueError(f"covariance must be {len(names)} lists of {len(names)} numbers, or [].")
        if any(row[k] < 0 for k, row in enumerate(self.covariance)):
            raise ValueError("covariance has a negative variance on its diagonal.")

    def __getitem__(self, name: str) -> float:
        return self.values[self.names.index(name)]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the terms."""
        return tuple(one.name for one in self.coefficients)

    @property
    def values(self) -> tuple[float, ...]:
        """Values of the coefficients."""
        return tuple(one.value for one in self.coefficients)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the values."""
        return tuple(one.unit for one in self.coefficients)

    @property
    def standard_errors(self) -> tuple[float, ...]:
        """Square roots of the covariance's diagonal; NaN where it is unknown."""
        if not self.covariance:
            return (math.nan,) * len(self.coefficients)
        return tuple(math.sqrt(row[k]) for k, row in enumerate(self.covariance))


class ModelSource(msgspec.Struct, frozen=True):
    """A record that a model was fitted to."""

    path: Annotated[str, says("name of the file", example="run1.csv")]
    sha256: Annotated[str, says("of its bytes", example="ab12")]
    rows: Annotated[int, number("in it", least=0, example=1800)]


class ModelKeys(Keys, frozen=True, kw_only=True):
    """A fitted compensation: what it applies to, where it holds, its coefficients, where they come from."""

    schema: Annotated[str, says("kind of file")] = SCHEMA
    kind: Annotated[str, says("frequency, bias, scale or cross-damping", example="bias")]
    compensates: Annotated[str, says("the column of a record that gets a compensated copy", example="bias_deg_per_h")]
    made_by: Annotated[str, says("the command that fitted it")] = ""
    settings: Annotated[dict[str, Setting], says("settings of the formula besides its coefficients")] = msgspec.field(default_factory=dict)  # fmt: skip
    validity: Annotated[dict[str, tuple[float, float]], says("lowest and highest value of each variable in the fitted data")] = msgspec.field(default_factory=dict)  # fmt: skip
    parts: Annotated[tuple[ModelPart, ...], says("one or more, fitted together", least=1)] = msgspec.field(name="part")
    sources: Annotated[tuple[ModelSource, ...], says("records that were fitted")] = msgspec.field(name="source", default=())  # fmt: skip

    def __post_init__(self) -> None:
        for key, (low, high) in self.validity.items():
            if not low < high:
                raise ValueError(f"[validity] {key}: the lowest value {low:g} must be below the highest {high:g}.")


class Model(ModelKeys, frozen=True, kw_only=True):
    """A model and the file that it came from."""

    path: str = ""

    def __post_init__(self) -> None:
        """Allow what only a file is refused for: a fit that has seen one value has a range without length."""

    @property
    def where(self) -> str:
        """The file, for messages."""
        return self.path or "model"

    def part(self, name: str) -> ModelPart:
        """Return the part of that name."""
        for part in self.parts:
            if part.name == name:
                return part
        raise InputError(f"{self.where}: a model of kind '{self.kind}' needs a [[part]] named '{name}'.")

    @property
    def temperature_column(self) -> str:
        """The column that the setting of this name calls the temperature."""
        column = self.settings.get("temperature_column")
        if not isinstance(column, str):
            raise InputError(f"{self.where} [settings]: the key 'temperature_column' must name a column.")
        return column

    def number(self, key: str, *, above: float | None = None, least: float | None = None) -> float:
        """Return a setting that must be a finite number within its bounds."""
        where = f"{self.where} [settings]"
        if key not in self.settings:
            raise InputError(f"{where}: the key '{key}' is missing; add it.")
        kind: Any = Annotated[float, number(above=above, least=least)]
        return float(read_keys(self.settings[key], kind, f"{where}: {key}"))

    def check_inputs(self, record: Record, *columns: str, outputs: Collection[str]) -> None:
        """Refuse a column that this kind cannot compensate, and a record that lacks a column that it needs."""
        self.check_output(outputs)
        for name in (self.compensates, *columns):
            if name not in record:
                raise InputError(f"the column '{name}' is missing; this {self.kind} model needs it.")

    def check_output(self, outputs: Collection[str]) -> None:
        """Refuse a column that this kind cannot compensate; InputError names those that it can."""
        if self.compensates not in outputs:
            raise InputError(f"{self.where}: a {self.kind} model compensates {' or '.join(outputs)}.")

    def check_names(self, part: ModelPart, prefix: str, first: str = "") -> None:
        """Refuse coefficients of a polynomial that are not prefix0 (or `first`), prefix1, … in this order; InputError says so."""
        expected = (first or f"{prefix}0", *(f"{prefix}{k}" for k in range(1, len(part.coefficients))))
        if part.names != expected:
            names = ", ".join(expected)
            raise InputError(f"{self.where} [[part]] {part.name}: the coefficients must be {names}, in this order.")

    def range_of(self, variable: str) -> tuple[float, float]:
        """Return the lowest and highest value of a variable for which the model is valid."""
        if variable not in self.validity:
            raise InputError(f"{self.where} [validity]: the range of '{variable}' is missing; add it.")
        return self.validity[variable]

    def check_range(self, variable: str, values: Array, extrapolate: bool) -> None:
        """Refuse values of a variable outside the fitted range, unless told to extrapolate; NaN pass and stay missing."""
        low, high = self.range_of(variable)
        if variable == "frequency_Hz" and values.size and low <= 1e3 * np.nanmedian(values) <= high:
            raise InputError(
                f"{variable} is near {np.nanmedian(values):.6g}, a thousandth of {low:.6g} to {high:.6g} Hz, which the model was fitted to: is it in kHz? Then multiply the column by 1000."
            )
        outside = (values < low) | (values > high)
        if not extrapolate and np.any(outside):
            lowest, highest = np.nanmin(values), np.nanmax(values)
            unit = f" {unit_of(variable)}".removesuffix(" 1")
            raise InputError(
                f"{variable} runs from {lowest:.8g} to {highest:.8g}, outside {low:.8g} to {high:.8g}{unit}, which is what "
                f"the model was fitted to and a little beyond ({100 * np.mean(outside):.1f} % of the rows); calibrate over that range, or add --extrapolate."
            )


def widen(low: float, high: float) -> tuple[float, float]:
    """Return a fitted range wider by a twentieth on each side: readings scatter about the means that were fitted."""
    return low - WIDENED * (high - low), high + WIDENED * (high - low)


def make_part(
    name: str, names: Sequence[str], values: Sequence[float] | Array, units: Sequence[str],
    covariance: Array | None = None,
) -> ModelPart:  # fmt: skip
    """Build a part from arrays."""
    columns = zip(names, map(float, values), units, strict=True)
    return ModelPart(
        name=name,
        coefficients=tuple(Coefficient(name=one, value=value, unit=unit) for one, value, unit in columns),
        covariance=() if covariance is None else tuple(map(tuple, np.asarray(covariance, dtype=float).tolist())),
    )


def write_model(model: Model | str | Path, path: str | Path) -> None:
    """Save a model, whole or not at all."""
    write_text(path, format_model(read_any_model(model)))


def format_model(model: Model) -> str:
    """Return the text of a model's file."""
    head = {"schema": SCHEMA, "kind": model.kind, "compensates": model.compensates, "made_by": model.made_by}
    lines = [f"{key} = {spell_value(value)}" for key, value in head.items()]
    for title, table in (("settings", model.settings), ("validity", model.validity)):
        if table:
            lines += ["", f"[{title}]", *(f"{key} = {spell_value(value)}" for key, value in table.items())]
    for part in model.parts:
        lines += ["", "[[part]]", f"name = {spell_value(part.name)}", "coefficients = ["]
        for name, value, unit, error in zip(part.names, part.values, part.units, part.standard_errors, strict=True):
            entry = f"    {{name = {spell_value(name)}, value = {value!r}, unit = {spell_value(unit)}}},"
            lines.append(entry if math.isnan(error) else f"{entry:<72}  # ± {error:.2g}")
        rows = ",\n    ".join(spell_value(row) for row in part.covariance)
        lines += ["]", f"covariance = [\n    {rows},\n]" if rows else "covariance = []"]
    for source in model.sources:
        lines += ["", "[[source]]", *(f"{k} = {spell_value(getattr(source, k))}" for k in source.__struct_fields__)]
    return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class Known:
    """What the file of a kind of model may hold: settings, ranges, and the parts with the units of their coefficients."""

    settings: Collection[str]
    validity: Collection[str]
    units: Mapping[str, Sequence[str]]

    def check(self, model: Model) -> None:
        """Refuse anything else, which would be ignored or misread."""
        for title, given, known in (
            ("settings", model.settings, self.settings),
            ("validity", model.validity, self.validity),
        ):
            if unknown := next((key for key in given if key not in known), None):
                raise InputError(f"{model.where} [{title}]: unknown key '{unknown}'{nearest(unknown, known)}")
        for part in model.parts:
            if part.name not in self.units:
                raise InputError(f"{model.where} [[part]]: unknown name '{part.name}'{nearest(part.name, self.units)}")
            for one, unit in zip(part.coefficients, self.units[part.name], strict=True):
                if one.unit != unit:
                    raise InputError(f"{model.where} [[part]] {part.name}: the coefficient '{one.name}' must be in {unit}, not {one.unit}; convert its value.")  # fmt: skip


def read_any_model(path: Model | str | Path) -> Model:
    """Read a model's file, whatever its kind; a model is what it is."""
    if isinstance(path, Model):
        return path
    from studies.instrument.card import shipped_cards

    if not as_path(path).exists() and str(path) in shipped_cards():
        raise InputError(f"{path}: this is a card, not a model; give the file that 'hrg fit … --save' wrote.")
    return Model(**msgspec.structs.asdict(read_file(path, ModelKeys, SCHEMA)), path=str(path))
