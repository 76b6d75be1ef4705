"""Score every hypothesis of the library at once: the gain of each signature over the present model."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.diagnosis.baseline import Problem, Term, fit_at, restricted
from studies.diagnosis.effects import Effect, Span, library
from studies.diagnosis.likelihood import KERNELS, SHARES, orthonormal
from studies.diagnosis.states import FloatArray

Draws = NDArray[np.floating[Any]]
SURVIVES = 1e-5
"""A signature of which the model absorbs all but this part of its square cannot be seen."""
LESS, MORE = 3, 1
"""Shares of the slow noise that are tried below and above that of the model alone: a signature explains noise away."""


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
    jumps : int
        How many of the last candidates are jumps.
    signs : (G,) array
        Which sign the first coefficient must have; 0 where both will do.
    """

    effects: tuple[str, ...]
    owner: np.ndarray
    shapes: tuple[tuple[float, ...], ...]
    first: FloatArray
    second: FloatArray
    pairs: np.ndarray
    whole: np.ndarray
    jumps: int
    signs: np.ndarray

    @cached_property
    def light(self) -> tuple[Draws, Draws]:
        """First columns without the jumps, and second ones, in single precision: for many draws near the noise."""
        return self.first[: len(self.first) - self.jumps].astype(np.float32), self.second.astype(np.float32)

    @cached_property
    def squares(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Squares of the first and of the second columns, and the products of both."""
        return self.first**2, self.second**2, self.first[self.pairs] * self.second


@dataclass(frozen=True)
class Candidate:
    """The best signature of one effect in a scan: twice its log-likelihood ratio, and the noise beside which it has it."""

    term: Term
    gain: float
    kernel: str


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


@dataclass(frozen=True)
class Bank:
    """The dictionary under every kind of slow noise: an effect may show only beside noise of another kind than seems
    likely without it.
    """

    problems: tuple[Problem, ...]
    dictionaries: tuple[Dictionary, ...]


def build_bank(problem: Problem, span: Span, effects: Sequence[Effect]) -> Bank:
    """Compute the signature of every effect at every shape of its grid, and rotate it into the basis of every noise."""
    signatures = _signatures(problem, span, effects)
    problems = tuple(problem if kernel == problem.kernel else restricted(problem, kernel=kernel) for kernel in KERNELS)
    return Bank(problems, tuple(_rotated(signatures, one, span) for one in problems))


def build_dictionary(problem: Problem, span: Span, effects: Sequence[Effect]) -> Dictionary:
    """Compute and rotate the signature of every effect at every shape of its grid."""
    return _rotated(_signatures(problem, span, effects), problem, span)


@dataclass(frozen=True)
class _Signatures:
    """Columns of every candidate before rotation; those of the effect `jumps` are made when they are rotated."""

    effects: tuple[str, ...]
    owner: tuple[int, ...]
    shapes: tuple[tuple[float, ...], ...]
    first: FloatArray
    second: FloatArray
    pairs: tuple[int, ...]
    whole: tuple[bool, ...]
    signs: tuple[float, ...]
    jumps: int | None


def _signatures(problem: Problem, span: Span, effects: Sequence[Effect]) -> _Signatures:
    views = problem.views(problem.tau)
    owner: list[int] = []
    shapes: list[tuple[float, ...]] = []
    firsts: list[FloatArray] = []
    seconds: list[FloatArray] = []
    pairs: list[int] = []
    whole: list[bool] = []
    signs: list[float] = []
    rising = 1.0
    if any(effect.positive and effect.acts_on == "temperature" for effect in effects):
        rising = float(np.sign(fit_at(problem, problem.tau).coefficients[1]))
    jumps: int | None = None
    for index, effect in enumerate(effects):
        if effect.name == "jump":
            jumps = index
            continue
        for shape in effect.grid(span, problem.response):
            columns = problem.term(Term(effect, tuple(shape), 2), views)
            if columns.shape[1] > 1:
                pairs.append(len(owner))
                seconds.append(columns[:, 1])
            owner.append(index)
            shapes.append(tuple(shape))
            whole.append(effect.nested or columns.shape[1] == 1)
            signs.append((rising if effect.acts_on == "temperature" else 1.0) if effect.positive else 0.0)
            firsts.append(columns[:, 0])
    empty = np.empty((problem.values.size, 0))
    return _Signatures(
        tuple(effect.name for effect in effects),
        tuple(owner),
        tuple(shapes),
        np.stack(firsts, axis=1) if firsts else empty,
        np.stack(seconds, axis=1) if seconds else empty,
        tuple(pairs),
        tuple(whole),
        tuple(signs),
        jumps,
    )


def _rotated(signatures: _Signatures, problem: Problem, span: Span) -> Dictionary:
    shapes, steps = _steps(problem, span) if signatures.jumps is not None else ([], np.empty((problem.values.size, 0)))
    first = np.concatenate([problem.basis.rotate(signatures.first), steps], axis=1)
    return Dictionary(
        signatures.effects,
        np.array([*signatures.owner, *[signatures.jumps] * len(shapes)], dtype=int),
        (*signatures.shapes, *shapes),
        np.ascontiguousarray(first.T),
        np.ascontiguousarray(problem.basis.rotate(signatures.second).T),
        np.array(signatures.pairs, dtype=int),
        np.array([*signatures.whole, *[True] * len(shapes)], dtype=bool),
        len(shapes),
        np.array([*signatures.signs, *[0.0] * len(shapes)]),
    )


def _steps(problem: Problem, span: Span) -> tuple[list[tuple[float, ...]], FloatArray]:
    """Rotated jumps at every step of every run, by cumulative sums of the rotation instead of products."""
    shapes: list[tuple[float, ...]] = []
    parts: list[FloatArray] = []
    times = [grid[mask] for grid, mask in zip(span.bins, problem.present, strict=True)]
    for run, block, begin, end, last, stays in _step_blocks(problem):
        middle = 0.5 * (times[run][1:] + times[run][:-1])
        columns = np.zeros((problem.values.size, middle.size))
        columns[begin:end] = problem.basis.steps(block)
        if stays:
            ones = np.zeros(problem.values.size)
            ones[end:last] = 1.0
            columns += problem.basis.rotate(ones)[:, None]
        parts.append(columns)
        shapes += [(float(run), float(t), float(stays)) for t in middle]
    return shapes, np.concatenate(parts, axis=1) if parts else np.zeros((problem.values.size, 0))


def _step_blocks(problem: Problem) -> Iterator[tuple[int, int, int, int, int, bool]]:
    """Yield (run, block of the basis, first row, row after it, rows of all runs, whether later runs stay up) of jumps."""
    sizes = [int(mask.sum()) for mask in problem.present]
    begins = np.concatenate([[0], np.cumsum(sizes)])
    block = -1
    for run, size in enumerate(sizes):
        block += bool(size)
        begin, end, last = int(begins[run]), int(begins[run + 1]), int(begins[-1])
        if size > 1:
            yield run, block, begin, end, last, False
            if problem.response != "bias_deg_per_h" and end < last:
                yield run, block, begin, end, last, True


def _step_products(problem: Problem, rotated: Draws, out: Draws) -> None:
    """Fill in the products of all jumps with rotated columns: sums over the rows that come later."""
    if not len(out):
        return
    unrotated = np.empty_like(rotated)
    begin = 0
    for vectors in problem.basis.vectors:
        end = begin + vectors.shape[0]
        unrotated[begin:end] = vectors.astype(rotated.dtype) @ rotated[begin:end]
        begin = end
    row = 0
    for _, _, begin, end, last, stays in _step_blocks(problem):
        later = out[row : row + end - begin - 1]
        np.cumsum(unrotated[end - 1 : begin : -1], axis=0, out=later[::-1])
        if stays:
            later += unrotated[end:last].sum(axis=0)
        row += len(later)


def scan_gains(problem: Problem, dictionary: Dictionary, model: FloatArray, targets: Draws) -> tuple[Draws, Draws]:
    """Return the likelihood gain of every candidate, with its first column alone and with both.

    Parameters
    ----------
    problem : Problem
    dictionary : Dictionary
    model : (M, p) array
        Rotated columns of the present model.
    targets : (M, B) array
        Rotated data, one or many draws; draws near the noise may come in single precision.

    Returns
    -------
    single, double : (G, B) and (P, B) arrays
        Twice the log-likelihood ratio, the noise's share profiled in both hypotheses.
    """
    floor, single, double = _scores(problem, dictionary, model, targets)
    return floor - single, floor - double


def scan_bank(
    bank: Bank, models: Sequence[FloatArray], targets: Sequence[Draws]
) -> tuple[FloatArray, np.ndarray, np.ndarray, np.ndarray]:
    """Return, for each effect and draw, the best gain under any noise over the model under the noise that suits it best.

    Parameters
    ----------
    bank : Bank
    models, targets : sequences of arrays
        As for `scan_gains`, one for each noise of the bank.

    Returns
    -------
    gains, candidates, columns, noises : (E, B) arrays
        Gain; which candidate has it, with how many columns, under which noise.
    """
    found = [
        _scores(problem, dictionary, model, target)
        for problem, dictionary, model, target in zip(bank.problems, bank.dictionaries, models, targets, strict=True)
    ]
    floor = np.min([scores[0] for scores in found], axis=0)
    best = [
        best_gains(dictionary, floor - single, floor - double)
        for dictionary, (_, single, double) in zip(bank.dictionaries, found, strict=True)
    ]
    gains = np.stack([one[0] for one in best])
    noises = np.argmax(gains, axis=0)
    picked = [np.take_along_axis(np.stack(parts), noises[None], axis=0)[0] for parts in zip(*best, strict=True)]
    return picked[0], picked[1], picked[2], noises


def _scores(
    problem: Problem, dictionary: Dictionary, model: FloatArray, targets: Draws
) -> tuple[FloatArray, Draws, Draws]:
    """Minus twice the log-likelihood of the model (B,) and of every candidate on top of it, (G, B) and (P, B)."""
    rows = targets.shape[0]
    null = np.empty((len(SHARES), targets.shape[1]))
    for k, share in enumerate(SHARES):
        root = np.sqrt(problem.basis.weights(share))[:, None]
        ortho = orthonormal(model * root)
        rest = targets * root
        rest = rest - ortho @ (ortho.T @ rest)
        null[k] = rows * np.log(np.maximum((rest**2).sum(axis=0), 1e-300)) + problem.basis.log_determinant(share)
    best = null.argmin(axis=0)
    order = np.argsort(best, kind="stable")  # draws that share their shares lie side by side
    best, targets = best[order], targets[:, order]
    single = np.full((dictionary.first.shape[0], order.size), np.inf, targets.dtype)
    double = np.full((dictionary.pairs.size, order.size), np.inf, targets.dtype)
    for k, share in enumerate(SHARES):
        near = slice(*np.searchsorted(best, [k - MORE, k + LESS + 1]))
        if near.start == near.stop:
            continue
        for into, left in zip(
            (single, double), _residuals(problem, dictionary, model, targets[:, near], share), strict=True
        ):
            np.log(left, out=left)
            left *= rows
            left += problem.basis.log_determinant(share)
            np.minimum(into[:, near], left, out=into[:, near])
    back = np.argsort(order)
    return null.min(axis=0), single[:, back], double[:, back]


def _residuals(
    problem: Problem, dictionary: Dictionary, model: FloatArray, targets: Draws, share: float
) -> tuple[Draws, Draws]:
    """Sum of squares left after adding each candidate, whitened with one share: closed form for one or two columns."""
    squares = dictionary.squares
    weight = problem.basis.weights(share)
    root = np.sqrt(weight)[:, None]
    ortho = orthonormal(model * root)
    rest = targets * root
    rest = rest - ortho @ (ortho.T @ rest)
    total = np.maximum((rest**2).sum(axis=0), 1e-300).astype(targets.dtype)
    modelled = dictionary.first @ (ortho * root)
    first, second = _products(problem, dictionary, (rest * root).astype(targets.dtype))
    signed = np.flatnonzero(dictionary.signs)
    first[signed] *= first[signed] * dictionary.signs[signed, None] > 0.0
    norm = squares[0] @ weight
    own = norm - (modelled**2).sum(axis=1)
    seen = own > SURVIVES * norm
    safe = np.where(seen, own, 1.0)
    two = second
    if dictionary.pairs.size:
        pairs = dictionary.pairs
        modelled2 = dictionary.second @ (ortho * root)
        norm2 = squares[1] @ weight
        cross = (squares[2] @ weight - (modelled[pairs] * modelled2).sum(axis=1)) / safe[pairs] * seen[pairs]
        own2 = norm2 - (modelled2**2).sum(axis=1) - cross**2 * safe[pairs]
        seen2 = own2 > SURVIVES * norm2
        two = second - cross.astype(first.dtype)[:, None] * first[pairs]
        two *= two
        two *= (seen2 / np.where(seen2, own2, 1.0)).astype(first.dtype)[:, None]
    first *= first
    first *= (seen / safe).astype(first.dtype)[:, None]
    if dictionary.pairs.size:
        two += first[pairs]
    return _left(total, first), _left(total, two)


def _left(total: Draws, explained: Draws) -> Draws:
    """What remains of the squares (in the place of what is explained), never quite nothing."""
    np.subtract(total, explained, out=explained)
    np.maximum(explained, 1e-9 * total, out=explained)
    return explained


def _products(problem: Problem, dictionary: Dictionary, rest: Draws) -> tuple[Draws, Draws]:
    """Products of the first and of the second columns with (M, B) residuals; many draws take the short way."""
    if rest.dtype != np.float32:
        return dictionary.first @ rest, dictionary.second @ rest
    first, second = dictionary.light
    out = np.empty((dictionary.first.shape[0], rest.shape[1]), rest.dtype)
    np.matmul(first, rest, out=out[: first.shape[0]])
    _step_products(problem, rest, out[first.shape[0] :])
    return out, second @ rest


def best_gains(dictionary: Dictionary, single: Draws, double: Draws) -> tuple[FloatArray, np.ndarray, np.ndarray]:
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


def scan(bank: Bank, models: Sequence[FloatArray]) -> list[Candidate]:
    """Return the best candidate of every effect on the data, the strongest gain first.

    Parameters
    ----------
    bank : Bank
    models : sequence of (M, p) arrays
        Rotated columns of the present model, one for each noise of the bank.
    """
    gains, where, number, noises = scan_bank(bank, models, [problem.rotated[:, None] for problem in bank.problems])
    effects = library()
    first = bank.dictionaries[0]
    found = [
        Candidate(
            Term(effects[name], first.shapes[where[k, 0]], int(number[k, 0])),
            float(gains[k, 0]),
            bank.problems[noises[k, 0]].kernel,
        )
        for k, name in enumerate(first.effects)
        if (first.owner == k).any()
    ]
    return sorted(found, key=lambda candidate: -candidate.gain)
