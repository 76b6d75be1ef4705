"""Searches beyond the sampled designs, the worst case over a box and the tolerances to ask for; each design looked at is kept."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from compensation.arrays import Array
from studies.progress import Progress
from studies.sweeps.block import Batch, Row, decode, each_design
from studies.sweeps.definition import Study, StudyParameter
from studies.sweeps.design import draw, nominal_row
from studies.sweeps.engine import BATCH_VECTORISED, compute
from studies.sweeps.evaluate import WorkPlan
from studies.sweeps.keys import MOST_CORNERS, Search, ToleranceSearch, WorstCase
from studies.sweeps.store import Store
from studies.sweeps.tolerance import place_limits
from studies.sweeps.workers import Workers

STEP = 1e-2  # of a range, for differences: large against the solver's noise
MOST_FACTORS = 20  # factors of the tolerances that are tried


class SearchFailed(RuntimeError):
    """A design that the search needs could not be computed."""


class Explorer:
    """Designs of a study, rows as in its design, computed when the store lacks them."""

    def __init__(
        self, study: Study, plan: WorkPlan, workers: Workers, store: Store, progress: Progress | None = None
    ) -> None:
        self.study, self.plan, self.workers, self.store = study, plan, workers, store
        self.progress = progress or Progress()  # that shows nothing
        self.columns = [column.name for column in study.columns]

    def cases(self, designs: Array) -> list[Row]:
        """Return designs as the store has them, after computing those that lack."""
        lacking = {design.tobytes(): design for design in designs if self.store.find(design) is None}
        if lacking:
            rows, size = np.array(list(lacking.values())), BATCH_VECTORISED if self.plan.families else 1
            parts = np.split(rows, range(size, len(rows), size))
            batches = deque(Batch(np.full(len(part), -1), part) for part in parts)
            compute(self.plan, batches, self.workers, self.store, self.progress)
        found = [self.store.find(design) for design in designs]
        return [case for case in found if case is not None]

    def values(self, designs: Array, columns: Sequence[str]) -> Array:
        """Return columns of designs, shape (designs, columns); SearchFailed names a design that cannot be computed."""
        cases = self.cases(designs)
        values = np.array([case.values for case in cases])[:, [self.columns.index(column) for column in columns]]
        for design, case, row in zip(designs, cases, values, strict=True):
            if not np.isfinite(row).all():
                raise SearchFailed(f"at {self.name(design)}: {case.remark}")
        return values

    def name(self, design: Array) -> dict[str, Any]:
        """Return the parameters of a design by name."""
        return each_design(decode(self.plan.coding, design[None]), 1)[0]


def run_searches(study: Study, plan: WorkPlan, workers: Workers, store: Store) -> None:
    """Compute the nominal design and every search of a study, and keep what they find."""
    explorer = Explorer(study, plan, workers, store)
    explorer.cases(nominal_row(study)[None])
    for search in study.searches:
        try:
            found = SEARCHES[search.kind](explorer, search)
        except SearchFailed as error:
            found = {"failed": str(error)}
        store.keep_finding(name_search(search), {"kind": search.kind, **found})


def name_search(search: Search) -> str:
    """Return the name under which a search's outcome is kept."""
    if isinstance(search, ToleranceSearch):
        return f"tolerances of {', '.join(search.vary)} that {100 * search.share:g} % keep"
    assert isinstance(search, WorstCase)
    return f"extremes of {search.column}"


def find_worst_case(explorer: Explorer, search: WorstCase) -> dict[str, Any]:
    """Find the extremes of a column over the box of all numeric parameters, by a bounded quasi-Newton search from the best corner."""
    from scipy.optimize import minimize

    study = explorer.study
    free = [p for p in study.parameters if not isinstance(p.nominal, str)]
    starts = _starts(free)
    at_starts = explorer.values(_place(study, free, starts), [search.column])[:, 0]
    found: dict[str, Any] = {"column": search.column, "designs": len(starts)}
    for name, sign in (("least", 1.0), ("greatest", -1.0)):
        best = int(np.argmin(sign * at_starts))
        scale = sign / (float(np.ptp(at_starts)) or 1.0)

        def value(x: Array, scale: float = scale) -> float:
            return float(scale * explorer.values(_place(study, free, x[None]), [search.column])[0, 0])

        def slope(x: Array, scale: float = scale) -> Array:
            steps = STEP * np.eye(len(free))
            pairs = np.clip(np.stack([x - steps, x + steps], axis=1), 0.0, 1.0)
            values = explorer.values(_place(study, free, pairs.reshape(-1, len(free))), [search.column])
            return np.asarray(scale * (values[1::2, 0] - values[::2, 0]) / np.diag(pairs[:, 1] - pairs[:, 0]))

        box = [(0.0, 1.0)] * len(free)
        outcome = minimize(value, starts[best], jac=slope, method="L-BFGS-B", bounds=box, options={"maxfun": 200})
        x = outcome.x if outcome.fun < scale * at_starts[best] else starts[best]
        design = _place(study, free, x[None])
        value_there = float(explorer.values(design, [search.column])[0, 0])
        found[name] = {"value": value_there, "parameters": explorer.name(design[0])}
    return found


