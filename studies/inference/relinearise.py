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
IMPOSSIBLE = (InputError, ShellError, ThermalError, CompensationError)
"""What a point says that has no prediction."""
CLOSE = 0.5
"""Fall of Q that a step must promise to be taken."""


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
    terms = _bent(start, point, terms, sizes)
    for _ in range(STEPS):
        model = Model(linear, signatures, terms, noise)
        X, r = model.linear.stacked(terms, noise)
        mean = solve_posterior(X, r)[0]
        if best - float(mean @ mean + np.sum((r - X @ mean) ** 2)) < CLOSE:
            break
        moved = model.kept(mean).point
        for part in PARTS:
            trial = point + part * (moved - point)
            try:
                state, there = problem.evaluate(trial), Signatures.at(problem, trial)
            except IMPOSSIBLE:
                continue
            here = Linear.of(replace(start, state=state), linear.told)
            fresh = tuple(replace(one, columns=there.columns_of(one), bend={}) for one in terms)
            left, sizes = _left(here, trial, fresh, noise)
            if left < best:
                break
        else:
            break
        linear, signatures, point, best = here, there, trial, left
        terms = _bent(start, trial, fresh, sizes)
    return linear, signatures, point, terms


def _bent(start: CardFit, point: Array, terms: Sequence[Term], sizes: Sequence[Array]) -> tuple[Term, ...]:
    """Return terms that know how what they do goes with the starts of runs and with the lag, and slope, of a polynomial card."""
    problem, names = start.problem, start.problem.priors.names
    thermal = any(term.effect.thermal for term in terms)
    law = [k for k, name in enumerate(names) if name == "law.lag_s" or (thermal and name.startswith("law.a"))]
    kinds: dict[str, list[int]] = {}
    for i, (_, name, _) in enumerate(problem.starts):
        if name.startswith("initial."):
            kinds.setdefault(name, []).append(len(names) + i)
    # runs know nothing of each other: their starts move at once
    directions = [*([k] for k in law), *kinds.values()] if terms else []
    moved = [Signatures.at(problem, point + STEP * np.isin(np.arange(problem.count), places)) for places in directions]
    found = []
    for term, size in zip(terms, sizes, strict=True):
        own = {name: columns @ size for name, columns in term.columns.items()}
        bend = {name: np.zeros((len(change), problem.count + 1)) for name, change in own.items()}
        for places, paths in zip(directions, moved, strict=True):
            if places[0] < len(names) and names[places[0]].startswith("law.a") and not term.effect.thermal:
                continue
            for response, columns in paths.columns_of(term).items():
                change = (columns @ size - own[response]) / STEP
                for k in places:
                    bend[response][_rows_of(start, response, k), k] = change[_rows_of(start, response, k)]
        for columns in bend.values():
            columns[:, -1] = columns[:, :-1] @ point
        found.append(replace(term, bend=bend) if any(columns.any() for columns in bend.values()) else term)
    return tuple(found)


def _rows_of(start: CardFit, response: str, k: int) -> slice:
    """Rows of a response that a coordinate reaches: those of its run, or all."""
    problem = start.problem
    if k < len(problem.priors.names):
        return slice(None)
    own = problem.parts[problem.starts[k - len(problem.priors.names)][0]]
    members = problem.members(response)
    return start.rows[response].slices[members.index(own)] if own in members else slice(0, 0)


def _left(linear: Linear, point: Array, terms: Sequence[Term], noise: Mapping[str, Noise]) -> tuple[float, list[Array]]:
    """Q at a point where the model is linearised, and the coefficients of the terms there."""
    whole, r = linear.stacked(terms, noise)
    count = linear.count
    rest, own = r - whole[:, :count] @ point, whole[:, count:]
    c = solve_posterior(own, rest)[0] if own.shape[1] else np.zeros(0)
    ends = np.cumsum([0, *(len(term.unit) for term in terms)])
    sizes = [c[a:b] * term.spread for a, b, term in zip(ends[:-1], ends[1:], terms, strict=True)]
    return float(np.sum((rest - own @ c) ** 2) + c @ c + point @ point), sizes
