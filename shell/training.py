"""Train the reduced model of one box of designs: snapshots, sizes, features, and the error that it states."""

from dataclasses import replace
from itertools import product

import numpy as np

from shell.designs import Box, Designs
from shell.errors import ShellError
from shell.interpolated import Polynomials, Solids
from shell.kernel import lame
from shell.quadrature import Array
from shell.reduced import (
    CHUNK,
    MOST_FEATURES,
    Features,
    Projected,
    ReducedModel,
    Snapshots,
    rayleigh_ritz,
    solve_all,
    span,
)

SIZES = (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 16, 18, 20, 22, 24, 27, 30)
LEARNED, CHECKS, FEATURE_DESIGNS = 48, 64, 320  # inside, and again as many on the faces
SAFETY = 1.5  # on the largest ratio of true to estimated error among the checks
DEARER = 1.5  # stated error that a quicker model may have over the other's
MORE = 3  # sizes of the basis that are tried
TOO_WIDE = (
    "no reduced basis of up to {} vectors reaches {:g} in this box: narrow its ranges or allow a larger tolerance."
)
ROOM = 0.9  # share of the tolerance that the estimate may take on designs of the training; the rest is for others


def train(solids: Solids, tolerance: float) -> ReducedModel:
    """The smallest reduced model whose stated error of the frequency stays below `tolerance` on its check designs.

    Raises
    ------
    ShellError
        When no size of the basis reaches the tolerance.
    """
    rng = np.random.default_rng(2026)  # the designs of the training belong to the method
    box = solids.box
    d = box.dimensions
    unit = np.vstack([np.zeros((1, d)), _corners(d), _inside(rng, LEARNED, d), _on_faces(rng, LEARNED, d)])
    learned = solve_all(solids, box.designs(unit))
    checks = solve_all(solids, box.designs(np.vstack([_inside(rng, CHECKS, d), _on_faces(rng, CHECKS, d)])))
    basis = span(solids, learned, SIZES[-1] + _tests(SIZES[-1]))
    projected = Projected.on(solids, basis)
    sizes = _choose_sizes(projected, (learned, checks), tolerance, basis.shape[1])
    for size, accuracy in [(sizes[0], 0.02), *((size, 0.002) for size in sizes), (sizes[-1], 0.0002)]:
        tests = min(_tests(size), basis.shape[1] - size)
        used = Projected.on(solids, basis[:, : size + tests])
        model = _fit(used, size, tests, tolerance, accuracy)
        model, worst = _state_error(model, solids, (learned, checks))
        if worst / 2 < tolerance:
            return _hasten(model, worst, solids, (learned, checks), tolerance)
    raise ShellError(TOO_WIDE.format(SIZES[-1], tolerance))


def _hasten(
    model: ReducedModel, worst: float, solids: Solids, solved: tuple[Snapshots, ...], tolerance: float
) -> ReducedModel:
    """The same model in single precision or with one iteration fewer, where that hardly adds to the stated error."""
    for kind, iterations in ((np.float32, 1), (np.float32, 2), (np.float64, 1)):
        quicker, error = _state_error(model.with_precision(kind, iterations), solids, solved)
        if error / 2 < tolerance and error < DEARER * worst:
            return quicker
    return model


def _corners(d: int) -> Array:
    return np.array(list(product((-1.0, 1.0), repeat=d)))


def _inside(rng: np.random.Generator, count: int, d: int) -> Array:
    return rng.uniform(-1, 1, (count, d))


def _on_faces(rng: np.random.Generator, count: int, d: int) -> Array:
    return np.clip(rng.uniform(-2, 2, (count, d)), -1, 1)


