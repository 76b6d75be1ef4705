"""Materials side by side for one geometry: frequency, its slope, heat loss, and how good a surface each deserves.

Of a mode n in one geometry the material sets f by E, ν and ρ, the slope by their courses, and the thermoelastic loss
1/Q_te (`shell.damping.thermoelastic`). A surface layer of depth d and loss φ adds 1/Q = S d φ, where S of a mode is the
share of its energy per depth; where a source states d φ it gives Q_surface, and d φ = 1/(Q_te S) is the layer whose loss
equals the thermoelastic one: a worse surface spoils what the material could give, a better one gains nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from shell.materials import Material
    from shell.resonator import Resonator

HEAT = ("expansion", "conductivity", "heat_capacity")


@dataclass(frozen=True)
class MaterialFigures:
    """One law of a material in one geometry; NaN where no source states what a figure needs.

    Attributes
    ----------
    frequency, frequency_sd : Hz
    slope, slope_sd : d ln f/dT, 1/K
    thermoelastic_q, surface_q : of each loss alone
    layer : m, d φ of the surface layer that loses as much as the heat flow
    remarks : what is not stated, taken as constant or as a mean
    """

    material: str
    law: str
    frequency: float
    frequency_sd: float
    slope: float
    slope_sd: float
    thermoelastic_q: float
    surface_q: float
    layer: float
    remarks: tuple[str, ...]


def compare_materials(
    resonator: "Resonator", temperature: float, harmonic: int = 2, progress: Callable[[str], None] = lambda _: None
) -> list[MaterialFigures]:
    """Return the figures of every law of the table at a temperature (K), by decreasing thermoelastic Q; what is not known last."""
    from shell.materials import read_materials

    found = []
    for laws in read_materials().values():
        for material in laws.values():
            progress(f"{material.name}, law {material.law}")
            found.append(_figures(resonator, material, temperature, harmonic))
    return sorted(found, key=lambda one: (-np.nan_to_num(one.thermoelastic_q), np.isnan(one.frequency)))


def _figures(resonator: "Resonator", material: "Material", T: float, harmonic: int) -> MaterialFigures:
    from shell.damping.budget import surface_cause, thermoelastic_cause
    from shell.damping.faces import Vibration
    from shell.damping.heat import Heat
    from shell.damping.sources import known_losses
    from shell.errors import ShellError
    from shell.law import build_law
    from shell.modes import solve_modes

    def unknown(why: str) -> MaterialFigures:
        return MaterialFigures(material.name, material.law, nan, nan, nan, nan, nan, nan, nan, (why,))

    try:
        material.elastic(T)
    except ShellError as error:
        if "no source states" not in str(error):
            return unknown(str(error))
        missing = [one for one in ("poisson_ratio", "density") if one not in material.properties]
        return unknown(f"no source states its {' and '.join(one.replace('_', ' ') for one in missing)}")
    lacking = [name for name in HEAT if name not in material.properties]
    at = np.array([T])
    remarks = list(material.caveats)
    if lacking:
        remarks.append(f"no source states its {', '.join(one.replace('_', ' ') for one in lacking)}")
    spread = slope = slope_sd = surface_q = heat_q = layer = nan
    if "expansion" in lacking:
        (mode,) = solve_modes(resonator, material.elastic(T), harmonic)
    else:
        law = build_law(resonator, material, T, T, T, harmonic=harmonic)
        mode, spread = law.mode, float(law.uncertainty(at)[0])
        if not material.constant:
            slope, slope_sd = float(law.slope(at)[0]), float(law.slope_uncertainty(at)[0])
    vibration = Vibration.of(mode, material, T)
    per_layer = float(surface_cause(1.0, 0.0, "").inverse_q(vibration, at)[0])
    if (surface := known_losses(material.name).get("surface")) is not None:
        surface_q = 1 / (surface["depth_m"] * per_layer)
    if not lacking:
        alpha, k, c = (float(material.value(name, T)) for name in HEAT)
        sd = dict(zip(material.prior.names, material.prior.sd, strict=True)).get("expansion.value", 0.0)
        if abs(alpha) > sd:
            heat = Heat(alpha, float(material.value("density", T)) * c, k)
            cause = thermoelastic_cause(vibration, lambda _: heat, (0.0, 0.0, 0.0), "")
            heat_q = 1 / float(cause.inverse_q(vibration, at)[0])
            layer = 1 / (heat_q * per_layer)
        else:
            remarks.append(f"expansion 0 within {1e9 * sd:.2g}e-9 1/K: no thermoelastic Q follows")
    return MaterialFigures(
        material.name, material.law, mode.frequency, spread * mode.frequency, slope, slope_sd, heat_q, surface_q, layer,
        tuple(remarks),
    )  # fmt: skip