def find_tolerance(explorer: Explorer, search: ToleranceSearch) -> dict[str, Any]:
    """Find by which factor tolerances may be wider, or must be narrower, for a share of designs to meet the requirements, with an interval."""
    from scipy.stats import binom

    study = explorer.study
    nominal, drawn = nominal_row(study), draw(study)
    varied = np.array([p.name in search.vary for p in study.parameters])
    columns = [requirement.column for requirement in study.requirements]
    middle = explorer.values(nominal[None], columns)[0]
    limits = [one.limits(float(value)) for one, value in zip(study.requirements, middle, strict=True)]
    for column, value, (low, high) in zip(columns, middle, limits, strict=True):
        if not low <= value <= high:
            raise SearchFailed(f"the nominal design itself has {column} = {value:g}, beyond its limits")
    count, factor, bounds = len(drawn), 1.0, [0.0, np.inf]
    for _ in range(MOST_FACTORS):
        values = explorer.values(np.where(varied, nominal + factor * (drawn - nominal), drawn), columns)
        used = np.max([place_limits(*one) for one in zip(values.T, middle, *np.transpose(limits), strict=True)], axis=0)
        used = np.sort(used)
        passed = int((used <= 1).sum())
        rank = min(int(np.ceil(search.share * count)), count) - 1
        if not used[rank] > 0:
            raise SearchFailed("the designs never reach their limits, however wide the tolerances")
        bounds[0 if used[rank] <= 1 else 1] = factor
        if abs(used[rank] - 1) < 1e-3 or bounds[1] - bounds[0] < 1e-3 * factor:
            break
        proposed = factor / float(used[rank])
        inside = bounds[0] < proposed < bounds[1]
        factor = proposed if inside else (bounds[0] + min(bounds[1], 4 * factor)) / 2
    ends = binom(count, search.share).ppf([0.05, 0.95])
    low, high = (factor / float(used[int(np.clip(end, 0, count - 1))]) for end in (ends[1], ends[0]))
    return {
        "share": search.share,
        "factor": factor,
        "low": low,
        "high": high,
        "passed": passed,
        "cases": count,
        "limits": {
            c: [float(end) if np.isfinite(end) else None for end in ends_]
            for c, ends_ in zip(columns, limits, strict=True)
        },
        "tolerances": [_tolerance(p, factor) for p in study.parameters if p.name in search.vary],
    }


def _tolerance(parameter: StudyParameter, factor: float) -> dict[str, Any]:
    middle = float(parameter.nominal)
    if parameter.standard_deviation is not None:
        return {"name": parameter.name, "standard_deviation": factor * parameter.standard_deviation}
    ends = [middle + factor * (end - middle) for end in (parameter.low, parameter.high)]
    return {"name": parameter.name, "low": ends[0], "high": ends[1]}


SEARCHES: Mapping[str, Callable[..., dict[str, Any]]] = {"worst-case": find_worst_case, "tolerance": find_tolerance}


def _starts(free: Sequence[StudyParameter]) -> Array:
    """Return the middle and the corners of the unit box; with many parameters the middles of its faces instead."""
    d = len(free)
    widths = [(p.high - p.low) or 1.0 for p in free]  # or 1: of one that does not vary
    middle = np.array([(float(p.nominal) - p.low) / width for p, width in zip(free, widths, strict=True)])
    if d <= MOST_CORNERS:
        return np.array([middle, *(np.array(corner) for corner in product((0.0, 1.0), repeat=d))])
    faces = [np.where(np.arange(d) == k, end, middle) for k in range(d) for end in (0.0, 1.0)]
    return np.array([middle, *faces])


def _place(study: Study, free: Sequence[StudyParameter], shares: Array) -> Array:
    """Return designs at shares 0 ... 1 of the free parameters' ranges, array (m, free); the others are nominal."""
    designs = np.tile(nominal_row(study), (len(shares), 1))
    for p, share in zip(free, shares.T, strict=True):
        designs[:, study.names.index(p.name)] = p.low + share * (p.high - p.low)
    return designs
