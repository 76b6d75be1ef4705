"""The point beside effects where a linear model of values, starts and effects holds: Gauss–Newton steps that really leave less.

At values u the effects' coefficients c are linear; what is left at their best,

    Q(u) = min_c |L⁻¹ (r(u) − Σ X_k(u) c_k)|² + |c|² + |u|²,

has to fall with every step of u; a step that does not is shortened.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compensation.errors import CompensationError
from compensation.noise import Noise
from shell.errors import ShellError
from studies.calibration.fit import CardFit
from studies.errors import InputError
from studies.inference.held_out import Model
from studies.inference.model import Linear, Term, solve_posterior
from studies.inference.signatures import Signatures
from thermal.errors import ThermalError

Array = NDArray[np.float64]
STEPS, PARTS = 6, (1.0, 0.4, 0.15)
"""Most steps, and the parts of one that are tried."""
STEP = 0.02
"""Prior standard deviations, for differences."""
CLOSE = 0.1
"""Prior standard deviations: a step that is taken as none."""


def relinearise(
    start: CardFit,
    linear: Linear,
    signatures: Signatures,
    point: Array,
    terms: Sequence[Term],
    noise: Mapping[str, Noise],
) -> tuple[Linear, Signatures, Array, tuple[Term, ...]]:
    """Return the model linearised where its values are most probable beside some effects, these values, and the effects there."""
    problem = start.problem
    terms = tuple(replace(one, bend={}) for one in terms)
    best, sizes = _left(linear, point, terms, noise)
    terms = tuple(_bent(start, signatures, point, one, size) for one, size in zip(terms, sizes, strict=True))
    for _ in range(STEPS):
        model = Model(linear, signatures, terms, noise)
        moved = model.kept(model.mean()).point
        if np.abs(moved - point).max(initial=0.0) < CLOSE:
            break
        for part in PARTS:
            trial = point + part * (moved - point)
            try:
                state, there = problem.evaluate(trial), Signatures.at(problem, trial)
            except (InputError, ShellError, ThermalError, CompensationError):
                continue
            here = Linear.of(replace(start, state=state), linear.told)
            fresh = tuple(replace(one, columns=_columns(there, one), bend={}) for one in terms)
            left, sizes = _left(here, trial, fresh, noise)
            if left < best:
                break
        else:
            break
        linear, signatures, point, best = here, there, trial, left
        terms = tuple(_bent(start, there, trial, one, size) for one, size in zip(fresh, sizes, strict=True))
    return linear, signatures, point, terms


def _bent(start: CardFit, signatures: Signatures, point: Array, term: Term, size: Array) -> Term:
    """Return a term that knows how what it makes of the temperature goes with the law and the lag of a polynomial card: no record may know its slope."""
    problem = start.problem
    if problem.instrument.polynomial is None or not term.effect.thermal:
        return term
    own = {name: columns @ size for name, columns in term.columns.items()}
    bend = {name: np.zeros((len(change), problem.count + 1)) for name, change in own.items()}
    for k, name in enumerate(problem.priors.names):
        if name.startswith("law.a") or name == "law.lag_s":
            moved = Signatures.at(problem, point + STEP * np.eye(problem.count)[k])
            for response, columns in _columns(moved, term).items():
                bend[response][:, k] = (columns @ size - own[response]) / STEP
    for columns in bend.values():
        columns[:, -1] = columns[:, :-1] @ point
    return replace(term, bend=bend)


def _columns(signatures: Signatures, term: Term) -> dict[str, Array]:
    found = signatures.columns(term.effect, term.shape, term.response)
    return {name: own[:, list(term.members)] for name, own in found.items()}


def _left(linear: Linear, point: Array, terms: Sequence[Term], noise: Mapping[str, Noise]) -> tuple[float, list[Array]]:
    """Q at a point where the model is linearised, and the coefficients of the terms there."""
    X, target, _ = linear.whitened(terms, noise)
    whole, r = np.vstack(list(X.values())), np.concatenate(list(target.values()))
    count = linear.count
    rest, own = r - whole[:, :count] @ point, whole[:, count:]
    c = solve_posterior(own, rest)[0] if own.shape[1] else np.zeros(0)
    ends = np.cumsum([0, *(len(term.unit) for term in terms)])
    sizes = [c[a:b] * term.spread for a, b, term in zip(ends[:-1], ends[1:], terms, strict=True)]
    return float(np.sum((rest - own @ c) ** 2) + c @ c + point @ point), sizes
