"""The model file `hrg.model/1`: a fitted compensation as a small TOML that people and firmware engineers read.

    schema = "hrg.model/1"
    kind = "bias"                       # the module of studies.models that applies it
    compensates = "bias_deg_per_h"      # the column of a record that gets a compensated copy
    made_by = "hrg-workbench, hrg fit bias --method guarded"

    [settings]                          # what the formula needs beside coefficients: numbers, texts, lists of numbers
    reference_frequency_Hz = 4432.07

    [validity]                          # lowest and highest value of each variable that the fit has seen
    frequency_Hz = [4416.97, 4439.2]

    [[part]]                            # one set of coefficients that was fitted together
    name = "bias"
    coefficients = [
        {name = "constant", value = 1.5, unit = "deg/h"},        # ± 0.02
    ]
    covariance = [[4e-4]]               # of the coefficients in this order; [] where it is unknown

    [[source]]                          # the records that it was fitted to
    path = "run1.csv"
    sha256 = "…"
    rows = 1800

Numbers keep all their digits, so a model that was saved and read computes the same to the last bit. The text is laid out here,
not by tomli-w, for the comments: how well each coefficient is known.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.errors import InputError
from studies.files.toml import TomlTable, check_number, read_toml
from studies.files.writing import write_text

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

SCHEMA = "hrg.model/1"
WIDENED = 0.05  # of a fitted range, on each side
Setting = float | str | Sequence[float]
KEYS = ("schema", "kind", "compensates", "made_by", "settings", "validity", "part", "source")


@dataclass(frozen=True)
class ModelPart:
    """Coefficients that were fitted together: names, values, units (k,) and covariance (k, k), or none ()."""

    name: str
    names: tuple[str, ...]
    values: tuple[float, ...]
    units: tuple[str, ...]
    covariance: tuple[tuple[float, ...], ...] = ()

    def __getitem__(self, name: str) -> float:
        return self.values[self.names.index(name)]

    @property
    def standard_errors(self) -> tuple[float, ...]:
        """Square roots of the covariance's diagonal; NaN where it is unknown."""
        if not self.covariance:
            return (math.nan,) * len(self.values)
        return tuple(math.sqrt(row[k]) for k, row in enumerate(self.covariance))


@dataclass(frozen=True)
class ModelSource:
    """A record that a model was fitted to."""

    path: str
    sha256: str
    rows: int


@dataclass(frozen=True)
class Model:
    """A fitted compensation: what it applies to, where it holds, its coefficients, where they come from."""

    kind: str
    compensates: str
    parts: tuple[ModelPart, ...]
    settings: Mapping[str, Setting] = field(default_factory=dict)
    validity: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    sources: tuple[ModelSource, ...] = ()
    made_by: str = ""
    path: str = ""

    def part(self, name: str) -> ModelPart:
        """Return the part of that name.

        Raises
        ------
        InputError
            The model has no such part.
        """
        for part in self.parts:
            if part.name == name:
                return part
        raise InputError(f"{self.path or 'model'}: a model of kind '{self.kind}' needs a [[part]] named '{name}'.")

    @property
    def temperature_column(self) -> str:
        """The column that the setting of this name calls the temperature."""
        column = self.settings.get("temperature_column")
        if not isinstance(column, str):
            raise InputError(f"{self.path or 'model'} [settings]: the key 'temperature_column' must name a column.")
        return column

    def number(self, key: str, *, above: float | None = None, least: float | None = None) -> float:
        """Return a setting that must be a finite number within its bounds.

        Raises
        ------
        InputError
            The setting is missing or something else.
        """
        where = f"{self.path or 'model'} [settings]"
        if key not in self.settings:
            raise InputError(f"{where}: the key '{key}' is missing; add it.")
        return check_number(self.settings[key], f"{where}: {key}", above=above, least=least)

    def range_of(self, variable: str) -> tuple[float, float]:
        """Return the lowest and highest value of a variable that the fit has seen.

        Raises
        ------
        InputError
            The model does not say.
        """
        if variable not in self.validity:
            raise InputError(f"{self.path or 'model'} [validity]: the range of '{variable}' is missing; add it.")
        return self.validity[variable]

    def check_range(self, variable: str, values: "NDArray[np.float64]", extrapolate: bool) -> None:
        """Refuse values of a variable that the fit has not seen, unless told to extrapolate.

        Missing values (NaN) pass; they stay missing in the result.

        Raises
        ------
        InputError
            Values outside `validity[variable]`, or no such range in the model.
        """
        import numpy as np

        low, high = self.range_of(variable)
        outside = (values < low) | (values > high)
        if not extrapolate and np.any(outside):
            lowest, highest = np.nanmin(values), np.nanmax(values)
            raise InputError(
                f"{variable} runs from {lowest:.8g} to {highest:.8g}, outside {low:.8g} to {high:.8g} that the "
                f"model was fitted to ({np.mean(outside):.1%} of the rows); calibrate over that range, or add "
                "--extrapolate."
            )


def widen(low: float, high: float) -> tuple[float, float]:
    """Return a fitted range wider by a twentieth on each side: readings scatter about the means that were fitted."""
    return low - WIDENED * (high - low), high + WIDENED * (high - low)


