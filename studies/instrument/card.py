"""Cards: the description of one instrument, `schema = "hrg.card/1"`, parsed whole when loaded; `studies.instrument.tables` has the tables."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Generic, TypeAlias, TypeVar, cast

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from studies.errors import InputError, nearest
from studies.files.reading import find_shipped, list_shipped
from studies.files.writing import write_text
from studies.instrument.dotted import replaced
from studies.instrument.registry import CardPlace, ReadTable, card_tables, find_home, read_table
from studies.instrument.uncertain import UncertainValue
from studies.schema.keys import Keys, Note, number, says
from studies.schema.reader import read_keys, read_toml

if TYPE_CHECKING:
    from shell.elastic import Elastic
    from shell.material import Material
    from shell.resonator import Resonator
    from studies.instrument.tables.bias import Bias
    from studies.instrument.tables.effect import EffectEntry
    from studies.instrument.tables.law import PolynomialLaw
    from studies.instrument.tables.loop import Loop
    from studies.instrument.tables.loss import Loss
    from studies.instrument.tables.noise import NoiseKeys
    from studies.instrument.tables.thermal import Thermal
    from thermal.resonator import HeatPath

T = TypeVar("T")
SCHEMA = "hrg.card/1"
OF_GEOMETRY = ("resonator", "material", "thermal", "mount", "imperfection", "electrodes", "loop")
"""Tables that a card without geometry cannot have."""


class Head(Keys, frozen=True, kw_only=True):
    """The keys of a card outside its tables."""

    schema: Annotated[str, says("kind of file", example=SCHEMA)]
    name: Annotated[str, says("of the instrument", example="free-dome")]
    note: Note = ""
    reference_temperature_degC: Annotated[float, number("dimensions and given material values hold here", least=-200.0, most=200.0)] = 20.0  # fmt: skip


class Said(Generic[T]):
    """What a table of a card has become (`Instrument.part`), with its type."""

    def __init__(self, *names: str) -> None:
        self.names = names

    def __get__(self, card: "Instrument", _: object) -> T:
        found: T | None = card.part(*self.names)
        if found is None and self.names[0] in OF_GEOMETRY:
            raise InputError(f"{card.path}: this needs a card with [resonator] and [material]; this one has a polynomial ([law]) instead.")  # fmt: skip
        return cast("T", found)


@dataclass(frozen=True)
class Instrument:
    """One instrument: the typed parts of its card."""

    name: str
    reference_temperature: float  # dimensions and given material values hold here
    # mapping from table to `ReadTable`: What every table says; `part` and the properties below pick from it.
    tables: Mapping[str, ReadTable] = field(repr=False)
    note: str = field(default="", repr=False)
    # The card as written, in the units of its keys: for saving, hashing, and names of parameters only.
    content: Mapping[str, Any] = field(default_factory=dict, repr=False, compare=False)
    path: str = field(default="", compare=False)  # the file it came from

    resonator: ClassVar["Said[Resonator]"] = Said("resonator")  # at the reference temperature, SI units
    material: ClassVar["Said[Material]"] = Said("material")  # over temperature, SI units
    polynomial: ClassVar["Said[PolynomialLaw | None]"] = Said("law")  # None where the card has a geometry
    thermal: ClassVar["Said[Thermal]"] = Said("thermal")
    bias: ClassVar["Said[Bias]"] = Said("bias")
    loss: ClassVar["Said[Loss]"] = Said("loss")
    noise: ClassVar["Said[NoiseKeys]"] = Said("noise")
    effects: ClassVar["Said[tuple[EffectEntry, ...]]"] = Said("effect", "effects")

    def part(self, table: str, name: str = "") -> Any:
        """Return what a table of the card has become; `name` tells the parts of one table apart."""
        return self.tables[table].parts[name or table]

    def keys(self, table: str, name: str = "") -> Any:
        """Return the keys of a table as they stand in the card, with their defaults, in the units of their names."""
        return self.tables[table].keys[name or table]

    @property
    def is_imperfect(self) -> bool:
        """Whether the card says anything that could split a pair; else the resonator is a body of revolution."""
        own, electrodes = self.part("imperfection"), self.part("electrodes")
        return bool(own.fields is not None or own.split is not None or electrodes.are_charged)

    @property
    def loop(self) -> "Loop | None":
        """The loops that read the gyro; None where the card has no such table."""
        return self.part("loop") if "loop" in self.content else None

    @cached_property
    def heat_path(self) -> "HeatPath":
        """The heat path from the chamber to the cells of the shell, SI units; built once."""
        from studies.instrument.heat_path import build_heat_path

        where = f"{self.path} [thermal]"
        return build_heat_path(self.thermal, self.resonator, self.material, self.reference_temperature, where)

    @cached_property
    def uncertain(self) -> tuple[UncertainValue, ...]:
        """Every number of the card that is not exact, in the card's units: stated so, or by the documentation of its key."""
        from studies.instrument.material_values import uncertain_of_heat, uncertain_of_law

        tables = [value for table in self.tables.values() for value in table.uncertain]
        if self.polynomial is not None:
            return tuple(tables)
        law = uncertain_of_law(self.material, self.stated)
        return (*tables, *law, *uncertain_of_heat(self.material, self.thermal, self.reference_temperature))

    @cached_property
    def correlation(self) -> Mapping[tuple[str, str], float]:
        """Correlation of pairs of uncertain values, by the law's prior or as the card states; of other pairs, none."""
        from studies.instrument.material_values import correlations_of_law

        if self.polynomial is not None:
            return self.part("posterior").pairs  # type: ignore[no-any-return]
        by_law = correlations_of_law(self.material, {one.name for one in self.uncertain} - self.stated)
        return {**by_law, **self.part("posterior").pairs}

    def correlation_of(self, values: Sequence[UncertainValue]) -> Array:
        """Correlation matrix of some of its uncertain values, in their order."""
        R, place = np.eye(len(values)), {one.name: k for k, one in enumerate(values)}
        for (one, other), correlation in self.correlation.items():
            if one in place and other in place:
                R[place[one], place[other]] = R[place[other], place[one]] = correlation
        return R

    @property
    def stated(self) -> frozenset[str]:
        """Names of the numbers whose uncertainty the card itself states, exact ones among them."""
        return frozenset[str]().union(*(table.stated for table in self.tables.values()))

    def at(self, temperature: float) -> "tuple[Resonator, Elastic]":
        """Return the resonator, grown by its expansion, and its elastic constants at a uniform temperature (K)."""
        growth = float(self.material.growth(temperature, self.reference_temperature))
        return self.resonator.scaled(growth), self.material.elastic(temperature)

    def with_table(self, name: str, raw: Any) -> "Instrument":
        """Return a new instrument with one table of the card, as it would be written there, replaced or added."""
        return _reread(self, {**self.content, name: raw}, {name})

    def with_values(self, values: Mapping[str, Any]) -> "Instrument":
        """Return a new instrument with other values at dotted keys of the card; a number keeps the uncertainty, {"value", "sd"} replaces it."""
        content: Mapping[str, Any] = self.content
        for name, value in values.items():
            table = name.split(".")[0]
            if table not in card_tables():
                raise InputError(f"{self.path}: no table of a card has the key '{name}'{nearest(table, card_tables())}")
            try:
                content = replaced(content, name.split("."), value)
            except (LookupError, ValueError, TypeError):
                raise InputError(f"{self.path}: the card has no place '{name}'.") from None
        return _reread(self, content, {name.split(".")[0] for name in values}) if values else self

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in self.__dict__.items() if k not in ("heat_path", "uncertain", "correlation")}


