"""`[material]`: an entry of the material table, or given values.

[material]
name = "fused-silica"       # an entry of the material table
law = "default"             # which published temperature law
file = "mine.toml"          # a user's own material table, beside the card
youngs_modulus_GPa, poisson_ratio, density_kg_m3   # given values at the reference temperature: with a table's name
# they rescale its law, with any other name they are constant
"""

from typing import TYPE_CHECKING, Annotated

from studies.errors import InputError, naming
from studies.instrument.keys import Table, number
from studies.instrument.registry import CardTable, Place

if TYPE_CHECKING:
    from shell.materials import Material

GIVEN = {
    # key of the card: (property of the material, its unit here in SI)
    "youngs_modulus_GPa": ("youngs_modulus", 1e9),
    "poisson_ratio": ("poisson_ratio", 1.0),
    "density_kg_m3": ("density", 1.0),
}


class MaterialKeys(Table, frozen=True, kw_only=True):
    """The keys of `[material]`."""

    name: str
    law: str = "default"
    file: str | None = None
    youngs_modulus_GPa: Annotated[float, number(above=0.0)] | None = None
    poisson_ratio: Annotated[float, number(above=-1.0, below=0.5)] | None = None
    density_kg_m3: Annotated[float, number(above=0.0)] | None = None
    note: str = ""


def build_material(keys: MaterialKeys, place: Place) -> "Material":
    """Find the law, with the given values at the reference temperature."""
    from shell.materials import constant_material, find_material, read_materials

    given = {name: getattr(keys, key) * si for key, (name, si) in GIVEN.items() if getattr(keys, key) is not None}
    own = None if keys.file is None else place.folder / keys.file
    with naming(place.where):
        if own is None and given and keys.name not in read_materials():
            missing = [name for name, _ in GIVEN.values() if name not in given]
            if missing:
                raise InputError(
                    f"{place.where}: '{keys.name}' is not in the material table, so all of youngs_modulus_GPa,"
                    f" poisson_ratio and density_kg_m3 must be given; missing: {', '.join(missing)}."
                )
            return constant_material(keys.name, **given)
        return find_material(keys.name, keys.law, own).rescaled(place.reference_temperature, **given)


TABLE = CardTable("material", MaterialKeys, build=build_material, required=True)
