"""`[material]`: an entry of the material table, or given values, which rescale the law of that name or are constant."""

from typing import TYPE_CHECKING, Annotated

import msgspec

from shell.errors import ShellError
from studies.errors import InputError, naming
from studies.instrument.registry import CardPlace, CardTable
from studies.schema.keys import Keys, Note, number, says

if TYPE_CHECKING:
    from shell.cubic import Cubic
    from shell.material import Material

STIFFEST = 2000.0  # GPa
LIGHTEST, HEAVIEST = 30.0, 30000.0  # kg/m³
GIVEN = {
    # key of the card: (property of the material, its unit here in SI)
    "youngs_modulus_GPa": ("youngs_modulus", 1e9),
    "poisson_ratio": ("poisson_ratio", 1.0),
    "density_kg_m3": ("density", 1.0),
}


ByValue = Annotated[
    float, number("a in a + b x + ½ c x², which is added to the property (log_value: to its logarithm)")
]
BySlope = Annotated[float, number("b in a + b x + ½ c x²; x = T − T_ref")]
ByCurvature = Annotated[float, number("c in a + b x + ½ c x²")]


class PropertyFactor(Keys, frozen=True, kw_only=True):
    """The property times exp(a + b x + ½ c x²), x = T − T_ref (K)."""

    log_value: ByValue = 0.0
    log_slope_per_K: BySlope = 0.0
    log_curvature_per_K2: ByCurvature = 0.0


class Difference(Keys, frozen=True, kw_only=True):
    """The property plus a + b x + ½ c x²."""

    value: ByValue = 0.0
    slope_per_K: BySlope = 0.0
    curvature_per_K2: ByCurvature = 0.0


class Deviation(Keys, frozen=True, kw_only=True):
    """What the material departs from its published law by."""

    shear_modulus: PropertyFactor | None = None
    youngs_modulus: PropertyFactor | None = None
    poisson_ratio: Difference | None = None
    density: PropertyFactor | None = None
    expansion: Difference | None = None
    conductivity: PropertyFactor | None = None
    heat_capacity: PropertyFactor | None = None

    @property
    def coefficients(self) -> dict[str, float]:
        """Coefficients by their names in `Material.with_coefficients`."""
        tables = {name: table for name in self.__struct_fields__ if (table := getattr(self, name)) is not None}
        return {f"{n}.{key}": v for n, table in tables.items() for key, v in msgspec.structs.asdict(table).items()}


class Crystal(Keys, frozen=True, kw_only=True):
    """Elastic constants of a cubic crystal."""

    C11_GPa: Annotated[float, number("of a cubic crystal, [001] along the axis; density_kg_m3 above", above=0.0)]
    C12_GPa: Annotated[float, number("likewise")]
    C44_GPa: Annotated[float, number("likewise", above=0.0)]


class MaterialKeys(Keys, frozen=True, kw_only=True):
    """The keys of `[material]`."""

    name: Annotated[str, says("of the material table, or of one's own with given values", example="fused-silica")]
    law: Annotated[str, says("which published temperature law")] = "default"
    file: (
        Annotated[str, says("a user's own material table, beside the card (hrg keys material)", example="mine.toml")]
        | None
    ) = None
    youngs_modulus_GPa: Annotated[float, number("at the reference temperature; rescales the law of a table's name", above=0.0, example=72.6)] | None = None  # fmt: skip
    poisson_ratio: Annotated[float, number("likewise", above=-1.0, below=0.5, example=0.17)] | None = None
    density_kg_m3: Annotated[float, number("likewise", above=0.0, example=2200.0)] | None = None
    crystal: Crystal | None = None
    deviation: Deviation | None = None
    note: Note = ""

    @property
    def cubic(self) -> "Cubic | None":
        """The crystal, SI units."""
        if self.crystal is None or self.density_kg_m3 is None:
            return None
        from shell.cubic import Cubic

        C11, C12, C44 = (1e9 * C for C in msgspec.structs.astuple(self.crystal))
        return Cubic(C11, C12, C44, self.density_kg_m3)

    @property
    def given(self) -> dict[str, float]:
        """The values that the card gives, by property, SI units."""
        if (cubic := self.cubic) is not None:
            mean = cubic.isotropic
            return {"youngs_modulus": mean.E, "poisson_ratio": mean.nu, "density": mean.rho}
        values = {name: (getattr(self, key), si) for key, (name, si) in GIVEN.items()}
        return {name: value * si for name, (value, si) in values.items() if value is not None}

    def __post_init__(self) -> None:
        if self.crystal is not None:
            if self.youngs_modulus_GPa is not None or self.poisson_ratio is not None:
                raise ValueError("a crystal has C11_GPa, C12_GPa and C44_GPa, no youngs_modulus_GPa or poisson_ratio.")
            if self.density_kg_m3 is None:
                raise ValueError("density_kg_m3 of the crystal is missing; add it.")
        E, rho = self.youngs_modulus_GPa, self.density_kg_m3
        if E is not None and E > STIFFEST:
            hint = f" It looks like pascal: write {E / 1e9:g}." if 1e-3 < E / 1e9 < STIFFEST else ""
            raise ValueError(f"youngs_modulus_GPa = {E:g}: no solid is stiffer than {STIFFEST:g} GPa.{hint}")
        if rho is not None and not LIGHTEST <= rho <= HEAVIEST:
            hint = f" It looks like g/cm³: write {rho * 1000:g}." if LIGHTEST <= rho * 1000 <= HEAVIEST else ""
            raise ValueError(f"density_kg_m3 = {rho:g}: a solid has {LIGHTEST:g} to {HEAVIEST:g} kg/m³.{hint}")


def build_material(keys: MaterialKeys, place: CardPlace) -> "Material":
    """Find the law, with the given values at the reference temperature."""
    from shell.material import constant_material
    from shell.materials import find_material, read_materials

    own = None if keys.file is None else place.folder / keys.file
    if own is not None:
        try:
            read_materials(own)
        except ShellError as error:  # it names the place in its own file
            raise InputError(str(error)) from None
    with naming(place.where):
        given = keys.given
        if own is None and given and keys.name not in read_materials():
            missing = [name for name, _ in GIVEN.values() if name not in given]
            if missing:
                raise InputError(
                    f"{place.where}: '{keys.name}' is not in the material table, so all of youngs_modulus_GPa, poisson_ratio and density_kg_m3 must be given; missing: {', '.join(missing)}."
                )
            material = constant_material(keys.name, **given)
        else:
            material = find_material(keys.name, keys.law, own).rescaled(place.reference_temperature, **given)
        return material if keys.deviation is None else material.with_coefficients(keys.deviation.coefficients)


TABLE = CardTable("material", MaterialKeys, build=build_material, required=True)
