"""`[loss]`, beside its polynomial: what a loss budget is made of. Every key may be left out; `hrg loss` shows the budget.

    [loss]
    pressure_Pa = 1e-3                  # gas sealed in, at the reference temperature; ± 50 %
    gas = "air"                         # air | nitrogen | argon | hydrogen
    accommodation = 1.0                 # share of molecules that leave a wall diffusely
    bulk_coefficient = 7.6e-12          # of the material's own loss c f^b, f in Hz; of the loss table unless given
    bulk_exponent = 0.77
    surface_layer_pm = 5.2              # depth times loss of the damaged surface; of the loss table unless given
    surface_anisotropy = 0.01           # wave 2n around of the surface's loss; relative ± 100 %
    surface_anisotropy_angle_deg = 0.0  # azimuth of its crest; ± 13
    anchor_inverse_q = 1e-9             # what leaves through the mount
    unbalance_mg = 0.1                  # first harmonic Σ m exp(iθ) of the rim's mass, on a stem; ± 50 %. Masses of
    unbalance_azimuth_deg = 0.0         # [[imperfection.mass]] on the rim count besides
    third_unbalance_mg = 0.0            # the third, Σ m exp(3iθ); ± 50 %. Both together damp the patterns unequally
    third_unbalance_azimuth_deg = 0.0

    [[loss.film]]                       # conducting films; a film of the table (gold, chromium, …) or with its own numbers
    material = "gold"
    thickness_nm = 100.0                # ± 10 %
    loss = 1e-4                         # its own loss angle; relative ± 100 %; no source states that of an evaporated metal
    face = "both"                       # inner | outer | both
    from_position = 0.0                 # of the meridian, 0 … 1
    to_position = 1.0
    coverage = 1.0                      # covered share, of a pattern
    anisotropy = 0.01                   # relative amplitude of the wave 2n of its thickness around (4θ for n = 2); relative ± 100 %
    anisotropy_angle_deg = 10.0         # azimuth of its crest; ± 13
    youngs_modulus_GPa, poisson_ratio, expansion_per_K, conductivity_W_per_m_K, heat_capacity_J_per_kg_K, density_kg_m3

    [[loss.activated]]                  # a Debye peak
    height = 1e-9                       # 1/Q at the peak; ± 50 %
    energy_eV = 0.5                     # activation energy
    peak_degC = 120.0                   # where it is at the mode's frequency

With any of these keys a simulation takes 1/Q from the budget and not from the polynomial, and with an anisotropy it takes Δ(1/τ)
and its axis from the parts and not from `[bias]`.
"""

from typing import Annotated, Literal

from shell.constants import zero_Celsius
from studies.instrument.registry import CardTable
from studies.schema.keys import Keys, number

Positive = Annotated[float, number(above=0.0)]
Share = Annotated[float, number(least=0.0, most=1.0)]
Gas = Literal["air", "nitrogen", "argon", "hydrogen"]


class FilmKeys(Keys, frozen=True, kw_only=True):
    """A film on the faces."""

    material: str
    thickness_nm: Annotated[float, number(above=0.0, relative_sd=0.1)]
    loss: Annotated[float, number(least=0.0, relative_sd=1.0)] | None = None
    face: Literal["inner", "outer", "both"] = "both"
    from_position: Share = 0.0
    to_position: Share = 1.0
    coverage: Share = 1.0
    anisotropy: Annotated[float, number(least=0.0, most=1.0, relative_sd=1.0)] | None = None
    anisotropy_angle_deg: Annotated[float, number(sd=13.0)] = 0.0
    youngs_modulus_GPa: Positive | None = None
    poisson_ratio: Annotated[float, number(above=-1.0, below=0.5)] | None = None
    expansion_per_K: float | None = None
    conductivity_W_per_m_K: Positive | None = None
    heat_capacity_J_per_kg_K: Positive | None = None
    density_kg_m3: Positive | None = None

    def __post_init__(self) -> None:
        if not self.from_position < self.to_position:
            raise ValueError(
                f"from_position ({self.from_position:g}) must lie before to_position ({self.to_position:g})."
            )


class ActivatedKeys(Keys, frozen=True, kw_only=True):
    """A loss that heat activates."""

    height: Annotated[float, number(least=0.0, relative_sd=0.5)]
    energy_eV: Positive
    peak_degC: Annotated[float, number(above=-zero_Celsius)]


class LossParts(Keys, frozen=True, kw_only=True):
    """What a loss budget is made of beside geometry and material."""

    pressure_Pa: Annotated[float, number(least=0.0, relative_sd=0.5)] | None = None
    gas: Gas = "air"
    accommodation: Share = 1.0
    bulk_coefficient: Annotated[float, number(least=0.0, relative_sd=0.4)] | None = None
    bulk_exponent: float | None = None
    surface_layer_pm: Annotated[float, number(least=0.0, relative_sd=0.2)] | None = None
    surface_anisotropy: Annotated[float, number(least=0.0, most=1.0, relative_sd=1.0)] | None = None
    surface_anisotropy_angle_deg: Annotated[float, number(sd=13.0)] = 0.0
    anchor_inverse_q: Annotated[float, number(least=0.0, relative_sd=1.0)] | None = None
    unbalance_mg: Annotated[float, number(least=0.0, relative_sd=0.5)] | None = None
    unbalance_azimuth_deg: float = 0.0
    third_unbalance_mg: Annotated[float, number(least=0.0, relative_sd=0.5)] | None = None
    third_unbalance_azimuth_deg: float = 0.0
    film: tuple[FilmKeys, ...] = ()
    activated: tuple[ActivatedKeys, ...] = ()

    @property
    def given(self) -> bool:
        """Whether the card says anything of the parts."""
        return self != LossParts()


TABLE = CardTable("loss", LossParts, part="loss_parts")
