"""Score every hypothesis of the library at once: the gain of each signature over the present model."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from studies.diagnosis.baseline import Problem, Term, restricted
from studies.diagnosis.effects import Effect, Span, library
from studies.diagnosis.likelihood import KERNELS, SHARES, orthonormal, profile_shares
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
    jumps: int | None


def _signatures(problem: Problem, span: Span, effects: Sequence[Effect]) -> _Signatures:
    views = problem.views(problem.tau)
    owner: list[int] = []
    shapes: list[tuple[float, ...]] = []
    firsts: list[FloatArray] = []
    seconds: list[FloatArray] = []
    pairs: list[int] = []
    whole: list[bool] = []
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
    floor, single, double = _scores(problem, dictionary, model, targets)
    return floor - single, floor - double


def scan_bank(
    bank: Bank, models: Sequence[FloatArray], targets: Sequence[FloatArray]
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
    problem: Problem, dictionary: Dictionary, model: FloatArray, targets: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Minus twice the log-likelihood of the model (B,) and of every candidate on top of it, (G, B) and (P, B)."""
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
    return null.min(axis=0), single, double


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
