"""Evaluate designs: what runs in a worker, for one batch after the other."""

import math
import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from studies.errors import UNUSABLE_INPUT
from studies.instrument.card import Instrument
from studies.sweeps.case import Case
from studies.sweeps.child import FunctionFailed, FunctionLost
from studies.sweeps.parameters import set_parameters
from studies.sweeps.quantities import library
from studies.sweeps.row import Row

if TYPE_CHECKING:
    from studies.sweeps.definition import Study
    from studies.sweeps.expressions import Derived
    from studies.sweeps.families import Families
    from studies.sweeps.quantity import Number

Batch = Sequence[Mapping[str, Any]]


@dataclass(frozen=True)
class WorkPlan:
    """What a worker must know of a study; without families small, so that it travels with every task."""

    instrument: Instrument
    asked: tuple[tuple[str, Mapping[str, Any], int], ...]
    families: "Families | None" = None
    derived: "tuple[Derived, ...]" = ()

    @classmethod
    def of(cls, study: "Study", families: "Families | None" = None) -> "WorkPlan":
        """Return the plan of a study."""
        asked = tuple((one.quantity.name, one.options, len(one.columns)) for one in study.asked)
        return cls(study.instrument, asked, families, study.derived)


def evaluate_task(plan: WorkPlan, batches: Sequence[Batch]) -> list[list[Row]]:
    """Evaluate several batches of parameters by name; called in a worker."""
    if plan.families is not None:
        return [plan.families.evaluate(batch) for batch in batches]
    return [[evaluate_case(plan, parameters) for parameters in batch] for batch in batches]


def evaluate_case(plan: WorkPlan, parameters: Mapping[str, Any]) -> Row:
    """Evaluate every quantity of one design; one that cannot be computed fails the case and leaves NaN."""
    began = time.perf_counter()
    values: list[float] = []
    errors: list[float] = []
    reasons: list[str] = []
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        try:
            case = Case(set_parameters(plan.instrument, parameters, plan.derived), parameters)
        except UNUSABLE_INPUT as error:
            return failed_row(plan, "failed", str(error))
        for name, options, width in plan.asked:
            try:
                numbers, reason = _evaluate(name, options, width, case)
            except FunctionLost as error:
                return failed_row(plan, "lost", f"{name}: {error}; the next run tries again.")
            values += (number.value for number in numbers)
            errors += (number.error for number in numbers)
            reasons += [reason] if reason else []
    remarks = dict.fromkeys(str(warning.message) for warning in heard)
    status = "failed" if reasons else "ok"
    seconds = time.perf_counter() - began
    return Row(status, " ".join([*reasons, *remarks]), tuple(values), tuple(errors), seconds)


def failed_row(plan: WorkPlan, status: str, reason: str) -> Row:
    """Return the row of a case that cannot be built, or whose worker did not survive it."""
    nothing = (math.nan,) * sum(width for _, _, width in plan.asked)
    return Row(status, reason, nothing, nothing, 0.0)


def _evaluate(name: str, options: Mapping[str, Any], width: int, case: Case) -> "tuple[Sequence[Number], str]":
    from studies.sweeps.quantity import Number

    nothing = (Number(math.nan),) * width
    try:
        numbers = library()[name].evaluate(case, options)
    except (*UNUSABLE_INPUT, FunctionFailed) as error:
        return nothing, f"{name}: {error}"
    except FunctionLost:
        raise
    except Exception as error:
        return nothing, f"{name}: {type(error).__name__}: {error}"
    if not all(math.isfinite(number.value) for number in numbers):
        return nothing, f"{name}: the result is not a finite number."
    return numbers, ""
