"""Cards: the description of one instrument, `schema = "hrg.card/1"`.

A card names the resonator's geometry at the reference temperature and its material; the optional tables `[thermal]`,
`[bias]`, `[loss]`, `[noise]` and `[[effect]]` extend it, and are checked by the part that reads them.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.errors import InputError, naming
from studies.files.reading import find_shipped, list_shipped
from studies.files.toml import Section, check_number, read_toml
from studies.files.writing import write_text

if TYPE_CHECKING:
    from shell.elastic import Elastic
    from shell.materials import Material
    from shell.resonator import Resonator

SCHEMA = "hrg.card/1"
ZERO_CELSIUS = 273.15
KEYS = (
    "schema",
    "name",
    "note",
    "reference_temperature_degC",
    "resonator",
    "material",
    "thermal",
    "bias",
    "loss",
    "noise",
    "effect",
)
MATERIAL_KEYS = ("name", "law", "file", "youngs_modulus_GPa", "poisson_ratio", "density_kg_m3")


@dataclass(frozen=True)
class Instrument:
    """One instrument: its card's content, and the resonator and material that follow from it.

    Attributes
    ----------
    name : str
    reference_temperature : float, K
        Dimensions and given material values hold here.
    content : mapping
        The card as read, in the units of its keys.
    path : str
        The file it came from.
    """

    name: str
    reference_temperature: float
    content: Mapping[str, Any] = field(repr=False)
    path: str = ""

    @cached_property
    def resonator(self) -> "Resonator":
        """The resonator at the reference temperature."""
        from studies.instrument.resonator import build_resonator

        return build_resonator(self.content["resonator"], f"{self.path} [resonator]")

    @cached_property
    def material(self) -> "Material":
        """The material over temperature."""
        return _build_material(self.content["material"], self.path, self.reference_temperature)

    def at(self, temperature: float) -> "tuple[Resonator, Elastic]":
        """Return the resonator, grown by its expansion, and its elastic constants at a uniform temperature (K)."""
        growth = float(self.material.growth(temperature, self.reference_temperature))
        return self.resonator.scaled(growth), self.material.elastic(temperature)

    @property
    def effects(self) -> Sequence[Mapping[str, Any]]:
        """The `[[effect]]` tables that extend the model."""
        return list(self.content.get("effect", []))

    def table(self, name: str) -> Mapping[str, Any]:
        """Return one of the optional tables (`thermal`, `bias`, `loss`, `noise`); empty when the card has none."""
        found = self.content.get(name, {})
        if not isinstance(found, Mapping):
            raise InputError(f"{self.path}: {name} must be a table ([{name}]).")
        return found

    def with_table(self, name: str, content: Any) -> "Instrument":
        """Return a new instrument with one table replaced or added."""
        return replace(self, content={**self.content, name: content})


def load_card(card: str | Path) -> Instrument:
    """Load a card by path, or by the bare name of one that ships with the package.

    Raises
    ------
    InputError
        No such card, an unknown key, a value of the wrong type or out of its range.
    """
    path = find_shipped(card, shipped_cards(), "card")
    content = read_toml(path, SCHEMA)
    top = Section(content, str(path), KEYS)
    reference = top.number("reference_temperature_degC", 20.0, least=-200.0, most=200.0) + ZERO_CELSIUS
    instrument = Instrument(top.text("name"), reference, content, str(path))
    for name in ("resonator", "material"):
        if not isinstance(top.raw(name), Mapping):
            raise InputError(f"{path}: {name} must be a table ([{name}]).")
    for name in ("thermal", "bias", "loss", "noise"):
        instrument.table(name)
    top.text("note", "-")
    for number, effect in enumerate(top.raw("effect", []), 1) if isinstance(top.raw("effect", []), list) else []:
        if not isinstance(effect, Mapping) or not isinstance(effect.get("name"), str):
            raise InputError(f'{path} [[effect]] number {number}: the line name = "..." is missing; add it.')
    if not isinstance(top.raw("effect", []), list):
        raise InputError(f"{path}: effect must be an array of tables ([[effect]]).")
    _ = instrument.material, instrument.resonator
    return instrument


def save_card(instrument: Instrument, path: str | Path) -> None:
    """Write an instrument as a card, whole or not at all."""
    import tomli_w

    content = {**instrument.content, "schema": SCHEMA, "name": instrument.name}
    if "file" in content["material"]:
        own = (Path(instrument.path).parent / content["material"]["file"]).resolve()
        moved = os.path.relpath(own, Path(path).resolve().parent)
        content["material"] = {**content["material"], "file": moved}
    write_text(path, tomli_w.dumps(content))


def shipped_cards() -> dict[str, Path]:
    """Return name -> path of the cards that ship with the package."""
    return list_shipped(Path(str(files("studies"))) / "cards")


def _build_material(table: Mapping[str, Any], path: str, reference: float) -> "Material":
    from shell.materials import constant_material, find_material, read_materials

    section = Section(table, f"{path} [material]", MATERIAL_KEYS)
    name = section.text("name")
    given = {
        key: check_number(table[source], f"{section.where}: {source}", above=0.0 if key != "poisson_ratio" else None)
        * factor
        for key, source, factor in (
            ("youngs_modulus", "youngs_modulus_GPa", 1e9),
            ("poisson_ratio", "poisson_ratio", 1.0),
            ("density", "density_kg_m3", 1.0),
        )
        if source in table
    }
    if "poisson_ratio" in given and not -1 < given["poisson_ratio"] < 0.5:
        raise InputError(f"{section.where}: poisson_ratio must lie between -1 and 0.5, not {given['poisson_ratio']:g}.")
    own = Path(path).parent / section.text("file") if "file" in section else None
    law = section.text("law", "default")
    with naming(section.where):
        if own is None and name not in read_materials() and given:
            missing = [k for k in ("youngs_modulus", "poisson_ratio", "density") if k not in given]
            if missing:
                raise InputError(
                    f"{section.where}: '{name}' is not in the material table, so all of youngs_modulus_GPa,"
                    f" poisson_ratio and density_kg_m3 must be given; missing: {', '.join(missing)}."
                )
            return constant_material(name, **given)
        return find_material(name, law, own).rescaled(reference, **given)
