"""`[thermal]`: constants of the heat path; the mount's from HRG paper Figure 3 (`studies.papers.settling`), the rest assumed."""

from typing import Annotated

from studies.instrument.registry import CardTable
from studies.schema.keys import Keys, Note, number, says

IDENTIFIED_MOUNT = 0.0120  # W/K, for the card hrg-30mm: leaves 5 % of a step at 9 000 s, as its paper says of Figure 3
Length = Annotated[float, number(above=0.0)]


class Thermal(Keys, frozen=True, kw_only=True):
    """Constants of the heat path; what is None follows from geometry and material."""

    film_emissivity: Annotated[float, number("effective, of each face of the shell; bare metal film 0.03, silica 0.8", least=0.0, most=1.0, relative_sd=1.0)] = 0.03  # fmt: skip
    film_housing_share: Annotated[float, number("of the shell's radiation, with the housing, past the base", least=0.0, most=1.0, sd=0.3)] = 0.0  # fmt: skip
    base_heat_capacity_J_per_K: Annotated[float, number("with electrodes: 34 g of silica", above=0.0, relative_sd=0.5)] = 25.0  # fmt: skip
    base_capacity_slope_per_K: Annotated[float, number("relative, of that about 20 °C; 2e-3 of silica, 0.5e-3 of metals", least=-5e-3, most=5e-3, sd=1e-3)] = 0.0  # fmt: skip
    housing_heat_capacity_J_per_K: Annotated[float, number("about 150 g of steel", above=0.0, relative_sd=0.5)] = 70.0
    chamber_conductance_W_per_K: Annotated[float, number("air, 10 W/(m² K) on 100 cm²", above=0.0, relative_sd=0.5)] = 0.1  # fmt: skip
    mount_conductance_W_per_K: Annotated[
        float,
        number("base to housing; identified from the settling of the HRG paper's Figure 3", above=0.0, relative_sd=0.5),
    ] = IDENTIFIED_MOUNT
    mount_exchange_cm2: Annotated[float, number("area × emissivity, base to housing", least=0.0, relative_sd=1.0)] = (
        10.0
    )
    second_mass_J_per_K: Annotated[float, number("of a part that hangs on the base, with its conductance", above=0.0, relative_sd=1.0, example=5.0)] | None = None  # fmt: skip
    second_mass_conductance_W_per_K: Annotated[float, number("base to that part", above=0.0, relative_sd=1.0, example=0.002)] | None = None  # fmt: skip
    drive_power_mW: Annotated[float, number("heat of the vibration, spread over the shell", least=0.0)] = 0.0
    radiation: Annotated[bool, says("false: linearised at the reference temperature; heat capacities are not")] = True
    cells: Annotated[float, number("of the shell's meridian; 1 makes it a lump", least=1.0, most=400.0)] = 24
    stem_radius_mm: Annotated[Length, says("of the card's stem; without one a sixth of the radius", example=2.5)] | None = None  # fmt: skip
    stem_length_mm: Annotated[Length, says("of the card's stem; without one the radius", example=10.0)] | None = None
    conductivity_W_per_m_K: Annotated[float, number("of the material table unless given", above=0.0, relative_sd=0.3, example=1.38)] | None = None  # fmt: skip
    heat_capacity_J_per_kg_K: Annotated[float, number("of the material table unless given", above=0.0, relative_sd=0.1, example=740.0)] | None = None  # fmt: skip
    note: Note = ""

    def __post_init__(self) -> None:
        if self.cells != int(self.cells):
            raise ValueError(f"cells must be a whole number, not {self.cells:g}.")
        if (self.second_mass_J_per_K is None) != (self.second_mass_conductance_W_per_K is None):
            raise ValueError(
                "second_mass_J_per_K and second_mass_conductance_W_per_K go together; give both or neither."
            )


TABLE = CardTable("thermal", Thermal)
