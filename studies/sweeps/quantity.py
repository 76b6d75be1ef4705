"""Form of what a study can ask of a design: a class in a file of `quantities/` declares its keys, its columns and its value."""

from collections.abc import Iterable, Mapping, Sequence
from math import nan
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import msgspec

from studies.schema.keys import Keys, number, says
from studies.sweeps.case import TOLERANCE, Case

if TYPE_CHECKING:
    from shell.modes import Mode

SUFFIXES = {
    "Hz": "_Hz", "ppm/°C": "_ppm_per_degC", "°C": "_degC", "s": "_s", "°": "_deg", "g": "_g", "mm": "_mm",
    "°/h": "_deg_per_h", "°/√h": "_deg_per_rt_h", "Hz/µm": "_Hz_per_um", "ppb/g": "_ppb_per_g", "µrad/g": "_urad_per_g",
    "MPa": "_MPa", "1": "",
}  # fmt: skip


class Number(NamedTuple):
    """A computed value and the estimate of its own numerical error, in the column's unit; NaN where there is none."""

    value: float
    error: float = nan


class Column(NamedTuple):
    """One column of results: `stem` is its name without the unit's suffix, `label` what people read."""

    stem: str
    unit: str
    label: str

    @property
    def name(self) -> str:
        """The name in tables, with the unit that it carries."""
        return self.stem + SUFFIXES.get(self.unit, f"_{self.unit}")


class Quantity(Keys, frozen=True, kw_only=True, tag_field="name"):
    """A quantity that a study computes for every design; its fields are the keys of its `[[quantity]]` table."""

    label: Annotated[str, says("before the names of its columns, where a quantity is asked for twice")] = ""

    def list_columns(self) -> Sequence[Column]:
        """Return the columns that it fills, without its label."""
        raise NotImplementedError

    def evaluate(self, case: Case) -> Sequence[Number]:
        """Return one number for every column."""
        raise NotImplementedError

    @property
    def name(self) -> str:
        """What a spec calls it."""
        return str(self.__struct_config__.tag)

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns that it fills."""
        found = tuple(self.list_columns())
        if not self.label:
            return found
        return tuple(Column(f"{self.label}_{c.stem}", c.unit, f"{self.label}: {c.label}") for c in found)

    @property
    def options(self) -> Mapping[str, Any]:
        """Its keys by name, the label apart."""
        return {key: value for key, value in msgspec.structs.asdict(self).items() if key != "label"}


class HarmonicQuantity(Quantity, frozen=True, kw_only=True):
    """A quantity of one harmonic."""

    harmonic: Annotated[int, number("circumferential harmonic n", least=0, most=100)] = 2
    theory: Annotated[Literal["solid", "shell", "rayleigh"], says("solid (three-dimensional), shell (Naghdi) or rayleigh (closed form)")] = "solid"  # fmt: skip

    @property
    def place(self) -> int:
        """Which of the harmonic's modes it is of, 0 for the lowest."""
        return int(getattr(self, "index", 0))

    def list_modes(self) -> "Iterable[tuple[int, int, float]]":
        """Return what it solves at least: harmonic, number of modes, tolerance."""
        return [(self.harmonic, self.place + 1, TOLERANCE)]

    def stem(self, what: str) -> str:
        """Return such as frequency_n2, or frequency_n2_1 for a higher mode."""
        return f"{what}_n{self.harmonic}" + (f"_{self.place}" if self.place else "")

    @property
    def words(self) -> str:
        """Such as "n = 2", or "n = 2, mode 1" for a higher mode."""
        return f"n = {self.harmonic}" + (f", mode {self.place}" if self.place else "")


Temperature = Annotated[
    float, number("the parameter temperature_degC, else the card's reference, unless given", example=20.0)
]


class ModeQuantity(HarmonicQuantity, frozen=True, kw_only=True):
    """A quantity of one harmonic at one temperature."""

    temperature_degC: Temperature | None = None

    def mode(self, case: Case) -> "Mode":
        """Return the mode of a design."""
        return case.mode(self.harmonic, self.place, self.theory, case.temperature(self.temperature_degC))


class OvertoneQuantity(ModeQuantity, frozen=True, kw_only=True):
    """A quantity of one of the modes of a harmonic."""

    index: Annotated[int, number("0 for the lowest mode of the harmonic", least=0, most=20)] = 0
