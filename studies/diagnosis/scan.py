"""Score every hypothesis of the library at once: the gain of each signature over the present model."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from studies.diagnosis.baseline import Problem, Term
from studies.diagnosis.effects import Effect, Span, library
from studies.diagnosis.likelihood import SHARES, orthonormal, profile_shares
from studies.diagnosis.states import FloatArray

SURVIVES = 1e-5
"""A signature of which the model absorbs all but this part of its square cannot be seen."""


@dataclass(frozen=True)
class Dictionary:
    """Rotated signatures of every candidate: one or two columns each.

    Attributes
    ----------
    effects : tuple of str
        Names, one an effect.
    owner : (G,) int array
        Which effect a candidate belongs to.
    shapes : tuple
        Shape of each candidate.
    first, second : (G, M) arrays
        Rotated columns; `second` only where `pairs` points.
    pairs : (P,) int array
        Candidates that have a second column, in the order of `second`.
    whole : (G,) bool array
        Candidates that make sense with the first column alone.
    """

    effects: tuple[str, ...]
    owner: np.ndarray
    shapes: tuple[tuple[float, ...], ...]
    first: FloatArray
    second: FloatArray
    pairs: np.ndarray
    whole: np.ndarray

    @cached_property
    def squares(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Squares of the first and of the second columns, and the products of both."""
        return self.first**2, self.second**2, self.first[self.pairs] * self.second


@dataclass(frozen=True)
class Candidate:
    """The best signature of one effect in a scan: twice its log-likelihood ratio, and what survives the model."""

    term: Term
    gain: float
    survives: float


def applicable(problem: Problem, effects: Sequence[Effect] | None = None) -> list[Effect]:
    """Return the effects that act on the response and whose drives are measured and vary."""
    chosen = list(library().values()) if effects is None else list(effects)
    return [
        effect
        for effect in chosen
        if problem.response in effect.responses
        and all(_varies(problem, drive) for drive in effect.needs)
        and (effect.acts_on != "temperature" or problem.response == "frequency_Hz")
    ]


def _varies(problem: Problem, drive: str) -> bool:
    parts = [getattr(s, drive) for s in problem.states]
    if any(part is None for part in parts):
        return False
    values = np.concatenate(parts)
    return bool(np.ptp(values) > 1e-6 * max(float(np.abs(values).max()), 1e-300))


def build_dictionary(problem: Problem, span: Span, effects: Sequence[Effect]) -> Dictionary:
    """Compute and rotate the signature of every effect at every shape of its grid."""
    views = problem.views(problem.tau)
    names: list[str] = []
    owner: list[int] = []
    shapes: list[tuple[float, ...]] = []
    firsts: list[FloatArray] = []
    seconds: list[FloatArray] = []
    pairs: list[int] = []
    whole: list[bool] = []
    steps: list[FloatArray] = []
    for effect in effects:
        index = len(names)
        names.append(effect.name)
        if effect.name == "jump":
            step_shapes, columns = _steps(problem, span)
            steps.append(columns)
            owner += [index] * len(step_shapes)
            shapes += step_shapes
            whole += [True] * len(step_shapes)
            firsts += [np.empty(0)] * len(step_shapes)
            continue
        for shape in effect.grid(span, problem.response):
            columns = problem.term(Term(effect, tuple(shape), 2), views)
            if columns.shape[1] > 1:
                pairs.append(len(owner))
                seconds.append(columns[:, 1])
            owner.append(index)
            shapes.append(tuple(shape))
            whole.append(effect.nested or columns.shape[1] == 1)
            firsts.append(columns[:, 0])
    rows = problem.values.size
    first = np.zeros((len(owner), rows))
    filled = np.array([column.size > 0 for column in firsts], dtype=bool)
    if filled.any():
        first[filled] = problem.basis.rotate(np.stack([c for c in firsts if c.size], axis=1)).T
    if steps:
        first[~filled] = np.concatenate(steps, axis=1).T
    second = problem.basis.rotate(np.stack(seconds, axis=1)).T if seconds else np.zeros((0, rows))
    return Dictionary(
        tuple(names),
        np.array(owner),
        tuple(shapes),
        first,
        np.ascontiguousarray(second),
        np.array(pairs, dtype=int),
        np.array(whole, dtype=bool),
    )


def _steps(problem: Problem, span: Span) -> tuple[list[tuple[float, ...]], FloatArray]:
    """Rotated jumps at every step of every run, by cumulative sums of the rotation instead of products."""
    shapes: list[tuple[float, ...]] = []
    parts: list[FloatArray] = []
    lasting = (False, True) if problem.response != "bias_deg_per_h" else (False,)
    sizes = [int(mask.sum()) for mask in problem.present]
    begins = np.concatenate([[0], np.cumsum(sizes)])
    block = -1
    for run, (grid, mask) in enumerate(zip(span.bins, problem.present, strict=True)):
        if not mask.any():
            continue
        block += 1
        if sizes[run] < 2:
            continue
        times = grid[mask]
        middle = 0.5 * (times[1:] + times[:-1])
        own = problem.basis.steps(block)
        for stays in lasting:
            later = problem.values.size - begins[run + 1]
            if stays and later == 0:
                continue
            columns = np.zeros((problem.values.size, middle.size))
            columns[begins[run] : begins[run + 1]] = own
            if stays:
                ones = np.zeros(problem.values.size)
                ones[begins[run + 1] :] = 1.0
                columns += problem.basis.rotate(ones)[:, None]
            parts.append(columns)
            shapes += [(float(run), float(t), float(stays)) for t in middle]
    return shapes, np.concatenate(parts, axis=1) if parts else np.zeros((problem.values.size, 0))


