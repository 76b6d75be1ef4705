"""Search over effects: the model of all responses grows by the effect that adds most evidence, as long as that pays its price.

Every effect is looked at in all shapes of its grid at once; the nearest contenders are refitted, each with shape, size and noise of its
own. Log posteriors are those of `model`, with the prior of an effect, the mean over its shapes and the mean over its sizes.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from compensation.noise import Noise, white_rms
from studies.effects import Effect, Parameter
from studies.inference.model import PRICE, Background, Linear, Term, estimate_noise_of
from studies.inference.signatures import Signatures

Array = NDArray[np.float64]
MOST_SHAPES = 400
"""Of an effect; of a larger grid every second, third, … of the shapes that differ only in what a fit moves."""
FEW, LEADING, WIDTH = 40, 0.4, 4
"""Of effects with more shapes than FEW only the leading columns are scanned: those with a prior of at least this part of the widest."""
LESS = (0.1, 0.01)
"""Of the slow noise of a response: what an effect has been taken for until it is named."""
MOST_TERMS, CONTENDERS = 4, 5
MARGIN, UNSTATED, FURTHER = 4.0, 1.0, 0.06
"""Log posterior that a cause must bring, and more where no card states the noise; part of what others explain of its response that it must bring besides."""
NEAR = 0.35, 15.0
"""Part of the best scan, less so much, down to which contenders are refitted."""
HOPELESS, FINITE = -3.0, 1e3
MOVES, EDGE = 3, 0.05
"""Most moves of a shape parameter to the next shapes of its grid, and the part of a move from whose end it goes on."""
SUSPICIOUS, SUSPECTS = 3.0, 2
"""Slow noise within a run over that of a row, from which on effects are tried with values of their own, and how many."""
Report = Callable[[str], None]


@dataclass(frozen=True)
class Shapes:
    """All shapes of an effect with the same members: the columns that are scanned."""

    effect: Effect
    response: str
    shapes: tuple[tuple[float, ...], ...]
    members: tuple[int, ...]
    columns: Mapping[str, Array]
    """response -> (M, H, k)"""
    count: int
    """Shapes of the whole grid."""


@dataclass(frozen=True)
class Seen:
    """What a scan sees of one effect: log evidence over all shapes, the best of them, its scale, and the noise beside it."""

    gain: float
    best: float
    term: Term
    noise: Mapping[str, Noise]


@dataclass(frozen=True)
class Hypothesis:
    """A model with its noise; `score` is its log posterior up to a constant."""

    terms: tuple[Term, ...]
    noise: Mapping[str, Noise]
    evidence: float

    @property
    def score(self) -> float:
        """Log evidence and the prices of the terms."""
        return self.evidence + sum(term.price for term in self.terms)


@dataclass(frozen=True)
class Outcome:
    """The model without effects, the best one, and for each of its terms the rivals that could stand there, best first."""

    plain: Hypothesis
    final: Hypothesis
    rivals: tuple[tuple[Hypothesis, ...], ...]
    without: tuple[Hypothesis, ...]


class Search:
    """The search in one linearised campaign."""

    def __init__(
        self,
        linear: Linear,
        signatures: Signatures,
        noise: Mapping[str, Noise],
        bank: Sequence[Shapes] | None = None,
        progress: Report = lambda _: None,
    ) -> None:
        self.linear, self.signatures, self.noise, self.progress = linear, signatures, noise, progress
        self.bank = self.shapes_of(signatures.applicable()) if bank is None else bank

    def shapes_of(self, effects: Iterable[tuple[Effect, str]]) -> list[Shapes]:
        """Return the columns of all shapes of some effects."""
        found = []
        for effect, response in effects:
            grid = [tuple(shape) for shape in effect.grid(self.signatures.span, response)]
            chosen = _chosen(effect, grid)
            groups: dict[tuple[int, ...], list[tuple[tuple[float, ...], dict[str, Array]]]] = {}
            first = _leading(effect, len(grid))
            for shape in chosen:
                columns = self.signatures.columns(effect, shape, response)
                there = np.any([np.any(own != 0, axis=0) for own in columns.values()], axis=0)
                members = tuple(k for k in first if there[k])
                if members:
                    kept = {name: own[:, members] for name, own in columns.items()}
                    groups.setdefault(members, []).append((shape, kept))
            for members, own in groups.items():
                stacked = {name: np.stack([columns[name] for _, columns in own], axis=1) for name in own[0][1]}
                found.append(Shapes(effect, response, tuple(shape for shape, _ in own), members, stacked, len(grid)))
        return found

    def unit(self, effect: Effect, response: str, members: Sequence[int]) -> Array:
        """Prior standard deviations of members in a strong case."""
        return np.asarray(effect.spread[list(members)] * self.signatures.size(effect, response))

    def term(self, effect: Effect, response: str, shape: tuple[float, ...], price: float = PRICE) -> Term:
        """Return a term with all members of the effect that have a prior."""
        members = tuple(int(k) for k in np.flatnonzero(effect.spread > 0))
        starts = self.signatures.remembers(effect, shape)
        columns = self.signatures.of_term(effect, shape, response, members, starts)
        unit = self.unit(effect, response, members)
        if starts:
            unit = np.append(unit, np.full(len(self.linear.problem.runs), unit[0]))
        return Term(effect, response, shape, columns, members, unit, 1.0, price)

    def gains(self, beside: Background, own: Shapes) -> Array:
        """Return what an effect adds to the evidence beside a model, for each of SCALES and of its shapes."""
        units = np.broadcast_to(self.unit(own.effect, own.response, own.members), (len(own.shapes), len(own.members)))
        return beside.gains(own.columns, units, own.effect)

    def scan(self, now: Hypothesis, bank: Sequence[Shapes] | None = None, less: Sequence[float] = LESS) -> list[Seen]:
        """Return what every effect adds to a model, the strongest first, with its noise and with less slow noise of a response."""
        bank = self.bank if bank is None else bank
        taken = {term.key for term in now.terms}
        open_ = [own for own in bank if (own.effect.name, own.response) not in taken]
        plain = Background(self.linear, now.terms, now.noise)
        found: dict[tuple[str, str], dict[tuple[float, ...], tuple[float, Shapes, int, Mapping[str, Noise]]]] = {}
        for name, noise in [("", now.noise), *self._quieter(now, less)]:
            beside = plain if not name else Background(self.linear, now.terms, noise)
            behind = beside.evidence - plain.evidence
            for own in open_:
                if name and name != own.response:
                    continue
                gain = scipy.special.logsumexp(self.gains(beside, own), axis=0) - np.log(10) + behind
                best = found.setdefault((own.effect.name, own.response), {})
                for k, shape in enumerate(own.shapes):
                    if np.isfinite(gain[k]) and (shape not in best or gain[k] > best[shape][0]):
                        best[shape] = (float(gain[k]), own, k, noise)
        out = []
        for shapes in found.values():
            if not shapes:
                continue
            gains = np.array([value[0] for value in shapes.values()])
            top, own, k, noise = max(shapes.values(), key=lambda value: value[0])
            # chosen shapes stand for the whole grid
            total = float(scipy.special.logsumexp(gains) - np.log(len(gains)))
            term = self.term(own.effect, own.response, own.shapes[k], PRICE + min(total - top, 0.0))
            out.append(Seen(total, top, term, noise))
        return sorted(out, key=lambda seen: -seen.gain)

    def settle(self, terms: tuple[Term, ...], noise: Mapping[str, Noise], names: Sequence[str] = ()) -> Hypothesis:
        """Return the model with noise of its own and the last term at its likeliest scale."""
        noise = estimate_noise_of(self.linear, terms, noise, names)
        if not terms:
            return Hypothesis((), noise, Background(self.linear, (), noise).evidence)
        beside = Background(self.linear, terms[:-1], noise)
        last, gain = beside.with_term(terms[-1])
        return Hypothesis((*terms[:-1], last), noise, beside.evidence + gain)

    def polish(self, beside: Background, term: Term, anew: bool = True) -> Term:
        """Move a shape to where the evidence is largest: among those that it stands for, then between the next ones.

        Not `anew`, only the latter: after values of the card have moved.
        """
        effect, span = term.effect, self.signatures.span
        grid = [tuple(shape) for shape in effect.grid(span, term.response)]
        around = _passed(effect, grid, term.shape) if len(grid) > MOST_SHAPES else []
        if effect.near is not None:
            grid = [tuple(shape) for shape in effect.near(span, term.response, term.shape)]
            around = grid[:: -(-len(grid) // MOST_SHAPES)]
        best: dict[tuple[float, ...], tuple[float, Term]] = {}
        for one in [term, *(self._moved(term, shape) for shape in around if anew)]:
            series, gain = _steady(effect, one.shape), beside.with_term(one)[1]
            if series not in best or gain > best[series][0]:
                best[series] = (gain, one)
        tried = [self._between_shapes(beside, one, gain, grid) for gain, one in best.values()]
        return max(tried, key=lambda found: found[0])[1]

    def _between_shapes(
        self, beside: Background, term: Term, best: float, grid: Sequence[tuple[float, ...]]
    ) -> tuple[float, Term]:
        """Move the free parameters of a shape, one after another, between the next shapes of its series."""
        effect = term.effect
        series = np.array([shape for shape in grid if _steady(effect, shape) == _steady(effect, term.shape)] or grid)
        for k, parameter in enumerate(effect.shape):
            for _ in range(MOVES):
                if not parameter.moves(term.shape[k]):
                    break
                low, high = self._between(series[:, k], term.shape[k], parameter)
                if high <= low or not np.isfinite(best):
                    break
                logarithmic = parameter.logarithmic and low > 0
                start = term

                def at(x: float, k: int = k, logarithmic: bool = logarithmic, start: Term = start) -> Term:
                    value = float(np.exp(x)) if logarithmic else float(x)
                    return self._moved(start, (*start.shape[:k], value, *start.shape[k + 1 :]))

                ends = (np.log(low), np.log(high)) if logarithmic else (low, high)
                lowest = scipy.optimize.minimize_scalar(
                    lambda x, at=at, least=best - FINITE: -max(beside.with_term(at(x))[1], least),
                    bounds=ends,
                    method="bounded",
                    options={"maxiter": 10},
                )
                if -lowest.fun <= best:
                    break
                best, term = float(-lowest.fun), at(lowest.x)
                if ends[0] + EDGE * (ends[1] - ends[0]) < lowest.x < ends[1] - EDGE * (ends[1] - ends[0]):
                    break
        return best, term

    def _moved(self, term: Term, shape: tuple[float, ...]) -> Term:
        return replace(self.term(term.effect, term.response, shape, term.price), scale=term.scale, bend=term.bend)

    def _between(self, grid: Array, at: float, parameter: Parameter) -> tuple[float, float]:
        """Return the neighbours of a value in a grid, within the bounds of its parameter."""
        span, near = self.signatures.span, 1e-9 * max(abs(at), 1.0)
        values = np.unique(grid)
        below, above = values[values < at - near], values[values > at + near]
        if below.size and above.size:  # one that it nearly is is no neighbour
            apart = 2.0 * EDGE * (above[0] - below[-1])
            below, above = below[below < at - apart], above[above > at + apart]
        step = 1.6 if parameter.logarithmic else 1.0
        low = below[-1] if below.size else (at / step if parameter.logarithmic else at - step)
        high = above[0] if above.size else (at * step if parameter.logarithmic else at + step)
        ends = parameter.high, parameter.of_run * span.longest_run, parameter.of_range * span.temperature_range
        return float(max(low, parameter.low)), float(min(high, *ends))

    def contenders(self, now: Hypothesis) -> list[Hypothesis]:
        """Return the models with one effect more, best first: each with shape, noise and size of its own where it is near enough."""
        seen = self.scan(now)[:CONTENDERS]
        tried: list[tuple[float, Term, Mapping[str, Noise]]] = []
        plain = Background(self.linear, now.terms, now.noise)
        for one in seen:
            beside = plain if one.noise is now.noise else Background(self.linear, now.terms, one.noise)
            if _near(one.gain, seen[0].gain):
                term = self.polish(beside, one.term)
                tried.append((beside.with_term(term)[1] + beside.evidence - plain.evidence, term, one.noise))
        best = max((gain for gain, _, _ in tried), default=0.0)
        found = []
        for gain, term, noise in tried:
            if _near(gain, best):
                acts = self.linear.responses if term.effect.thermal else (term.response,)
                found.append(self.settle((*now.terms, term), noise, acts))
        return sorted(found, key=lambda h: -h.score)

    def grow(
        self,
        before: Sequence[Term] = (),
        near: Callable[[Hypothesis], bool] = lambda _: True,
        noise: Mapping[str, Noise] | None = None,
        most: int = MOST_TERMS,
    ) -> tuple[Hypothesis, Hypothesis]:
        """Return the model without effects and the one that grew from it, or from terms of another linearisation, by at most so many as long as it is `near` this one."""
        own = estimate_noise_of(self.linear, (), self.noise)
        plain = now = Hypothesis((), own, Background(self.linear, (), own).evidence)
        for term in before:
            beside = Background(self.linear, now.terms, noise or now.noise)
            here = self.polish(beside, self._moved(term, term.shape), anew=False)
            now = _credited(self.settle((*now.terms, here), noise or now.noise), now)
        now = self._without_idle(now, plain)
        for _ in range(most):  # a term may leave when another one comes
            if len(now.terms) == MOST_TERMS or not self.bank or (now.terms and not near(now)):
                break
            tried = self.contenders(now)
            if not tried or tried[0].score - now.score < self.needed(tried[0].terms[-1], now.terms):
                break
            self.progress(f"{tried[0].terms[-1].effect.name} explains {tried[0].score - now.score:.0f} of log evidence")
            now = self._without_idle(_credited(self.settle(tried[0].terms, tried[0].noise), now), plain)
        return plain, self._tuned(now)

    def _tuned(self, now: Hypothesis) -> Hypothesis:
        """Move the shapes to where they are likeliest in the noise that the model leaves, not in that of the model before."""
        for k, term in enumerate(now.terms):
            others = (*now.terms[:k], *now.terms[k + 1 :])
            here = self.polish(Background(self.linear, others, now.noise), term, anew=False)
            there = self.settle((*now.terms[:k], here, *now.terms[k + 1 :]), now.noise)
            now = there if there.score > now.score else now
        return now

    def needed(self, term: Term, others: Sequence[Term]) -> float:
        """Return the log posterior that a cause must bring beside others."""
        margin = MARGIN if self.linear.problem.instrument.polynomial is None else MARGIN + UNSTATED
        return margin + FURTHER * sum(other.brought for other in others if other.response == term.response)

    def compare(self, plain: Hypothesis, final: Hypothesis) -> Outcome:
        """Return a model with what could stand in the place of each of its terms."""
        rivals, without = [], []
        for k, term in enumerate(final.terms):
            others = (*final.terms[:k], *final.terms[k + 1 :])
            base = self.settle(others, final.noise) if others else plain
            same = replace(final, terms=(*others, term))
            known = [h for h in self.contenders(base) if h.terms[-1].key != term.key]
            rivals.append(tuple(sorted([same, *known], key=lambda h: -h.score)))
            without.append(base)
        return Outcome(plain, final, tuple(rivals), tuple(without))

    def suspects(self, now: Hypothesis) -> list[tuple[tuple[Term, ...], Mapping[str, Noise]]]:
        """Return what may be behind slow noise far above the white noise of rows: nothing but less noise, and effects that then gain most."""
        found: list[tuple[tuple[Term, ...], Mapping[str, Noise]]] = []
        for name, noise in self._quieter(now, LESS[:1]):
            if self.linear.rows[name].slow_share(now.noise[name]) < SUSPICIOUS:
                continue
            beside, tried = Background(self.linear, now.terms, noise), []
            for own in self.bank:
                if own.response == name and (own.effect.name, name) not in {term.key for term in now.terms}:
                    gain = self.gains(beside, own).max(axis=0)
                    tried.append((float(gain.max()), own, int(np.argmax(gain))))
            best: dict[str, tuple[Term, ...]] = {}
            for _, own, k in sorted(tried, key=lambda one: -one[0]):
                best.setdefault(own.effect.name, (*now.terms, self.term(own.effect, name, own.shapes[k])))
            found += [(terms, noise) for terms in (now.terms, *list(best.values())[:SUSPECTS])]
        return found

    def _quieter(self, now: Hypothesis, parts: Sequence[float]) -> list[tuple[str, dict[str, Noise]]]:
        """Return noises with less that is slow in one response, and no more white noise than neighbouring rows scatter."""
        found = []
        for name, own in now.noise.items():
            rows = self.linear.rows[name]
            rest = Background(self.linear, now.terms, now.noise).residual(name)
            white = min(own.white, white_rms(*(rest[place] for place in rows.slices)) * rows.span**0.5 or own.white)
            for part in parts:
                less = replace(
                    own,
                    white=white,
                    flicker=own.flicker * max(part, 0.1),
                    walk=own.walk * part,
                    offset=own.offset * max(part, 0.1),
                )
                found.append((name, {**now.noise, name: less}))
        return found

    def _without_idle(self, now: Hypothesis, plain: Hypothesis) -> Hypothesis:
        """Leave out terms that do not pay beside the others."""
        for k in range(len(now.terms)):
            others = (*now.terms[:k], *now.terms[k + 1 :])
            fewer = self.settle(others, now.noise) if others else plain
            if now.score - fewer.score < self.needed(now.terms[k], others):
                return self._without_idle(fewer, plain)
        return now


def _series(effect: Effect, grid: Sequence[tuple[float, ...]]) -> list[list[tuple[float, ...]]]:
    """Return the shapes of a grid in series of equal steady parameters, each in its order."""
    found: dict[tuple[float, ...], list[tuple[float, ...]]] = {}
    for shape in grid:
        found.setdefault(_steady(effect, shape), []).append(shape)
    return list(found.values())


def _steady(effect: Effect, shape: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(value for value, parameter in zip(shape, effect.shape, strict=True) if parameter.steady)


def _chosen(effect: Effect, grid: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    every = -(-len(grid) // MOST_SHAPES)
    return [shape for series in _series(effect, grid) for shape in series[every // 2 :: every]]


def _passed(effect: Effect, grid: list[tuple[float, ...]], at: tuple[float, ...]) -> list[tuple[float, ...]]:
    """Return the shapes about a chosen one that were passed over."""
    every = -(-len(grid) // MOST_SHAPES)
    series = next(own for own in _series(effect, grid) if _steady(effect, own[0]) == _steady(effect, at))
    shapes = np.array(series)
    place = int(np.argmin((np.abs(shapes - at) / np.maximum(np.ptp(shapes, axis=0), 1e-300)).sum(axis=1)))
    return series[max(place - every, 0) : place + every + 1]


def _near(gain: float, best: float) -> bool:
    part, less = NEAR
    return gain > max(part * best - less, HOPELESS)


def _credited(now: Hypothesis, before: Hypothesis) -> Hypothesis:
    """Return a model whose last term knows what it brought."""
    last = replace(now.terms[-1], brought=max(now.score - before.score, 0.0))
    return replace(now, terms=(*now.terms[:-1], last))


def _leading(effect: Effect, shapes: int) -> list[int]:
    spread = effect.spread
    least = 0.0 if shapes <= FEW else LEADING * float(spread.max())
    first = [int(k) for k in np.argsort(-spread, kind="stable") if spread[k] > 0 and spread[k] >= least]
    return first if shapes <= FEW else first[: max(WIDTH, int(np.sum(spread == spread.max())))]