def make_part(
    name: str,
    names: Sequence[str],
    values: "Sequence[float] | NDArray[np.float64]",
    units: Sequence[str],
    covariance: "NDArray[np.float64] | None" = None,
) -> ModelPart:
    """Build a part from arrays."""
    rows = () if covariance is None else tuple(tuple(float(v) for v in row) for row in covariance)
    return ModelPart(name, tuple(names), tuple(float(v) for v in values), tuple(units), rows)


def write_model(model: Model, path: str | Path) -> None:
    """Save a model, whole or not at all.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    write_text(path, format_model(model))


def format_model(model: Model) -> str:
    """Return the text of a model's file."""
    lines = [
        f"schema = {_text(SCHEMA)}",
        f"kind = {_text(model.kind)}",
        f"compensates = {_text(model.compensates)}",
        f"made_by = {_text(model.made_by)}",
    ]
    for title, table in (("settings", model.settings), ("validity", model.validity)):
        if table:
            lines += ["", f"[{title}]", *(f"{key} = {_value(value)}" for key, value in table.items())]
    for part in model.parts:
        lines += ["", "[[part]]", f"name = {_text(part.name)}", "coefficients = ["]
        for name, value, unit, error in zip(part.names, part.values, part.units, part.standard_errors, strict=True):
            entry = f"    {{name = {_text(name)}, value = {value!r}, unit = {_text(unit)}}},"
            lines.append(entry if math.isnan(error) else f"{entry:<72}  # ± {error:.2g}")
        rows = ",\n    ".join(_value(row) for row in part.covariance)
        lines += ["]", f"covariance = [\n    {rows},\n]" if rows else "covariance = []"]
    for source in model.sources:
        lines += ["", "[[source]]", f"path = {_text(source.path)}", f"sha256 = {_text(source.sha256)}"]
        lines.append(f"rows = {source.rows}")
    return "\n".join(lines) + "\n"


def read_model(path: str | Path) -> Model:
    """Read a model's file.

    Raises
    ------
    InputError
        Not such a file: the message names the key and the mend.
    """
    top = TomlTable(read_toml(path, SCHEMA), str(path), KEYS)
    parts = tuple(_read_part(section) for section in top.sections("part", ("name", "coefficients", "covariance")))
    if not parts:
        raise InputError(f"{path}: a model needs at least one [[part]] with coefficients.")
    return Model(
        kind=top.text("kind"),
        compensates=top.text("compensates"),
        parts=parts,
        settings=_read_settings(top),
        validity=_read_validity(top),
        sources=tuple(
            ModelSource(s.text("path"), s.text("sha256"), int(s.number("rows", least=0)))
            for s in top.sections("source", ("path", "sha256", "rows"))
        ),
        made_by=top.text("made_by", ""),
        path=str(path),
    )


def _read_settings(top: TomlTable) -> dict[str, Setting]:
    settings: dict[str, Setting] = {}
    if "settings" not in top:
        return settings
    table = top.section("settings", tuple(top.raw("settings")) if isinstance(top.raw("settings"), dict) else ())
    for key, value in table.values.items():
        where = f"{table.where}: {key}"
        if isinstance(value, str):
            settings[key] = value
        elif isinstance(value, list):
            settings[key] = tuple(check_number(item, where) for item in value)
        else:
            settings[key] = check_number(value, where)
    return settings


def _read_validity(top: TomlTable) -> dict[str, tuple[float, float]]:
    ranges: dict[str, tuple[float, float]] = {}
    if "validity" not in top:
        return ranges
    table = top.section("validity", tuple(top.raw("validity")) if isinstance(top.raw("validity"), dict) else ())
    for key, value in table.values.items():
        where = f"{table.where}: {key}"
        if not isinstance(value, list) or len(value) != 2:
            raise InputError(f"{where} must be a list [lowest, highest], not {value!r}.")
        low, high = (check_number(item, where) for item in value)
        if not low < high:
            raise InputError(f"{where}: the lowest value {low:g} must be below the highest {high:g}.")
        ranges[key] = (low, high)
    return ranges


def _read_part(section: TomlTable) -> ModelPart:
    coefficients = section.sections("coefficients", ("name", "value", "unit"))
    if not coefficients:
        raise InputError(f"{section.where}: 'coefficients' needs at least one {{name, value, unit}}.")
    names = tuple(c.text("name") for c in coefficients)
    if len(set(names)) < len(names):
        raise InputError(f"{section.where}: two coefficients have the same name; rename one.")
    covariance = section.raw("covariance", [])
    shaped = isinstance(covariance, list) and all(
        isinstance(row, list) and len(row) == len(names) for row in covariance
    )
    if not shaped or len(covariance) not in (0, len(names)):
        raise InputError(f"{section.where}: covariance must be {len(names)} lists of {len(names)} numbers, or [].")
    rows = tuple(tuple(check_number(v, f"{section.where}: covariance") for v in row) for row in covariance)
    if any(row[k] < 0 for k, row in enumerate(rows)):
        raise InputError(f"{section.where}: covariance has a negative variance on its diagonal.")
    return ModelPart(
        section.text("name"),
        names,
        tuple(c.number("value") for c in coefficients),
        tuple(c.text("unit") for c in coefficients),
        rows,
    )


def _value(value: Any) -> str:
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(item) for item in value)}]"
    return repr(float(value))


def _text(text: str) -> str:
    import tomli_w

    return tomli_w.dumps({"x": text}).removeprefix("x = ").rstrip("\n")
