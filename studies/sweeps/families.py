"""Many designs at once through reduced bases (`shell.family`): frequency and TCF.

A family holds the ranges of thickness over radius, of stem over radius and of ν that a study needs. E, ρ, radius and
growth with temperature follow exactly, f = √(E/ρ)/R F(h/R, a/R, ν) with the stem's own lengths a, so that only F is
reduced; its error is estimated for each design, and a design whose estimate is too large is solved in full. No result
depends on the other designs of its batch.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shell.family import Family, FamilyResult, build_family
from studies.errors import UNUSABLE_INPUT, InputError
from studies.instrument.card import ZERO_CELSIUS, Instrument
from studies.instrument.tables.resonator import Cylinder, Hemisphere
from studies.sweeps.parameters import TEMPERATURE, set_parameters
from studies.sweeps.row import Row

if TYPE_CHECKING:
    from shell.materials import Material
    from studies.sweeps.case import Options
    from studies.sweeps.definition import Study
    from studies.sweeps.design import Design

Array = NDArray[np.float64]
Designs = Sequence[Mapping[str, Any]]
THICKNESS = "resonator.thickness_mm"
QUANTITIES = ("frequency", "tcf")
FEWEST = 64  # cases from which training a basis costs less than solving each design
TOLERANCE = 1e-6  # of the basis against the full solve; hardly slower to train than a coarse one, and slopes need it
STEP_H = 2e-3  # relative step of the thickness, and step of ν, for the slopes that the TCF needs
STEP_NU = 2e-3
WHATEVER = 0.1  # amplitude of no shape
STEEPEST = 10.0  # change of the discretisation's error per e-fold of h, or unit of ν, over itself; 2 to 3 were seen
TEMPERATURES = 9  # at which the range of ν is looked at
PROPERTIES = ("youngs_modulus", "poisson_ratio", "density")


@dataclass(frozen=True)
class Families:
    """The families of a study by (harmonic, theory), and what it takes to evaluate its designs with them."""

    instrument: Instrument
    asked: tuple[tuple[str, "Options", int], ...]
    members: Mapping[tuple[int, str], Family]

    def evaluate(self, designs: Designs) -> list[Row]:
        """Evaluate a batch; where it contains a design that cannot be computed, each design for itself."""
        began = time.perf_counter()
        try:
            found = [FAST[name](self, options, designs) for name, options, _ in self.asked]
        except UNUSABLE_INPUT as error:
            if len(designs) > 1:
                return [row for design in designs for row in self.evaluate([design])]
            nothing = (float("nan"),) * sum(width for _, _, width in self.asked)
            return [Row("failed", str(error), nothing, nothing, time.perf_counter() - began)]
        values, errors = (np.concatenate([one[part] for one in found], axis=1).tolist() for part in (0, 1))
        each = (time.perf_counter() - began) / len(designs)
        return [Row("ok", "", tuple(v), tuple(e), each) for v, e in zip(values, errors, strict=True)]


@dataclass(frozen=True)
class _Bodies:
    """Designs as arrays (m,): thickness h and size R (m) at the reference temperature, growth, T (K), materials.

    wall : (m, 1) what a cup's wall has more than the card's, over the card's largest thickness; else (m, 0).
    stem : lengths of the stem over those that would go with the radius.
    """

    h: Array
    wall: Array
    R: Array
    stem: Array
    T: Array
    growth: Array
    E: Array
    nu: Array
    rho: Array
    materials: "list[Material]"


def why_not(study: "Study") -> str:
    """Return why a study cannot be computed through families, or nothing when it can."""
    allowed = {THICKNESS, TEMPERATURE, *(f"material.{key}" for key in ("name", "law", "file"))}
    allowed |= {f"material.{key}" for key in ("youngs_modulus_GPa", "poisson_ratio", "density_kg_m3")}
    if isinstance(study.instrument.keys("resonator"), Hemisphere):
        allowed.add("resonator.radius_mm")  # the one length beside the thickness
    for parameter in study.parameters:
        if parameter.name not in allowed:
            return f"the parameter '{parameter.name}' is none that a family follows"
    for asked in study.asked:
        if asked.quantity.name not in QUANTITIES or asked.options.get("index", 0):
            return f"the quantity '{asked.columns[0].name}' is none that a family gives"
        if asked.options["theory"] == "rayleigh" or asked.options["harmonic"] < 2:
            return "families are for theory solid or shell and harmonics from 2"
    return ""


def build_families(study: "Study", design: "Design") -> "Families | str":
    """Train the families that a study asks for, or say why it must be computed design by design.

    Parameters
    ----------
    study : the study.
    design : its designs; with the ends of the parameters they decide the ranges.
    """
    reason = why_not(study)
    if reason:
        return reason
    asked = tuple((one.quantity.name, one.options, len(one.columns)) for one in study.asked)
    try:
        bodies = _describe(study.instrument, _ends(study, design), None)
    except UNUSABLE_INPUT as error:
        return str(error).rstrip(".")
    resonator = study.instrument.resonator
    relative = bodies.h / bodies.R * resonator.size
    stem = (float(bodies.stem.min()), float(bodies.stem.max())) if resonator.stem else (1.0, 1.0)
    thickness = (float(relative.min()) * (1 - 2 * STEP_H), float(relative.max()) * (1 + 2 * STEP_H))
    nu = (float(bodies.nu.min()) - 2 * STEP_NU, float(bodies.nu.max()) + 2 * STEP_NU)
    members: dict[tuple[int, str], Family] = {}
    for _, options, _ in asked:
        key = (options["harmonic"], options["theory"])
        if key not in members:
            try:
                members[key] = build_family(
                    resonator,
                    thickness=thickness,
                    nu=nu,
                    shapes=_wall(study.instrument) if bodies.wall.any() else (),
                    amplitude=float(abs(bodies.wall).max(initial=0.0)) * (1 + 1e-9) or WHATEVER,
                    stem=stem,
                    harmonic=key[0],
                    theory=options["theory"],
                    tolerance=TOLERANCE,
                )
            except UNUSABLE_INPUT as error:
                return str(error).rstrip(".")
            if not members[key].cells:
                return members[key].reason.rstrip(".")
    return Families(study.instrument, asked, members)


def choose_solver(study: "Study", design: "Design") -> "Families | None":
    """Return the families where the spec asks for them or lets them be, None where every design is solved in full.

    Raises
    ------
    InputError
        The spec asks for families and the study cannot be computed with them.
    """
    wanted = study.sampling.solver
    if wanted == "full" or (wanted == "auto" and len(design.unique) < FEWEST):
        return None
    found = build_families(study, design)
    if isinstance(found, Families):
        return found
    if wanted == "family":
        raise InputError(f"solver = 'family' does not go: {found}. Take solver = 'full'.")
    return None


def _frequency(families: Families, options: "Options", designs: Designs) -> tuple[Array, Array]:
    bodies = _describe(families.instrument, designs, options["temperature_degC"])
    family = families.members[options["harmonic"], options["theory"]]
    found = _evaluate(family, bodies, bodies.h, bodies.nu, bodies.growth)
    error = found.frequency * (found.relative_error_estimate + found.theory_error)
    return found.frequency[:, None], error[:, None]


def _evaluate(family: Family, bodies: _Bodies, h: Array, nu: Array, growth: Array) -> FamilyResult:
    return family.evaluate(
        thickness=h * growth,
        shapes=bodies.wall[:, : family.shape_count],
        radius=bodies.R * growth,
        stem=bodies.stem,
        nu=nu,
        E=bodies.E,
        rho=bodies.rho,
    )


def _tcf(families: Families, options: "Options", designs: Designs) -> tuple[Array, Array]:
    """The five parts of d ln f/dT (HRG paper eq. 15), with the slopes of ln F by ν and ln h from differences."""
    bodies = _describe(families.instrument, designs, options["temperature_degC"])
    family = families.members[options["harmonic"], options["theory"]]

    def logarithm(h: Array, nu: Array) -> tuple[Array, Array]:
        found = _evaluate(family, bodies, h, nu, np.ones_like(h))
        return np.log(found.frequency), found.relative_error_estimate

    (thick, e1), (thin, e2) = (logarithm(bodies.h * (1 + sign * STEP_H), bodies.nu) for sign in (1, -1))
    (more, e3), (less, e4) = (logarithm(bodies.h, bodies.nu + sign * STEP_NU) for sign in (1, -1))
    level = STEEPEST * family.theory_error
    by_h, error_h = (thick - thin) / (np.log1p(STEP_H) - np.log1p(-STEP_H)), (e1 + e2) / (2 * STEP_H) + level
    by_nu, error_nu = (more - less) / (2 * STEP_NU), (e3 + e4) / (2 * STEP_NU) + level
    slopes: dict[tuple[int, float], tuple[float, float, float, float]] = {}
    for material, T in zip(bodies.materials, bodies.T.tolist(), strict=True):
        if (id(material), T) not in slopes:
            slopes[id(material), T] = _slopes(material, T)
    E, nu, rho, alpha = np.array(
        [slopes[id(material), T] for material, T in zip(bodies.materials, bodies.T.tolist(), strict=True)]
    ).T
    parts = np.stack([0.5 * E, by_nu * nu, -0.5 * rho, by_h * alpha, (-1 - by_h) * alpha], axis=1)
    nothing = np.zeros_like(E)
    of_parts = np.stack([nothing, error_nu * abs(nu), nothing, error_h * abs(alpha), error_h * abs(alpha)], axis=1)
    values = np.column_stack([parts.sum(axis=1), parts])
    # the parts of h and r add up to −alpha whatever the slope by h
    return 1e6 * values, 1e6 * np.column_stack([of_parts[:, 1], of_parts])


FAST = {"frequency": _frequency, "tcf": _tcf}


def _slopes(material: "Material", T: float) -> tuple[float, float, float, float]:
    return (
        float(material.log_slope("youngs_modulus", T)),
        float(material.slope("poisson_ratio", T)),
        float(material.log_slope("density", T)),
        float(material.value("expansion", T)),
    )


def _describe(instrument: Instrument, designs: Designs, temperature_degC: float | None) -> _Bodies:
    """Return designs as arrays; one material for all that share its parameters."""
    count, reference = len(designs), instrument.reference_temperature
    own = max(value for _, value in instrument.resonator.thickness)
    table = instrument.keys("resonator")
    cup = isinstance(table, Cylinder) and table.bottom_thickness_mm is not None
    h, wall = np.full(count, own), np.zeros((count, 0))
    if not cup:
        h = _column(designs, THICKNESS, 1e3 * own) * 1e-3
    elif THICKNESS in designs[0]:  # a cup's thickness is that of its wall
        wall = (_column(designs, THICKNESS, 0.0) - table.thickness_mm)[:, None] * 1e-3 / own
    at_card = getattr(table, "radius_mm", 1.0)
    enlarged = _column(designs, "resonator.radius_mm", at_card) / at_card
    if temperature_degC is None:
        T = _column(designs, TEMPERATURE, reference - ZERO_CELSIUS) + ZERO_CELSIUS
    else:
        T = np.full(count, temperature_degC + ZERO_CELSIUS)
    names = [name for name in designs[0] if name.startswith("material.")]
    groups: dict[tuple[Any, ...], list[int]] = {}
    for place, design in enumerate(designs):
        groups.setdefault(tuple(design[name] for name in names), []).append(place)
    constants = np.empty((4, count))
    materials: list[Material] = [instrument.material] * count
    for values, places in groups.items():
        material = set_parameters(instrument, dict(zip(names, values, strict=True))).material
        there = T[places]
        constants[:3, places] = [material.value(name, there) for name in PROPERTIES]
        constants[3, places] = material.growth(there, reference)
        for place in places:
            materials[place] = material
    E, nu, rho, growth = constants
    R = enlarged * instrument.resonator.size
    stem = 1 / enlarged if instrument.resonator.stem else np.ones(count)
    return _Bodies(h, wall, R, stem, T, growth, E, nu, rho, materials)


def _wall(instrument: Instrument) -> tuple[tuple[tuple[float, float], ...]]:
    """Return the shape that adds to the wall of a cup and not to its bottom."""
    foot = instrument.resonator.thickness[1][0]
    return (((0.0, 0.0), (foot, 0.0), (foot, 1.0), (1.0, 1.0)),)


def _column(designs: Designs, name: str, default: float) -> Array:
    if name not in designs[0]:
        return np.full(len(designs), float(default))
    return np.array([design[name] for design in designs], dtype=float)


def _ends(study: "Study", design: "Design") -> list[dict[str, Any]]:
    """Return designs at the ends of every parameter, which bound thickness over radius and ν of all designs."""
    temperatures = [one.options["temperature_degC"] for one in study.asked]
    fixed = [T for T in temperatures if T is not None]
    choices: dict[str, Sequence[Any]] = {}
    for k, p in enumerate(study.parameters):
        if isinstance(p.nominal, str):
            choices[p.name] = p.values
            continue
        low, high = (float(end) for end in (design.values[:, k].min(), design.values[:, k].max()))
        ends = (min(low, p.low, float(p.nominal)), max(high, p.high, float(p.nominal)))
        choices[p.name] = np.linspace(*ends, TEMPERATURES).tolist() if p.name == TEMPERATURE else ends
    reference = study.instrument.reference_temperature - ZERO_CELSIUS
    choices[TEMPERATURE] = [*choices.get(TEMPERATURE, [reference]), *fixed]
    return [dict(zip(choices, values, strict=True)) for values in product(*choices.values())]
