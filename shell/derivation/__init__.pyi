from .chain import DerivedCase, steps
from .design_code import emit_code
from .frequency import (
    bending_integral,
    log_derivatives,
    mass_integral,
    maximum_kinetic_energy,
    maximum_potential_energy,
    omega_squared,
)
from .inextensional import inextensional_mode, mode_deformation
from .strains import derive_deformation, layer_strains

__all__ = [
    "DerivedCase",
    "bending_integral",
    "derive_deformation",
    "emit_code",
    "inextensional_mode",
    "layer_strains",
    "log_derivatives",
    "mass_integral",
    "maximum_kinetic_energy",
    "maximum_potential_energy",
    "mode_deformation",
    "omega_squared",
    "steps",
]
