"""Forward and backward selection of regression terms, with every step on record.

HRG paper section 4.1: the term with the strongest evidence enters while its p-value is below the entry level, and
leaves when a later one makes its p-value rise above the removal level. As in the best-known tools the levels are
0.05 and 0.10, and a term enters only after the lower-order terms that it contains, so that the chosen model does not
depend on the zero from which frequency is counted. p-values after a search are optimistic: judge on held-out data.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.errors import CompensationError

ENTER, REMOVE = 0.05, 0.10
# A candidate of which less than this part is not already in the model cannot be told apart from it.
OWN_PART = 1e-7


@dataclass(frozen=True)
class SelectionStep:
    """One step: the `term` added (or removed), its F and p, the model it leaves, and BIC = m ln(SSE/m) + p ln m."""

    added: bool
    term: str
    F: float
    p_value: float
    sum_of_squares: float
    criterion: float
    terms: tuple[str, ...]


@dataclass(frozen=True)
class StepwiseSelection:
    """The path of a stepwise selection, its final `terms`, and the candidates that are `constant`, which can never enter."""

    start: SelectionStep
    steps: tuple[SelectionStep, ...]
    terms: tuple[str, ...]
    constant: tuple[str, ...]


def select_stepwise(
    forced: Array, candidates: Array, y: Array, names: Sequence[str],
    parents: Mapping[str, Sequence[str]] | None = None, *, shared: bool = False,
) -> StepwiseSelection:  # fmt: skip
    """Select candidate columns by partial F-tests after the forced ones and a term's parents; `shared`: candidates share the level."""
    m, q = forced.shape
    if m < q + len(names) + 1:
        raise CompensationError(f"{len(names)} candidate terms and {q} constants need at least {q + len(names) + 1} rows, not {m}; record longer or average less.")  # fmt: skip
    search = _Search(forced, candidates, y, tuple(names), parents or {})
    constant = tuple(name for name in names if search.own_part([], name) < OWN_PART)
    chosen: list[str] = []
    steps: list[SelectionStep] = []
    for _ in range(10 * len(names)):
        step = search.addition(chosen, constant, shared) or search.removal(chosen)
        if step is None:
            break
        steps.append(step)
        chosen = list(step.terms)
        while (step := search.removal(chosen)) is not None:
            steps.append(step)
            chosen = list(step.terms)
    start = search.step(True, "", math.nan, math.nan, [])
    return StepwiseSelection(start, tuple(steps), tuple(sorted(chosen, key=list(names).index)), constant)


class _Search:
    """Sums of squares of any subset of columns, from one triangular factor of all of them."""

    def __init__(
        self, forced: Array, candidates: Array, y: Array, names: tuple[str, ...], parents: Mapping[str, Sequence[str]]
    ) -> None:
        Z = np.column_stack([forced, candidates, y])
        self.lengths = np.linalg.norm(candidates, axis=0)
        self.R: Array = np.asarray(scipy.linalg.qr(Z, mode="r")[0][: Z.shape[1]], dtype=np.float64)
        self.rows, self.forced = forced.shape
        self.names = names
        self.parents = parents
        self.known: dict[tuple[str, ...], Array] = {}  # orthonormal columns of the subsets that were asked for

    def sum_of_squares(self, chosen: Sequence[str]) -> float:
        """Residual sum of squares of y on the forced columns and the chosen ones."""
        rest = self._residual(chosen, self.R[:, -1])
        return float(rest @ rest)

    def addition(self, chosen: Sequence[str], constant: Sequence[str], shared: bool) -> SelectionStep | None:
        """Return the step that adds the candidate with the largest F, if its p-value is below the level."""
        ready = [
            name
            for name in self.names
            if name not in (known := {*chosen, *constant})
            and known.issuperset(self.parents.get(name, ()))
            and self.own_part(chosen, name) > OWN_PART
        ]
        tests = [(*self._test(chosen, [*chosen, name]), name) for name in ready]
        if not tests:
            return None
        F, p, name = max(tests)
        allowed = ENTER / len(ready) if shared else ENTER
        return self.step(True, name, F, p, [*chosen, name]) if p < allowed else None

    def removal(self, chosen: Sequence[str]) -> SelectionStep | None:
        """Return the step that removes the term with the smallest F, if its p-value is above the level."""
        free = [n for n in chosen if not any(n in self.parents.get(other, ()) for other in chosen)]
        tests = [(*self._test([c for c in chosen if c != name], chosen), name) for name in free]
        if not tests:
            return None
        F, p, name = min(tests)
        return self.step(False, name, F, p, [c for c in chosen if c != name]) if p > REMOVE else None

    def step(self, added: bool, term: str, F: float, p: float, terms: Sequence[str]) -> SelectionStep:
        """Describe the model that a step leaves."""
        sse = self.sum_of_squares(terms)
        size = self.forced + len(terms)
        criterion = self.rows * math.log(max(sse, 1e-300) / self.rows) + size * math.log(self.rows)
        return SelectionStep(added, term, F, p, sse, criterion, tuple(terms))

    def _test(self, small: Sequence[str], large: Sequence[str]) -> tuple[float, float]:
        without, within = self.sum_of_squares(small), self.sum_of_squares(large)
        freedom = self.rows - self.forced - len(large)
        F = max(without - within, 0.0) / max(within / freedom, 1e-300)
        return F, float(scipy.special.fdtrc(1, freedom, F))

    def own_part(self, chosen: Sequence[str], name: str) -> float:
        """Part of a candidate's length that neither the forced columns nor the chosen ones have: 0 of none."""
        k = self.names.index(name)
        rest = self._residual(chosen, self.R[:, self.forced + k])
        return float(np.linalg.norm(rest) / max(self.lengths[k], 1e-300))

    def _residual(self, chosen: Sequence[str], target: Array) -> Array:
        if (key := tuple(chosen)) not in self.known:
            index = [*range(self.forced), *(self.forced + self.names.index(name) for name in chosen)]
            self.known[key] = np.asarray(scipy.linalg.qr(self.R[:, index], mode="economic")[0], dtype=np.float64)
        Q = self.known[key]
        return np.asarray(target - Q @ (Q.T @ target))