def scan_gains(
    problem: Problem, dictionary: Dictionary, model: FloatArray, targets: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the likelihood gain of every candidate, with its first column alone and with both.

    Parameters
    ----------
    problem : Problem
    dictionary : Dictionary
    model : (M, p) array
        Rotated columns of the present model.
    targets : (M, B) array
        Rotated data, one or many draws.

    Returns
    -------
    single, double : (G, B) and (P, B) arrays
        Twice the log-likelihood ratio, the noise's share profiled in both hypotheses.
    """
    rows = targets.shape[0]
    null = np.empty((len(SHARES), targets.shape[1]))
    for k, share in enumerate(SHARES):
        root = np.sqrt(problem.basis.weights(share))[:, None]
        ortho = orthonormal(model * root)
        rest = targets * root
        rest = rest - ortho @ (ortho.T @ rest)
        null[k] = rows * np.log(np.maximum((rest**2).sum(axis=0), 1e-300)) + problem.basis.log_determinant(share)
    shares = profile_shares(np.median(null - null.min(axis=0), axis=1))
    single = np.full((dictionary.first.shape[0], targets.shape[1]), np.inf)
    double = np.full((dictionary.pairs.size, targets.shape[1]), np.inf)
    for share in shares:
        one, two = _residuals(problem, dictionary, model, targets, share)
        log_determinant = problem.basis.log_determinant(share)
        np.minimum(single, rows * np.log(one) + log_determinant, out=single)
        np.minimum(double, rows * np.log(two) + log_determinant, out=double)
    floor = null.min(axis=0)
    return floor - single, floor - double


def _residuals(
    problem: Problem, dictionary: Dictionary, model: FloatArray, targets: FloatArray, share: float
) -> tuple[FloatArray, FloatArray]:
    """Sum of squares left after adding each candidate, whitened with one share: closed form for one or two columns."""
    squares = dictionary.squares
    weight = problem.basis.weights(share)
    root = np.sqrt(weight)[:, None]
    ortho = orthonormal(model * root)
    rest = targets * root
    rest = rest - ortho @ (ortho.T @ rest)
    total = np.maximum((rest**2).sum(axis=0), 1e-300)
    beside = np.concatenate([rest, ortho], axis=1) * root
    draws = targets.shape[1]
    first = dictionary.first @ beside
    norm = squares[0] @ weight
    own = norm - (first[:, draws:] ** 2).sum(axis=1)
    seen = own > SURVIVES * norm
    safe = np.where(seen, own, 1.0)
    one = first[:, :draws] ** 2 / safe[:, None] * seen[:, None]
    left = np.maximum(total - one, 1e-9 * total)
    if not dictionary.pairs.size:
        return left, np.empty((0, draws))
    pairs = dictionary.pairs
    second = dictionary.second @ beside
    norm2 = squares[1] @ weight
    cross = squares[2] @ weight - (first[pairs, draws:] * second[:, draws:]).sum(axis=1)
    own2 = norm2 - (second[:, draws:] ** 2).sum(axis=1) - cross**2 / safe[pairs] * seen[pairs]
    seen2 = own2 > SURVIVES * norm2
    projected = second[:, :draws] - (cross / safe[pairs] * seen[pairs])[:, None] * first[pairs, :draws]
    two = one[pairs] + projected**2 / np.where(seen2, own2, 1.0)[:, None] * seen2[:, None]
    return left, np.maximum(total - two, 1e-9 * total)


def best_gains(
    dictionary: Dictionary, single: FloatArray, double: FloatArray
) -> tuple[FloatArray, np.ndarray, np.ndarray]:
    """Return, for each effect and draw, the best gain, the candidate that has it, and its number of columns.

    A second column of a nested effect must pay for itself: it counts only with PAIR_PRICE taken off.
    """
    count, draws = len(dictionary.effects), single.shape[1]
    value = np.where(dictionary.whole[:, None], single, -np.inf)
    columns = np.ones(value.shape, dtype=int)
    if dictionary.pairs.size:
        pairs = dictionary.pairs
        price = np.where(dictionary.whole[pairs], PAIR_PRICE, 0.0)[:, None]
        better = double - price > value[pairs]
        value[pairs] = np.where(better, double - price, value[pairs])
        columns[pairs] = np.where(better, 2, columns[pairs])
    gains = np.zeros((count, draws))
    where = np.zeros((count, draws), dtype=int)
    number = np.zeros((count, draws), dtype=int)
    for k in range(count):
        members = np.flatnonzero(dictionary.owner == k)
        if members.size == 0:
            continue
        pick = members[np.argmax(value[members], axis=0)]
        gains[k] = value[pick, np.arange(draws)]
        where[k], number[k] = pick, columns[pick, np.arange(draws)]
    return gains, where, number


PAIR_PRICE = 4.0


def scan(problem: Problem, dictionary: Dictionary, model: FloatArray) -> list[Candidate]:
    """Return the best candidate of every effect on the data, the strongest gain first."""
    single, double = scan_gains(problem, dictionary, model, problem.rotated[:, None])
    gains, where, number = best_gains(dictionary, single, double)
    effects = library()
    found = [
        Candidate(Term(effects[name], dictionary.shapes[where[k, 0]], int(number[k, 0])), float(gains[k, 0]), 0.0)
        for k, name in enumerate(dictionary.effects)
        if (dictionary.owner == k).any()
    ]
    return sorted(found, key=lambda candidate: -candidate.gain)
