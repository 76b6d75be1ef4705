"""Steady forms of effects, weighed beside what a table's baseline can do."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from studies.diagnosis.table_noise import Scale, TableBaseline
from studies.effects import Effect
from studies.effects.states import FloatArray

NOISE_STEPS = 3
"""Solutions of a card's values beside a form, each in the noise that the one before has left."""


@dataclass(frozen=True)
class Candidate:
    """One steady form of an effect: its columns, log evidence, and what it leaves (Hz)."""

    effect: Effect
    shape: tuple[float, ...]
    columns: FloatArray
    log_evidence: float
    ssq: float
    loo: float
    residual: FloatArray

    @property
    def words(self) -> str:
        """The form in words."""
        return self.effect.steady_words.format(*self.shape)


def weigh_forms(
    effect: Effect, x: FloatArray, base: TableBaseline, scale: Scale, rounding: float, scatter: float
) -> list[Candidate]:
    """Weigh every shape of an effect at temperatures x (K from their middle)."""
    assert effect.steady is not None
    assert effect.steady_grid is not None
    shapes = list(effect.steady_grid(float(x.min()), float(x.max())))
    out = []
    for shape in shapes:
        columns = effect.steady(x, shape)
        if columns.shape[1] + 4 > x.size or not np.all(np.linalg.norm(base.beside(columns), axis=0) > 1e-9):
            continue
        noise = scatter
        for _ in range(NOISE_STEPS if base.known.size else 1):
            residual, lone, _, _ = base.solve(columns, noise)
            noise = max(rms(residual), rounding)
        value = scale.log_evidence(columns) - float(np.log(len(shapes)))
        out.append(Candidate(effect, tuple(shape), columns, value, float(residual @ residual), rms(lone), residual))
    if len(out) > 1 and effect.shape:  # one form at many places: the mean over them
        total = float(scipy.special.logsumexp([c.log_evidence for c in out]))
        best = max(out, key=lambda c: c.log_evidence)
        out = [c if c is not best else replace(best, log_evidence=total) for c in out]
    return out


def best_by_words(found: Sequence[Candidate]) -> list[Candidate]:
    """Return the best shape of every form, by its words without the place, the likeliest first."""
    best: dict[str, Candidate] = {}
    for c in found:
        key = c.words if c.effect.name in best or "{0:.0f}" in c.effect.steady_words else c.effect.steady_words
        if key not in best or c.log_evidence > best[key].log_evidence:
            best[key] = c
    return sorted(best.values(), key=lambda c: -c.log_evidence)


def span_alike(x: FloatArray, base: TableBaseline, one: FloatArray, two: FloatArray) -> bool:
    """Return whether two forms are the same data beside the baseline; a card's values do about what a parabola does."""
    frame = base if base.free.size else replace(base, free=np.vander(x, 3))
    a, b = frame.beside(one), frame.beside(two)
    rest = b - a @ np.linalg.lstsq(a, b, rcond=None)[0]
    return bool(np.linalg.norm(rest) < 0.05 * np.linalg.norm(b)) if a.size else False


def rms(values: FloatArray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))