def _tests(size: int) -> int:
    return min(max(size // 2, 8), 12)


def _choose_sizes(projected: Projected, solved: tuple[Snapshots, ...], tolerance: float, most: int) -> list[int]:
    """The fewest vectors with which the estimate leaves some room below the tolerance, and the next more."""
    operators = [projected.pencils(one.designs) for one in solved]
    for size in SIZES:
        tests = min(_tests(size), most - size)
        if tests < 1:
            break
        worst, ratio = 0.0, 0.0
        for (K, M), one in zip(operators, solved, strict=True):
            mu, delta, _ = rayleigh_ritz(K, M, size, tests)
            error = abs(mu * (1 - delta) / _scaled(one, projected.solids.shell.plane_stress) - 1)
            large = delta > 0.1 * np.max(delta)
            ratio = max(ratio, float(np.max(error[large] / delta[large])))
            worst = max(worst, float(np.max(delta)))
        if (SAFETY * ratio * worst + projected.solids.error) / 2 < ROOM * tolerance:
            return [other for other in SIZES if size <= other < most][:MORE]
    raise ShellError(TOO_WIDE.format(SIZES[-1], tolerance))


def _scaled(one: Snapshots, plane_stress: bool) -> Array:
    """ω² per unit G instead of E."""
    nu = one.designs.nu
    return one.eigenvalues / lame(np.ones_like(nu), nu, plane_stress)[1]


def _fit(projected: Projected, r: int, w: int, tolerance: float, accuracy: float) -> ReducedModel:
    """Choose the features and fit every reduced entry that is needed to them."""
    box, solids = projected.solids.box, projected.solids
    d, rng = box.dimensions, np.random.default_rng(2027)
    unit = np.vstack([_corners(d), _inside(rng, FEATURE_DESIGNS, d), _on_faces(rng, FEATURE_DESIGNS, d)])
    designs = box.designs(unit)
    trace, shear, mass = projected.at(designs)
    mu, _, c = rayleigh_ritz(*projected.pencils(designs), r, w)
    rows = _entries(r, w)
    # what an error of an entry does to μ: its coefficients; a residual counts as the root of the tolerance
    weight = np.concatenate([np.max(abs(c), axis=0), np.full(w, np.sqrt(tolerance))])
    # and no entry may be wrong by more than 0.005, or the reduced stiffness would lose its definiteness
    pair = np.maximum(weight[rows[0]] * weight[rows[1]], accuracy * tolerance / 0.005)
    typical = float(np.mean(mu))
    targets = np.concatenate([(kind[:, *rows] * pair) for kind in (trace, shear, typical * mass)], axis=1)
    reference = float(np.sqrt(box.thickness[0] * box.thickness[1]))
    # the thickness order sets the highest power; 1 + ζ κ and 1 + ζ n_r/r add small higher ones
    powers = tuple(range(1, 2 * max(solids.shell.system.level.through) + 6, 2))
    relative = designs.thickness / reference
    features = _choose_features(box, powers, relative, designs.amplitudes, targets, accuracy * tolerance)
    g = features.evaluate(relative, designs.amplitudes.T)
    fit = np.linalg.pinv(g.T, rcond=1e-13)
    by_trace, by_shear = ((fit @ kind[:, *rows]).T for kind in (trace, shear))
    by_mass = _fit_mass(mass[:, *rows], g, features, typical * pair, accuracy * tolerance)
    polynomials, stiff, heavy = _choose_terms(projected, rows, pair, typical * pair, accuracy * tolerance)
    stiffness, inertia = np.hstack([stiff, by_shear, by_trace]), np.hstack([heavy, by_mass])
    model = ReducedModel(polynomials, features, stiffness, inertia, np.zeros(0), r, w, reference, 2, 1.0, 0.0)
    terms = model.terms(designs.thickness, designs.amplitudes.T, designs.stem, designs.nu, projected.ratio(designs.nu))
    start = np.linalg.lstsq(terms.T, c / c[:, :1], rcond=1e-10)[0].T
    return replace(model, start=np.asarray(start))


def _choose_terms(
    projected: Projected, rows: tuple[Array, Array], stiff_weight: Array, heavy_weight: Array, accuracy: float
) -> tuple[tuple[Polynomials, ...], Array, Array]:
    """Leave out the polynomials of the solid parts that together do no more than `accuracy` to any entry."""
    chosen: list[Polynomials] = []
    K: list[Array] = [np.zeros((len(stiff_weight), 0))]
    M: list[Array] = [np.zeros((len(stiff_weight), 0))]
    for one, (stiff, heavy) in zip(projected.solids.parts, projected.parts, strict=True):
        by_term, heavy_by_term = stiff[:, *rows], heavy[:, *rows]
        size = np.linalg.norm(by_term * stiff_weight, axis=1) + np.linalg.norm(heavy_by_term * heavy_weight, axis=1)
        order = np.argsort(size)
        kept = np.ones(len(size), dtype=bool)
        kept[order[np.cumsum(size[order]) < accuracy]] = False
        polynomials, numbers = one.polynomials.part(kept)
        chosen.append(polynomials)
        K.append(by_term[numbers].T)
        M.append(heavy_by_term[numbers].T)
    return tuple(chosen), np.hstack(K), np.hstack(M)


def _fit_mass(entries: Array, g: Array, features: Features, weight: Array, accuracy: float) -> Array:
    """Fit the mass to as few of the leading powers as suffice: the lowest two, mostly."""
    for used in np.cumsum([len(rows) for rows in features.places]):
        found = np.linalg.pinv(g[:used].T, rcond=1e-13) @ entries
        if np.max(np.linalg.norm((g[:used].T @ found - entries) * weight, axis=1)) < accuracy:
            break
    return np.asarray(found.T)


def _entries(r: int, w: int) -> tuple[Array, Array]:
    """Row and column of every entry of the reduced matrices that is used, in the order of `ReducedModel`."""
    packed = [(i, j) for j in range(r) for i in range(j, r)]
    residual = [(r + k, v) for v in range(r) for k in range(w)]
    diagonal = [(r + k, r + k) for k in range(w)]
    i, j = np.array(packed + residual + diagonal).T
    return i, j


def _choose_features(
    box: Box, powers: tuple[int, ...], relative: Array, amplitudes: Array, targets: Array, accuracy: float
) -> Features:
    """Greedily take the power of the thickness at a station that explains most of what is left of the targets."""
    base, slopes = box.base.ravel(), box.shapes.reshape(len(box.shapes), box.base.size).T
    h = relative[:, None] * (base + amplitudes @ slopes.T)
    candidates = np.concatenate([h**power for power in powers], axis=1)
    left_over = candidates / np.linalg.norm(candidates, axis=0)
    u, scale, _ = np.linalg.svd(targets, full_matrices=False)
    targets = u * scale
    chosen: list[int] = []
    for _ in range(MOST_FEATURES):
        sizes = np.linalg.norm(left_over, axis=0)
        usable = sizes > 1e-9
        gain = np.where(usable, np.linalg.norm(left_over.T @ targets, axis=1) / np.where(usable, sizes, 1), 0)
        best = int(np.argmax(gain))
        if not usable[best]:
            break
        chosen.append(best)
        direction = left_over[:, best] / sizes[best]
        targets = targets - np.outer(direction, direction @ targets)
        left_over = left_over - np.outer(direction, direction @ left_over)
        if np.max(np.linalg.norm(targets, axis=1)) < accuracy:
            break
    stations = np.array(sorted({one % len(base) for one in chosen}))
    row = {station: k for k, station in enumerate(stations.tolist())}
    places = tuple(
        np.array(sorted(row[one % len(base)] for one in chosen if one // len(base) == k), dtype=np.intp)
        for k in range(len(powers))
    )
    return Features(base[stations], slopes[stations], places)


def _state_error(model: ReducedModel, solids: Solids, solved: tuple[Snapshots, ...]) -> tuple[ReducedModel, float]:
    """Hold the model against every design that was solved: slope and floor of its error; the largest stated."""
    errors: list[Array] = []
    deltas: list[Array] = []
    bare = replace(model, slope=1.0, floor=0.0)
    for one in solved:
        value, delta = evaluate_many(bare, one.designs, solids.shell.plane_stress)
        errors.append(abs(value / _scaled(one, solids.shell.plane_stress) - 1))
        deltas.append(delta)
    error, delta = np.concatenate(errors), np.concatenate(deltas)
    if not np.all(np.isfinite(delta)):  # the features were too coarse for a definite stiffness
        return model, np.inf
    large = delta > 0.1 * np.max(delta)
    slope = SAFETY * float(np.max(error[large] / delta[large]))
    floor = SAFETY * float(max(np.max(error - slope * delta), np.max(error[delta <= np.median(delta)])))
    floor = max(floor, 1e-12) + solids.error
    return replace(model, slope=slope, floor=floor), slope * float(np.max(delta)) + floor


def evaluate_many(model: ReducedModel, designs: Designs, plane_stress: bool) -> tuple[Array, Array]:
    """ω² ρ/G and its error estimate for any number of designs, in chunks of fixed size."""
    count = len(designs)
    value, error = np.empty(count), np.empty(count)
    ratio = np.divide(*lame(np.ones_like(designs.nu), designs.nu, plane_stress))
    rows = (designs.thickness, designs.amplitudes.T, designs.stem, designs.nu, ratio)
    for first in range(0, count, CHUNK):
        there = slice(first, first + CHUNK)
        chunk = [np.ascontiguousarray(row[..., there]) for row in rows]
        short = CHUNK - chunk[0].shape[-1]
        if short:
            chunk = [np.pad(row, [(0, 0)] * (row.ndim - 1) + [(0, short)], mode="edge") for row in chunk]
        values, errors = model.evaluate(*chunk)
        value[there], error[there] = values[: CHUNK - short], errors[: CHUNK - short]
    return value, error
