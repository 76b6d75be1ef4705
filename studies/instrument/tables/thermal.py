"""`[thermal]`: constants of the heat path from the chamber to the shell.

    [thermal]                               # every key may be left out
    film_emissivity = 0.03                  # effective, of each face of the shell; bare metal film 0.03, silica 0.8; relative ± 100 %
    base_heat_capacity_J_per_K = 25.0       # base with electrodes: about 34 g of silica; ± 50 %
    housing_heat_capacity_J_per_K = 70.0    # about 150 g of steel; ± 50 %
    chamber_conductance_W_per_K = 0.1       # moving air, 10 W/(m² K) on 100 cm²; ± 50 %
    mount_conductance_W_per_K = 0.0118      # base to housing; identified, see below; ± 50 %
    mount_exchange_cm2 = 10.0               # base to housing, area x effective emissivity; relative ± 100 %
    drive_power_mW = 0.0                    # heat of the vibration, spread over the shell
    radiation = true                        # false: linearised at the reference temperature
    cells = 24                              # of the shell's meridian; 1 makes it a lump
    stem_radius_mm, stem_length_mm          # of the card's stem; without one a sixth of the radius, and the radius
    conductivity_W_per_m_K, heat_capacity_J_per_kg_K   # of the material table unless given; ± 30 %, ± 10 %
    note = "..."                            # free text

Shell and stem follow from geometry and material. The mount's conductance is identified from the settling in the HRG
paper's Figure 3 (`studies.papers.settling`); capacities and the chamber's air are assumptions, and so are all the
uncertainties: what is known before a thermal record has been seen.
"""

from typing import Annotated

from studies.instrument.registry import CardTable
from studies.schema.keys import Keys, number

IDENTIFIED_MOUNT = 0.0118  # W/K, for the card hrg-30mm; see studies.papers.settling
Length = Annotated[float, number(above=0.0)]


class Thermal(Keys, frozen=True, kw_only=True):
    """Constants of the heat path; what is None follows from geometry and material."""

    film_emissivity: Annotated[float, number(least=0.0, most=1.0, relative_sd=1.0)] = 0.03
    base_heat_capacity_J_per_K: Annotated[float, number(above=0.0, relative_sd=0.5)] = 25.0
    housing_heat_capacity_J_per_K: Annotated[float, number(above=0.0, relative_sd=0.5)] = 70.0
    chamber_conductance_W_per_K: Annotated[float, number(above=0.0, relative_sd=0.5)] = 0.1
    mount_conductance_W_per_K: Annotated[float, number(above=0.0, relative_sd=0.5)] = IDENTIFIED_MOUNT
    mount_exchange_cm2: Annotated[float, number(least=0.0, relative_sd=1.0)] = 10.0
    drive_power_mW: Annotated[float, number(least=0.0)] = 0.0
    radiation: bool = True
    cells: Annotated[float, number(least=1.0, most=400.0)] = 24
    stem_radius_mm: Length | None = None
    stem_length_mm: Length | None = None
    conductivity_W_per_m_K: Annotated[float, number(above=0.0, relative_sd=0.3)] | None = None
    heat_capacity_J_per_kg_K: Annotated[float, number(above=0.0, relative_sd=0.1)] | None = None
    note: str = ""

    def __post_init__(self) -> None:
        if self.cells != int(self.cells):
            raise ValueError(f"cells must be a whole number, not {self.cells:g}.")


TABLE = CardTable("thermal", Thermal)