Card: TypeAlias = Instrument | str | Path


def load_card(card: Card) -> Instrument:
    """Load a card by path, or by the bare name of one that ships with the package; an instrument is what it is."""
    if isinstance(card, Instrument):
        return card
    path = find_shipped(card, shipped_cards(), "card")
    return build_instrument(read_toml(path, SCHEMA), str(path))


def build_instrument(content: Mapping[str, Any], path: str = "card") -> Instrument:
    """Build an instrument from the content of a card; `path` is where material files are looked for, and in messages."""
    known = (*Head.__struct_fields__, *card_tables())
    for key in content:
        if key not in known:
            raise InputError(f"{path}: unknown key '{key}'{find_home(key) or nearest(key, known)}")
    head = read_keys({key: content[key] for key in Head.__struct_fields__ if key in content}, Head, path)
    reference = head.reference_temperature_degC + zero_Celsius
    bare = Instrument(head.name, reference, {}, head.note, content, path)
    return _reread(bare, content, set(card_tables()))


def save_card(card: Card, path: str | Path) -> None:
    """Write an instrument as a card, whole or not at all."""
    write_text(path, spell_card(load_card(card), path)[1])


def spell_card(instrument: Instrument, path: str | Path) -> tuple[dict[str, Any], str]:
    """Return the content and the text of a card that is to stand at a path; the files that it names are named from there."""
    import tomli_w

    content: dict[str, Any] = {"schema": SCHEMA, "name": instrument.name}
    content |= {key: value for key, value in instrument.content.items() if key not in content}

    def moved(table: Mapping[str, Any]) -> dict[str, Any]:
        own = (Path(instrument.path).parent / table["file"]).resolve()
        return {**table, "file": os.path.relpath(own, Path(path).resolve().parent)}

    if "file" in content.get("material", {}):
        content["material"] = moved(content["material"])
    maps = content.get("imperfection", {}).get("map", [])
    if maps:
        content["imperfection"] = {**content["imperfection"], "map": [moved(table) for table in maps]}
    return content, tomli_w.dumps(content)


def shipped_cards() -> dict[str, Path]:
    """Return name -> path of the cards that ship with the package."""
    return list_shipped(Path(str(files("studies"))) / "cards")


def _reread(instrument: Instrument, content: Mapping[str, Any], changed: set[str]) -> Instrument:
    folder = Path(instrument.path).parent
    tables = dict(instrument.tables)
    without = OF_GEOMETRY if "law" in content else ()
    for name in without:
        if name in content:
            raise InputError(f"{instrument.path} [{name}]: a card has either [law] or [{name}]; leave one of them out.")
    for name in card_tables():
        if name in ("resonator", "material") and name in without:
            tables[name] = ReadTable({name: None}, {name: None})
        elif name in changed:
            place = CardPlace(f"{instrument.path} [{name}]", folder, instrument.reference_temperature)
            read = read_table(name, content.get(name), place)
            tables[name] = replace(read, given=()) if name in without else read
    unknown = changed - set(tables)
    if unknown:
        raise InputError(f"{instrument.path}: unknown table '{min(unknown)}'{nearest(min(unknown), tables)}")
    return replace(instrument, tables=tables, content=content)
