"""Many designs at once through families (`shell.family`), their error judged by full solves not seen, else every design solved."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from shell.constants import zero_Celsius
from shell.family import MOST_SOLVES, Axis, Family, FamilyResult, build_family
from shell.law import slope_parts
from shell.material import Material
from shell.resonator import Resonator
from studies.errors import UNUSABLE_INPUT, InputError
from studies.instrument.card import Instrument
from studies.sweeps.definition import Study
from studies.sweeps.parameters import TEMPERATURE, set_parameters
from studies.sweeps.quantities.tcf import PARTS, STEEPEST
from studies.sweeps.quantity import ModeQuantity, Quantity

Designs = Mapping[str, NDArray[Any]]  # columns of parameters by name
FEWEST = 64  # cases from which a family may cost less than solving each design
SHARE = 2  # designs for each full solve that a family may take, so that it at least halves the work
TOLERANCE = 1e-6  # of the family against the full solve
TEMPERATURES = 9  # at which the range of ν is looked at
MARGIN = 0.02  # of that range, beyond its ends
DIMENSIONS, MATERIAL = "resonator.", "material."
ELSEWHERE = ("thermal.", "bias.", "loss.", "noise.", "loop.", "user.")  # parameters that no mode depends on
PROPERTIES = ("youngs_modulus", "poisson_ratio", "density")


@dataclass(frozen=True)
class Families:
    """The families of a study by (harmonic, index, theory), and what it takes to evaluate its designs with them."""

    instrument: Instrument
    asked: tuple[Quantity, ...]
    members: Mapping[tuple[int, int, str], Family]
    nodes: "_Nodes | None" = None

    def evaluate(self, designs: Designs, count: int) -> tuple[Array, Array]:
        """Evaluate designs together: values and errors, arrays (designs, columns)."""
        found = [FAST[one.name](self, one, designs, count) for one in self.asked]
        values, errors = (np.concatenate([one[part] for one in found], axis=1) for part in (0, 1))
        return values, errors

    def modes(self, asked: ModeQuantity, designs: Designs, count: int) -> "tuple[Family, FamilyResult, _Bodies]":
        """Return the family that a quantity asks for, what it gives, and what the designs are made of."""
        bodies = _describe(self.instrument, designs, count, asked.temperature_degC, self.nodes)
        family = self.members[_key(asked)]
        values = np.empty((len(bodies.T), len(family.axes)))
        for k, axis in enumerate(family.axes):
            values[:, k] = designs[axis.name]
        found = family.evaluate(values, nu=bodies.nu, E=bodies.E, rho=bodies.rho, growth=bodies.growth)
        return family, found, bodies


@dataclass(frozen=True)
class _Bodies:
    """What designs are made of, arrays (m,): T (K), growth of lengths, E (Pa), ν, ρ (kg/m³); each material, its places and its weights there."""

    T: Array
    growth: Array
    E: Array
    nu: Array
    rho: Array
    materials: "list[_Part]"


_Part: TypeAlias = "tuple[Material, Any, Array | float]"


@dataclass(frozen=True)
class _Nodes:
    """Materials at Chebyshev nodes of their parameters, between which those of the designs are interpolated (Lagrange)."""

    names: tuple[str, ...]
    low: Array
    high: Array
    materials: tuple[Material, ...]

    def parts(self, designs: Designs) -> tuple[list[_Part], NDArray[np.bool_]]:
        """Return the materials with their weights, and the designs that lie within the nodes' ranges."""
        at = np.array([designs[name] for name in self.names], dtype=float)
        inside = np.asarray(((at.T >= self.low) & (at.T <= self.high)).all(axis=1))
        x = (2 * at.T[inside] - self.low - self.high) / (self.high - self.low)
        basis = [np.prod([(x - p) / (q - p) for p in NODES if p != q], axis=0) for q in NODES]
        weights = (np.prod([basis[j][:, k] for k, j in enumerate(one)], axis=0) for one in _choices(len(self.names)))
        return [(m, inside, w) for m, w in zip(self.materials, weights, strict=True)], inside


NODES = np.cos(np.pi * (np.arange(6) + 0.5) / 6)
MOST_AXES = 3  # material parameters that are interpolated
SAME = 1e-10  # relative, of E, ν and ρ between nodes and at designs that are no nodes


def _choices(count: int) -> Iterator[tuple[int, ...]]:
    return product(range(len(NODES)), repeat=count)


