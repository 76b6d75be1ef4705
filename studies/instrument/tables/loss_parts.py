"""`[loss]`, beside its polynomial: what a loss budget is made of, from which a simulation then takes 1/Q, Δ(1/τ) and its axis."""

from typing import Annotated, Literal

from shell.constants import zero_Celsius
from studies.instrument.registry import CardTable
from studies.schema.keys import Keys, number, says

Positive = Annotated[float, number(above=0.0)]
Share = Annotated[float, number(least=0.0, most=1.0)]
Gas = Literal["air", "nitrogen", "argon", "hydrogen"]
THICKNESS_WAVE = "relative amplitude of the circumferential wave 2n of its thickness (4θ for n = 2)"
BULK = "of the material's own loss c f^b, f in Hz; of the loss table unless given"
UNBALANCE = (
    "first harmonic Σ m exp(iθ) of the rim's mass, on a stem; masses of [[imperfection.mass]] on the rim count besides"
)


class FilmKeys(Keys, frozen=True, kw_only=True):
    """A film on the faces."""

    material: Annotated[str, says("of the table (gold, chromium, …), or with its own numbers", example="gold")]
    thickness_nm: Annotated[float, number("of the film", above=0.0, relative_sd=0.1, example=100.0)]
    loss: Annotated[float, number("its own loss angle; no source states that of an evaporated metal", least=0.0, relative_sd=1.0, example=0.0001)] | None = None  # fmt: skip
    face: Annotated[
        Literal["inner", "outer", "both"], says("of the shell; inner: towards the axis, of a flat disc the lower one")
    ] = "both"
    from_position: Annotated[Share, says("of the meridian, 0 … 1")] = 0.0
    to_position: Annotated[Share, says("likewise")] = 1.0
    coverage: Annotated[Share, says("covered share, of a pattern")] = 1.0
    anisotropy: Annotated[float, number(THICKNESS_WAVE, least=0.0, most=1.0, relative_sd=1.0, example=0.01)] | None = (
        None
    )
    anisotropy_angle_deg: Annotated[float, number("azimuth of its crest", sd=13.0)] = 0.0
    youngs_modulus_GPa: Annotated[Positive, says("of the film table unless given, as the next ones", example=80.0)] | None = None  # fmt: skip
    poisson_ratio: Annotated[float, number("of the film", above=-1.0, below=0.5, example=0.42)] | None = None
    expansion_per_K: Annotated[float, number("of the film", example=1.4e-05)] | None = None
    conductivity_W_per_m_K: Annotated[Positive, says("of the film", example=300.0)] | None = None
    heat_capacity_J_per_kg_K: Annotated[Positive, says("of the film", example=130.0)] | None = None
    density_kg_m3: Annotated[Positive, says("of the film", example=19300.0)] | None = None

    def __post_init__(self) -> None:
        if not self.from_position < self.to_position:
            raise ValueError(f"from_position ({self.from_position:g}) is not before to_position ({self.to_position:g}).")  # fmt: skip


class ActivatedKeys(Keys, frozen=True, kw_only=True):
    """A loss that heat activates."""

    height: Annotated[float, number("1/Q at the peak", least=0.0, relative_sd=0.5, example=1e-09)]
    energy_eV: Annotated[Positive, says("activation energy", example=0.5)]
    peak_degC: Annotated[float, number("of the peak, at the mode's frequency", above=-zero_Celsius, example=120.0)]


class LossParts(Keys, frozen=True, kw_only=True):
    """What a loss budget is made of beside geometry and material."""

    pressure_Pa: Annotated[float, number("gas sealed in, at the reference temperature", least=0.0, relative_sd=0.5, example=0.001)] | None = None  # fmt: skip
    gas: Annotated[Gas, says("in the housing")] = "air"
    accommodation: Annotated[Share, says("share of molecules that leave a wall diffusely")] = 1.0
    bulk_coefficient: Annotated[float, number(BULK, least=0.0, relative_sd=0.4, example=7.6e-12)] | None = None
    bulk_exponent: Annotated[float, number("b; of the loss table unless given", example=0.77)] | None = None
    surface_layer_pm: Annotated[float, number("depth times loss of the damaged surface; of the loss table unless given", least=0.0, relative_sd=0.2, example=5.2)] | None = None  # fmt: skip
    surface_treatment: Annotated[str, says("of the surface, as hrg materials NAME lists them; the best unless given", example="drawn")] | None = None  # fmt: skip
    surface_anisotropy: Annotated[float, number("wave 2n of the surface loss", least=0.0, most=1.0, relative_sd=1.0, example=0.01)] | None = None  # fmt: skip
    surface_anisotropy_angle_deg: Annotated[float, number("azimuth of its crest", sd=13.0)] = 0.0
    anchor_inverse_q: Annotated[float, number("loss through the mount", least=0.0, relative_sd=1.0, example=1e-09)] | None = None  # fmt: skip
    unbalance_mg: Annotated[float, number(UNBALANCE, least=0.0, relative_sd=0.5, example=0.1)] | None = None
    unbalance_azimuth_deg: Annotated[float, number("of that mass")] = 0.0
    third_unbalance_mg: Annotated[float, number("the third, Σ m exp(3iθ); both together damp the patterns unequally", least=0.0, relative_sd=0.5, example=0.1)] | None = None  # fmt: skip
    third_unbalance_azimuth_deg: Annotated[float, number("of that mass")] = 0.0
    film: tuple[FilmKeys, ...] = ()
    activated: tuple[ActivatedKeys, ...] = ()

    @property
    def given(self) -> bool:
        """Whether the card says anything of the parts."""
        return self != LossParts()


TABLE = CardTable("loss", LossParts, part="loss_parts")
