"""Evaluate designs: what runs in a worker, for one batch after the other."""

import math
import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from studies.errors import UNUSABLE_INPUT
from studies.instrument.card import Instrument
from studies.sweeps.block import Batch, Cases, Remark, Row, decode, each_design, join
from studies.sweeps.case import Case
from studies.sweeps.child import FunctionFailed, FunctionLost
from studies.sweeps.definition import Study
from studies.sweeps.design import coding
from studies.sweeps.expressions import Derived
from studies.sweeps.families import Families
from studies.sweeps.parameters import set_parameters
from studies.sweeps.quantity import HarmonicQuantity, Number, Quantity


@dataclass(frozen=True)
class WorkPlan:
    """What travels to a worker with every task; `start` is the design from which a search follows modes by their shapes, not order."""

    instrument: Instrument
    coding: tuple[tuple[str, tuple[str, ...]], ...]
    asked: tuple[Quantity, ...]
    families: Families | None = None
    derived: tuple[Derived, ...] = ()
    start: Mapping[str, Any] | None = None

    @classmethod
    def of(cls, study: Study, families: Families | None = None) -> "WorkPlan":
        """Return the plan of a study."""
        return cls(study.instrument, coding(study), study.asked, families, study.derived)

    @cached_property
    def wanted(self) -> dict[tuple[int, str], tuple[int, float]]:
        """Number and tolerance of the modes of each harmonic and theory that all quantities together need."""
        found: dict[tuple[int, str], tuple[int, float]] = {}
        for one in self.asked:
            if isinstance(one, HarmonicQuantity):
                for n, count, tolerance in one.list_modes():
                    most, finest = found.get((n, one.theory), (count, tolerance))
                    found[n, one.theory] = max(count, most), min(tolerance, finest)
        return found

    @property
    def width(self) -> int:
        """The number of columns of results."""
        return sum(len(one.columns) for one in self.asked)


def evaluate_task(plan: WorkPlan, batches: Sequence[Batch]) -> list[Cases]:
    """Evaluate several batches of designs; called in a worker."""
    return [_evaluate_together(plan, batch) if plan.families else _evaluate_each(plan, batch) for batch in batches]


def _evaluate_each(plan: WorkPlan, batch: Batch) -> Cases:
    began = time.perf_counter()
    rows = [evaluate_case(plan, design) for design in each_design(decode(plan.coding, batch.designs), len(batch))]
    remarks: dict[tuple[str, str], list[int]] = {}
    for place, row in enumerate(rows):
        if row.remark or row.status != "ok":
            remarks.setdefault((row.status, row.remark), []).append(place)
    return Cases(
        batch,
        np.array([row.values for row in rows]),
        np.array([row.errors for row in rows]),
        time.perf_counter() - began,
        tuple(Remark(*key, places) for key, places in remarks.items()),
    )


def _evaluate_together(plan: WorkPlan, batch: Batch) -> Cases:
    """Evaluate a batch through families; where one of its designs cannot be computed, by halves."""
    assert plan.families is not None
    began = time.perf_counter()
    try:
        values, errors = plan.families.evaluate(decode(plan.coding, batch.designs), len(batch))
    except UNUSABLE_INPUT as error:
        if len(batch) == 1:
            return failed_cases(plan, batch, "failed", str(error))
        middle = len(batch) // 2
        return join([_evaluate_together(plan, one) for one in (batch.part(0, middle), batch.part(middle, len(batch)))])
    return Cases(batch, values, errors, time.perf_counter() - began)


def failed_cases(plan: WorkPlan, batch: Batch, status: str, reason: str) -> Cases:
    """Return designs without values, for one reason."""
    nothing = np.full((len(batch), plan.width), math.nan)
    return Cases(batch, nothing, nothing, 0.0, (Remark(status, reason, list(range(len(batch)))),))


def evaluate_case(plan: WorkPlan, parameters: Mapping[str, Any]) -> Row:
    """Evaluate every quantity of one design; one that cannot be computed fails the case and leaves NaN."""

    def build(given: Mapping[str, Any]) -> Instrument:
        return set_parameters(plan.instrument, given, plan.derived)

    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        try:
            case = Case(build(parameters), parameters, build, plan.start, plan.wanted)
            answers = [_evaluate(asked, case) for asked in plan.asked]
        except (*UNUSABLE_INPUT, FunctionLost) as error:
            nothing = np.full(plan.width, math.nan)
            return Row("lost" if isinstance(error, FunctionLost) else "failed", str(error), nothing, nothing)
    numbers = [number for found, _ in answers for number in found]
    reasons = [reason for _, reason in answers if reason]
    remarks = dict.fromkeys(str(warning.message) for warning in heard)
    values, errors = np.array([(one.value, one.error) for one in numbers]).T
    return Row("failed" if reasons else "ok", " ".join([*reasons, *remarks]), values, errors)


def _evaluate(asked: Quantity, case: Case) -> tuple[Sequence[Number], str]:
    """Return the numbers of a quantity, or why there are none."""
    nothing, name = (Number(math.nan),) * len(asked.columns), asked.name
    try:
        numbers = asked.evaluate(case)
    except (*UNUSABLE_INPUT, FunctionFailed) as error:
        return nothing, f"{name}: {error}"
    except FunctionLost as error:
        raise FunctionLost(f"{name}: {error}; the next run tries again.") from error
    except Exception as error:
        return nothing, f"{name}: {type(error).__name__}: {error}"
    if not all(math.isfinite(number.value) for number in numbers):
        return nothing, f"{name}: the result is not a finite number."
    return numbers, ""