def _build_nodes(study: Study, design: Array) -> _Nodes | None:
    """Return materials at nodes where many designs have one of their own; None where these are few, or not followed."""
    places = [k for k, p in enumerate(study.parameters) if p.name.startswith(MATERIAL)]
    if not 0 < len(places) <= MOST_AXES or any(isinstance(study.parameters[k].nominal, str) for k in places):
        return None
    if len(np.unique(design[:, places], axis=0)) < FEWEST * len(NODES) ** len(places):
        return None
    names = tuple(study.parameters[k].name for k in places)
    low, high = np.array([_range(study, design, k) for k in places]).T
    try:
        at = ((low + high + NODES[list(one)] * (high - low)) / 2 for one in _choices(len(places)))
        nodes = _Nodes(names, low, high, tuple(
            set_parameters(study.instrument, dict(zip(names, map(float, one), strict=True))).material for one in at
        ))  # fmt: skip
        some = design[:: -(-len(design) // FEWEST)]
        columns = {p.name: some[:, k] for k, p in enumerate(study.parameters) if p.name in (*names, TEMPERATURE)}
        exact, found = (_describe(study.instrument, columns, len(some), None, one) for one in (None, nodes))
    except UNUSABLE_INPUT:
        return None
    close = (np.allclose(getattr(found, n), getattr(exact, n), rtol=SAME, atol=0) for n in ("E", "nu", "rho", "growth"))
    return nodes if all(close) else None


def why_not(study: Study) -> str:
    """Return why a study cannot be computed through families, or nothing when it can."""
    if study.instrument.part("mount") is not None:
        return "families do not cover a [mount] that stresses the resonator"
    if study.derived:
        return "derived parameters are computed design by design"
    for parameter in study.parameters:
        name = parameter.name
        follows = name == TEMPERATURE or name.startswith((MATERIAL, *ELSEWHERE))
        if not (follows or (name.startswith(DIMENSIONS) and not isinstance(parameter.nominal, str))):
            return f"families do not cover the parameter '{name}'"
    for asked in study.asked:
        if asked.name not in FAST:
            return f"families do not give the quantity '{asked.columns[0].name}'"
        if asked.options["theory"] == "rayleigh":
            return "families need the theory solid or shell"
    return ""


def build_families(study: Study, design: Array, most: int = MOST_SOLVES) -> Families | str:
    """Build the families that a study asks for, or say why it must be computed design by design."""
    if reason := why_not(study):
        return reason
    dimensions = [k for k, p in enumerate(study.parameters) if p.name.startswith(DIMENSIONS)]
    axes = [Axis(study.parameters[k].name, *_range(study, design, k)) for k in dimensions]

    def build(values: Array) -> Resonator:
        named = {axis.name: float(value) for axis, value in zip(axes, values, strict=True)}
        return set_parameters(study.instrument, named).resonator

    sloped = {_key(one) for one in study.asked if one.name == "tcf"}
    members: dict[tuple[int, int, str], Family] = {}
    try:
        ends = _ends(study, design)
        nu = _describe(study.instrument, ends, len(ends[TEMPERATURE]), None).nu
        beyond = MARGIN * float(np.ptp(nu))
        for one in study.asked:
            key = harmonic, index, theory = _key(one)
            if key not in members:
                members[key] = build_family(
                    build, axes, nu=(float(nu.min()) - beyond, float(nu.max()) + beyond), harmonic=harmonic,
                    index=index, theory=theory, slopes=key in sloped, tolerance=TOLERANCE, most=most,
                )  # fmt: skip
    except UNUSABLE_INPUT as error:
        return str(error).rstrip(".")
    return Families(study.instrument, study.asked, members, _build_nodes(study, design))


def choose_solver(study: Study, design: Array) -> Families | None:
    """Return the families where the spec asks for them or lets them be, None where every design is solved in full."""
    wanted, count = study.sampling.solver, len(design)
    if wanted == "full" or (wanted == "auto" and count < FEWEST):
        return None
    found = build_families(study, design, min(count // SHARE, MOST_SOLVES) if wanted == "auto" else MOST_SOLVES)
    if isinstance(found, Families):
        return found
    if wanted == "family":
        raise InputError(f"solver = 'family' cannot be used: {found}. Use solver = 'full'.")
    return None


def _frequency(families: Families, asked: ModeQuantity, designs: Designs, count: int) -> tuple[Array, Array]:
    family, found, _ = families.modes(asked, designs, count)
    error = found.frequency * (family.error.frequency + family.theory_error)
    return found.frequency[:, None], error[:, None]


def _bryan_factor(families: Families, asked: ModeQuantity, designs: Designs, count: int) -> tuple[Array, Array]:
    family, found, _ = families.modes(asked, designs, count)
    return found.bryan_factor[:, None], np.full((count, 1), family.error.bryan_factor + family.theory_error)


def _tcf(families: Families, asked: ModeQuantity, designs: Designs, count: int) -> tuple[Array, Array]:
    """Return the five parts of d ln f/dT (HRG paper eq. 15) and their sum."""
    family, found, bodies = families.modes(asked, designs, count)
    parts, scale = np.zeros((5, count)), np.zeros((2, count))
    for material, places, weight in bodies.materials:
        T = bodies.T[places]
        found_parts = slope_parts(material, T, found.by_nu[places], found.by_thickness[places])
        parts[:, places] += weight * np.array([getattr(found_parts, name) for name in PARTS])
        scale[:, places] += weight * np.array([material.slope("poisson_ratio", T), material.value("expansion", T)])
    parts, scale = parts.T, abs(scale.T)
    level, nothing = STEEPEST * family.theory_error, np.zeros(count)
    of_nu, of_h = (family.error.by_nu + level) * scale[:, 0], (family.error.by_thickness + level) * scale[:, 1]
    # the parts of h and r add up to −alpha whatever the slope by h
    errors = np.stack([of_nu, nothing, of_nu, nothing, of_h, of_h], axis=1)
    return 1e6 * np.column_stack([parts.sum(axis=1), parts]), 1e6 * errors


FAST: Mapping[str, Callable[..., tuple[Array, Array]]] = {
    "frequency": _frequency,
    "tcf": _tcf,
    "bryan-factor": _bryan_factor,
}


def _key(asked: Quantity) -> tuple[int, int, Any]:
    options = asked.options
    return options["harmonic"], options.get("index", 0), options["theory"]


def _describe(
    instrument: Instrument, designs: Designs, count: int, temperature_degC: float | None, nodes: _Nodes | None = None
) -> _Bodies:
    """Return what designs are made of; one material for all that share its parameters, or those of nodes that many share."""
    reference = instrument.reference_temperature
    given = designs.get(TEMPERATURE, reference - zero_Celsius) if temperature_degC is None else temperature_degC
    T = np.broadcast_to(np.asarray(given, dtype=float), (count,)) + zero_Celsius
    names = [name for name in designs if name.startswith(MATERIAL)]
    materials, inside = nodes.parts(designs) if nodes is not None else ([], np.zeros(count, dtype=bool))
    groups: dict[tuple[Any, ...], Any] = {}
    if names:
        for place in np.flatnonzero(~inside).tolist():
            groups.setdefault(tuple(designs[name][place].item() for name in names), []).append(place)
    else:
        groups[()] = slice(None)
    for values, places in groups.items():
        materials.append((set_parameters(instrument, dict(zip(names, values, strict=True))).material, places, 1.0))
    constants = np.zeros((4, count))
    for material, places, weight in materials:
        there = T[places]
        own = [*(material.value(name, there) for name in PROPERTIES), material.growth(there, reference)]
        for row, value in zip(constants, own, strict=True):
            row[places] += weight * value
    E, nu, rho, growth = constants
    return _Bodies(T, growth, E, nu, rho, materials)


def _range(study: Study, design: Array, k: int) -> tuple[float, float]:
    p, values = study.parameters[k], design[:, k]
    return min(float(values.min()), p.low, float(p.nominal)), max(float(values.max()), p.high, float(p.nominal))


def _ends(study: Study, design: Array) -> dict[str, NDArray[Any]]:
    """Return designs at the ends of temperature and every material parameter, which bound ν of all designs."""
    fixed = [T for T in (one.options["temperature_degC"] for one in study.asked) if T is not None]
    choices: dict[str, Sequence[Any]] = {}
    for k, p in enumerate(study.parameters):
        if p.name == TEMPERATURE:
            choices[p.name] = np.linspace(*_range(study, design, k), TEMPERATURES).tolist()
        elif p.name.startswith(MATERIAL):
            choices[p.name] = p.values if isinstance(p.nominal, str) else _range(study, design, k)
    reference = study.instrument.reference_temperature - zero_Celsius
    choices[TEMPERATURE] = [*choices.get(TEMPERATURE, [reference]), *fixed]
    return {n: np.array(one) for n, one in zip(choices, zip(*product(*choices.values()), strict=True), strict=True)}
