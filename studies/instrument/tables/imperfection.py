"""`[imperfection]`: how the resonator differs from the body of revolution of `[resonator]`."""

from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from studies.errors import InputError
from studies.instrument.registry import CardPlace, CardTable
from studies.schema.keys import Keys, Note, number, says

if TYPE_CHECKING:
    from shell.imperfection import Field, Imperfection

LENGTHS = {"wall": "thickness", "outer": "outer", "inner": "inner", "offset": "offset", "rim": "rim"}
SHARES = {"density": "density", "modulus": "modulus"}


class WaveKeys(Keys, frozen=True, kw_only=True):
    """A wave around of a length or of a property of the material."""

    of: Annotated[Literal["wall", "outer", "inner", "offset", "rim", "density", "modulus"], says("offset: of the middle surface; rim: of its edge")] = "wall"  # fmt: skip
    order: Annotated[int, number("crests around", least=0, most=40, example=4)]
    amplitude_um: Annotated[float, number("of lengths", example=0.3)] | None = None
    amplitude_ppm: Annotated[float, number("of density and modulus", example=100.0)] | None = None
    azimuth_deg: Annotated[float, number("of a crest")] = 0.0
    power: Annotated[float, number("grows as position to this power, 0 where the meridian starts and 1 at the rim", least=0.0, most=40.0)] = 0.0  # fmt: skip

    def __post_init__(self) -> None:
        right, wrong = ("amplitude_um", "amplitude_ppm") if self.of in LENGTHS else ("amplitude_ppm", "amplitude_um")
        if getattr(self, right) is None or getattr(self, wrong) is not None:
            raise ValueError(f"a wave of '{self.of}' has {right}, and no {wrong}.")
        if self.amplitude_um is not None and abs(self.amplitude_um) > 1000:
            raise ValueError(f"amplitude_um = {self.amplitude_um:g} is more than a millimetre: it is in µm.")


class MassKeys(Keys, frozen=True, kw_only=True):
    """A small mass on the shell."""

    mass_ug: Annotated[float, number("negative where material was taken away", example=5.0)]
    azimuth_deg: Annotated[float, number("where it sits", example=31.0)]
    position: Annotated[float, number("0 ... 1 of the meridian", least=0.0, most=1.0)] = 1.0
    height: Annotated[float, number("-1 inner face, 0 middle, 1 outer face", least=-1.0, most=1.0)] = 0.0


class MapKeys(Keys, frozen=True, kw_only=True):
    """A table of measured departures."""

    of: Annotated[Literal["wall", "outer", "inner", "offset"], says("surface that departs; offset: the middle surface")]
    file: Annotated[str, says("µm over position and azimuth, beside the card (as for hrg scan)", example="outer.csv")]


class SplitKeys(Keys, frozen=True, kw_only=True):
    """A measured split of one harmonic."""

    harmonic: Annotated[int, number("waves around", least=1, most=12)] = 2
    split_Hz: Annotated[float, number("at the reference temperature, of any cause, besides", least=0.0, example=0.12)]
    slow_axis_deg: Annotated[float, number("azimuth of an antinode of the slower mode", example=31.0)]
    split_error_Hz: Annotated[float, number("standard error, along the axis and across", least=0.0)] = 0.0


WavePart = Annotated[float, number("of the wall, Σ c cos mθ + s sin mθ, in addition to the waves: for studies")]


class WallKeys(Keys, frozen=True, kw_only=True):
    """Parts of the wall's waves 1 to 4, even along the meridian."""

    cosine_1_um: WavePart = 0.0
    sine_1_um: WavePart = 0.0
    cosine_2_um: WavePart = 0.0
    sine_2_um: WavePart = 0.0
    cosine_3_um: WavePart = 0.0
    sine_3_um: WavePart = 0.0
    cosine_4_um: WavePart = 0.0
    sine_4_um: WavePart = 0.0

    def __post_init__(self) -> None:
        for name in self.__struct_fields__:
            if abs(getattr(self, name)) > 1000:
                raise ValueError(f"{name} = {getattr(self, name):g} is more than a millimetre: it is in µm.")

    @property
    def waves(self) -> dict[int, complex]:
        """Order to c + i s, m, of those that are not 0."""
        parts = {m: 1e-6 * complex(getattr(self, f"cosine_{m}_um"), getattr(self, f"sine_{m}_um")) for m in range(1, 5)}
        return {m: part for m, part in parts.items() if part}


class ImperfectionKeys(Keys, frozen=True, kw_only=True):
    """Departures from the body of revolution."""

    wave: tuple[WaveKeys, ...] = ()
    wall: WallKeys = WallKeys()
    mass: tuple[MassKeys, ...] = ()
    map: tuple[MapKeys, ...] = ()
    split: SplitKeys | None = None
    note: Note = ""


@dataclass(frozen=True)
class CardImperfection:
    """What a card says of its resonator's imperfection: fields and masses in SI units, and a measured split."""

    fields: "Imperfection | None"
    split: SplitKeys | None


@dataclass(frozen=True)
class Power:
    """A power of the position."""

    exponent: float

    def __call__(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return position**exponent."""
        return np.asarray(position**self.exponent)


def build(keys: ImperfectionKeys, place: CardPlace) -> CardImperfection:
    """Return the imperfection, its fields and masses in SI units."""
    if not (keys.wave or keys.mass or keys.map or keys.wall.waves):
        return CardImperfection(None, keys.split)
    from shell.imperfection import Field, Imperfection, PointMass

    gathered: dict[str, Any] = defaultdict(Field)
    for one in keys.wave:
        gathered[(LENGTHS | SHARES)[one.of]] += _wave(one)
    gathered["thickness"] += Field(tuple((m, c, ()) for m, c in keys.wall.waves.items()))
    for table in keys.map:
        gathered[LENGTHS[table.of]] += _map(table, place)
    masses = tuple(PointMass(1e-9 * m.mass_ug, np.deg2rad(m.azimuth_deg), m.position, m.height) for m in keys.mass)
    return CardImperfection(Imperfection(**gathered, masses=masses), keys.split)


def _wave(keys: WaveKeys) -> "Field":
    from shell.imperfection import wave

    size = 1e-6 * (keys.amplitude_um if keys.amplitude_um is not None else keys.amplitude_ppm or 0.0)
    one = wave(keys.order, size, np.deg2rad(keys.azimuth_deg))
    return one * Power(keys.power) if keys.power else one


def _map(keys: MapKeys, place: CardPlace) -> "Field":
    from shell.scan.survey import survey_map
    from studies.files.clouds import FaceGrid, read_cloud

    path = place.folder / keys.file
    grid = read_cloud(path)
    if not isinstance(grid, FaceGrid):
        raise InputError(f"{path}: {place.where} asks for a table over position and azimuth (hrg scan).")
    return survey_map(grid.position, grid.azimuth, grid.values, str(path)).field


TABLE = CardTable("imperfection", ImperfectionKeys, build=build, optional=True)
