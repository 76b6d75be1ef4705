"""The designs of a study: grids, lists, Latin hypercubes, Sobol sequences, Saltelli's and one-at-a-time designs."""

from hashlib import blake2b
from math import prod
from typing import Any

import numpy as np

from compensation.arrays import Array
from studies.errors import InputError
from studies.sweeps.definition import Study, StudyParameter
from studies.sweeps.keys import MOST_CASES

LEVELS = (-1.0, -0.5, 0.5, 1.0)  # of one parameter at a time, in half ranges about the nominal value


def draw(study: Study) -> Array:
    """Return the designs that a study asks for, (cases, parameters); texts as their place in the parameter's `values`."""
    if not study.parameters:
        return np.empty((1, 0))
    return np.ascontiguousarray(SAMPLERS[study.sampling.method](study), dtype=float)


def hash_designs(designs: Array) -> str:
    """A hash of all values, to notice a sampler that gives other designs than it did before."""
    return blake2b(designs.astype("<f8").tobytes(), digest_size=16).hexdigest()


def coding(study: Study) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Return the names of the parameters, each with its texts, the nominal one last (`studies.sweeps.block.decode`)."""
    return tuple((p.name, (*p.values, p.nominal) if isinstance(p.nominal, str) else ()) for p in study.parameters)


def nominal_row(study: Study) -> Array:
    """Return the nominal design as a row of a design, array (parameters,)."""
    return np.array([-1.0 if isinstance(p.nominal, str) else float(p.nominal) for p in study.parameters])


def nominal_design(study: Study) -> dict[str, Any]:
    """Return the parameters of the nominal design by name."""
    return {p.name: p.nominal for p in study.parameters}


def _grid(study: Study) -> Array:
    axes = [_axis(p) if p.values else _spread(p) for p in study.parameters]
    if (count := prod(map(len, axes))) > MOST_CASES:
        raise InputError(f"the grid has {count} cases, above {MOST_CASES}; take fewer or a sample.")
    return np.stack([x.ravel() for x in np.meshgrid(*axes, indexing="ij")], axis=1)


def _axis(parameter: StudyParameter) -> Array:
    if isinstance(parameter.nominal, str):
        return np.arange(len(parameter.values), dtype=float)
    return np.array(parameter.values, dtype=float)


def _spread(parameter: StudyParameter) -> Array:
    if parameter.distribution == "log-uniform":
        return np.geomspace(parameter.low, parameter.high, parameter.count or 2)
    return np.linspace(parameter.low, parameter.high, parameter.count or 2)


def _listed(study: Study) -> Array:
    lengths = {p.name: len(p.values) for p in study.parameters}
    if len(set(lengths.values())) > 1:
        words = ", ".join(f"{name}: {length}" for name, length in lengths.items())
        raise InputError(f"method = 'list' needs equally many values of every parameter, not {words}.")
    return np.stack([_axis(p) for p in study.parameters], axis=1)


def _hypercube(study: Study) -> Array:
    from scipy.stats import qmc

    rng = np.random.default_rng(study.sampling.seed)
    return _scale(study, qmc.LatinHypercube(len(study.parameters), rng=rng).random(study.sampling.cases))


def _sobol(study: Study) -> Array:
    return _scale(study, _sobol_points(len(study.parameters), study))


def _saltelli(study: Study) -> Array:
    """Rows of A, then B, then for each parameter A with that parameter's column from B (Saltelli 2010)."""
    d = len(study.parameters)
    points = _scale(study, _sobol_points(2 * d, study).reshape(-1, 2, d).reshape(-1, d)).reshape(-1, 2, d)
    A, B = points[:, 0], points[:, 1]
    mixed = [np.where(np.arange(d) == k, B, A) for k in range(d)]
    return np.concatenate([A, B, *mixed])


def _sobol_points(dimensions: int, study: Study) -> Array:
    from scipy.stats import qmc

    engine = qmc.Sobol(dimensions, rng=np.random.default_rng(study.sampling.seed))
    return np.asarray(engine.random_base2(study.sampling.cases.bit_length() - 1))


def _one_at_a_time(study: Study) -> Array:
    middle = np.array([float(p.nominal) for p in study.parameters])
    rows = [middle]
    for k, parameter in enumerate(study.parameters):
        for level in LEVELS:
            row = middle.copy()
            end = parameter.high if level > 0 else parameter.low
            row[k] = middle[k] + abs(level) * (end - middle[k])
            rows.append(row)
    return np.array(rows)


def _scale(study: Study, unit: Array) -> Array:
    """Map points of the unit cube, row by row, through the inverse distribution of every parameter."""
    return np.stack([_quantile(p, unit[:, k]) for k, p in enumerate(study.parameters)], axis=1)


def _quantile(parameter: StudyParameter, p: Array) -> Array:
    low, high = parameter.low, parameter.high
    if parameter.distribution == "uniform":
        return low + p * (high - low)
    if parameter.distribution == "log-uniform":
        return np.asarray(np.exp(np.log(low) + p * np.log(high / low)))
    if parameter.distribution == "triangular":
        from scipy.stats import triang

        return np.asarray(triang.ppf(p, (float(parameter.nominal) - low) / (high - low), low, high - low))
    return np.asarray(parameter.normal.ppf(p))


SAMPLERS = {
    "grid": _grid, "list": _listed, "latin-hypercube": _hypercube, "sobol": _sobol, "sensitivity": _saltelli,
    "one-at-a-time": _one_at_a_time,
}  # fmt: skip
