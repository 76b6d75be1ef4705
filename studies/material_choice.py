"""Materials side by side for one geometry: frequency, its slope, heat loss, and how good a surface each deserves.

Of a mode n in one geometry the material sets f by E, ν and ρ, the slope by their courses, and the thermoelastic loss
1/Q_te (`shell.damping.thermoelastic`). A surface layer of depth d and loss φ adds 1/Q = S d φ, where S of a mode is the
share of its energy per depth; where a source states d φ it gives Q_surface, and d φ = 1/(Q_te S) is the layer whose loss
equals the thermoelastic one: a worse surface spoils what the material could give, a better one gains nothing.
"""

from math import isnan, nan
from typing import Any

import numpy as np

from shell.damping.budget import surface_cause, thermoelastic_cause
from shell.damping.faces import Vibration
from shell.damping.heat import Heat
from shell.damping.sources import known_losses
from shell.errors import ShellError
from shell.law import build_law
from shell.materials import Material, read_materials
from shell.modes import solve_modes
from shell.resonator import Resonator

HEAT = ("expansion", "conductivity", "heat_capacity")
FIGURES = (
    *("frequency_Hz", "frequency_sd_Hz", "slope_ppm_per_degC", "slope_sd_ppm_per_degC"),
    *("thermoelastic_q", "surface_q", "surface_layer_pm"),
)


def compare_materials(resonator: "Resonator", temperature: float, harmonic: int = 2) -> list[dict[str, Any]]:
    """Return the `FIGURES` of every law of the table at a temperature (K), by thermoelastic Q, and `remarks`; NaN where not known."""
    laws = [material for laws in read_materials().values() for material in laws.values()]
    rows = [
        {"material": material.name, "law": material.law, **dict.fromkeys(FIGURES, nan)}
        | _figures(resonator, material, temperature, harmonic)
        for material in laws
    ]
    return sorted(rows, key=lambda row: (-np.nan_to_num(row["thermoelastic_q"]), isnan(row["frequency_Hz"])))


def _figures(resonator: "Resonator", material: "Material", T: float, harmonic: int) -> dict[str, Any]:
    remarks = list(material.caveats)
    if absent := material.lacks:
        remarks.append(f"no source states its {', '.join(one.replace('_', ' ') for one in absent)}")
    found: dict[str, Any] = {"remarks": remarks}
    try:
        elastic = material.elastic(T)
    except ShellError as error:
        return found if absent else {"remarks": [*remarks, str(error)]}
    at = np.array([T])
    if "expansion" in absent:
        (mode,) = solve_modes(resonator, elastic, harmonic)
    else:
        law = build_law(resonator, material, T, T, T, harmonic=harmonic)
        mode = law.mode
        found["frequency_sd_Hz"] = float(law.uncertainty(at)[0]) * mode.frequency
        if not material.constant:
            found["slope_ppm_per_degC"] = 1e6 * float(law.slope(at)[0])
            found["slope_sd_ppm_per_degC"] = 1e6 * float(law.slope_uncertainty(at)[0])
    found["frequency_Hz"] = mode.frequency
    vibration = Vibration.of(mode, material, T)
    per_layer = float(surface_cause(1.0, 0.0, "").inverse_q(vibration, at)[0])
    if (surface := known_losses(material.name).get("surface")) is not None:
        found["surface_q"] = 1 / (surface["depth_m"] * per_layer)
    if not set(HEAT) & set(absent):
        alpha, k, c = (float(material.value(name, T)) for name in HEAT)
        sd = dict(zip(material.prior.names, material.prior.sd, strict=True)).get("expansion.value", 0.0)
        if abs(alpha) <= sd:
            remarks.append(f"expansion 0 within {1e9 * sd:.2g}e-9 1/K: no thermoelastic Q follows")
            return found
        heat = Heat(alpha, float(material.value("density", T)) * c, k)
        cause = thermoelastic_cause(vibration, lambda _: heat, (0.0, 0.0, 0.0), "")
        inverse = float(cause.inverse_q(vibration, at)[0])
        found |= {"thermoelastic_q": 1 / inverse, "surface_layer_pm": 1e12 * inverse / per_layer}
    return found
