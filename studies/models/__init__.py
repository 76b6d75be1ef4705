"""Fitted compensation models as files: saved, read, applied to a record, emitted as C for firmware.

A kind of model is one module in `studies.models.kinds`, found by its name (`cross-damping` is
`cross_damping.py`), with three functions:

    def compensate(model: Model, record: Record, *, extrapolate: bool) -> dict[str, NDArray[np.float64]]:
        "Return the `compensated_…` columns; a row that lacks an input stays NaN, never silently wrong.
        A frequency model of a record without any thermometer returns `resonator_temperature_degC`."

    def emit_c(model: Model) -> str:
        "Return a C99 translation unit without dependencies beyond math.h."

    def known(model: Model) -> Known:
        "Return what a file of this kind may hold; anything else is refused when it is read."

A fit makes its `Model` with a function beside those (`kinds.frequency.save_frequency(fit, …)`), writes it
with `write_model`, and needs nothing else to be applied by `hrg compensate`. `model.check_range` refuses to
extrapolate, `model.part(name)` and `model.number(key)` take what the formula needs or name what is missing.
"""

from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any

from numpy import isinf

from compensation.errors import CompensationError
from studies.errors import InputError, nearest
from studies.models import kinds
from studies.models.file import Model, ModelPart, ModelSource, format_model, make_part, read_any_model, write_model
from studies.record import COMPENSATED, RESONATOR, Record, Run, read_record

__all__ = [
    "Model", "ModelPart", "ModelSource", "compensate", "emit_c", "format_model", "make_part", "model_kinds", "read_model",
    "source_of", "write_model",
]  # fmt: skip


def model_kinds() -> list[str]:
    """Return the kinds of model that can be applied."""
    return sorted(m.name.replace("_", "-") for m in iter_modules(kinds.__path__))


def read_model(path: Model | str | Path) -> Model:
    """Read a model's file; a model is what it is."""
    if isinstance(path, Model):
        return path
    model = read_any_model(path)
    _module(model).known(model).check(model)
    return model


def source_of(record: Record) -> ModelSource:
    """Return what a model keeps of a record that it was fitted to: file name, hash of its bytes, rows."""
    return ModelSource(Path(record.path).name, record.sha256, len(record))


def compensate(model: Model | str | Path, record: Run, *, extrapolate: bool = False) -> Record:
    """Return the record with the model's `compensated_…` columns added; `model`, `record`: or their paths."""
    model, record = read_model(model), read_record(record)
    try:
        columns = _module(model).compensate(model, record, extrapolate=extrapolate)
    except (InputError, CompensationError) as error:
        named = any(path and path in str(error) for path in (record.path, model.path))
        where = f"{record.path}: " if record.path and not named else ""
        raise InputError(f"{where}{error}") from error
    for name, values in columns.items():
        if isinf(values).any():
            raise InputError(f"{model.where}: its coefficients make '{name}' infinite; correct them.")
        if not name.startswith(COMPENSATED) and name != RESONATOR:
            raise ValueError(f"{model.kind} writes '{name}', which is no {COMPENSATED}… column")
        if name in record:
            raise InputError(f"{record.path}: has a column '{name}' already; remove it or start from the raw record.")
    return record.with_columns(columns)


def emit_c(model: Model | str | Path) -> str:
    """Return the model, or that of a path, as C99 source for firmware, with its origin in the head comment."""
    model = read_model(model)
    return str(_module(model).emit_c(model))


def _module(model: Model) -> Any:
    if model.kind not in model_kinds():
        raise InputError(f"{model.where}: unknown kind '{model.kind}'{nearest(model.kind, model_kinds())}")
    return import_module(f"{kinds.__name__}.{model.kind.replace('-', '_')}")
