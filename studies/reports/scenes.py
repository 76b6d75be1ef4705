"""Pictures of an instrument's mode: the solved mode, its surface and colour, and the view to turn that a page shows of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from shell.constants import zero_Celsius
from shell.layout import Theory
from shell.resonator import Resonator
from shell.scene import Scene, compose_scene
from shell.still import draw_still
from shell.surface import Surface, build_surface
from studies.errors import InputError
from studies.instrument.card import Instrument
from studies.results import Blocks, Chapter

if TYPE_CHECKING:
    from shell.imperfection import Imperfection, Split
    from shell.modes import Mode
    from studies.results.page import Block
    from studies.sweeps.expressions import Derived

Colour = Literal["displacement", "energy", "temperature"]
FIELD_COLUMNS = ("position", "temperature_degC")
LEGENDS = {
    "displacement": "displacement (µm, for 1 µm at the antinode)",
    "energy": "strain-energy density (J/m³, for 1 µm at the antinode)",
    "temperature": "temperature (°C)",
}
MICROMETRE = 1e-6
ShellTemperature = Callable[[Array], Array]
"""A temperature (°C) over the position 0 ... 1 along the meridian."""


@dataclass(frozen=True, eq=False)
class ModeScene:
    """A mode of an instrument at one temperature with the surface of the resonator."""

    instrument: Instrument
    temperature: float
    resonator: Resonator
    mode: "Mode"
    surface: Surface
    split: "Split | None" = None
    exaggeration: float = 0.0

    @property
    def imperfection(self) -> "Imperfection | None":
        """What its shape departs by."""
        from shell.imperfection import Pair

        fields = self.instrument.part("imperfection").fields if self.split is not None else None
        return None if fields is None else fields.faded(Pair(self.mode).fade)

    @property
    def frequency(self) -> float:
        """Of the mode that is shown, Hz: of a split pair the slower one's, to first order."""
        return self.mode.frequency if self.split is None else self.split.frequencies[0]

    @property
    def title(self) -> str:
        """Name, harmonic, frequency and temperature in one line; of a split pair the split, and how its shape is exaggerated."""
        kind = f" ({self.mode.label})" if self.mode.label else ""
        celsius = self.temperature - zero_Celsius
        line = f"{self.instrument.name}, n = {self.mode.harmonic}{kind}, {self.frequency:.2f} Hz at {celsius:g} °C"
        if self.split is None:
            return line
        departures = f", departures x {self.exaggeration:.0f}" if self.exaggeration > 1 else ""
        return f"{line}\nslower mode of a pair, the faster {self.split.frequencies[1]:.2f} Hz, split {1e3 * self.split.hertz:.4g} mHz{departures}"

    def values(self, colour: Colour, field: ShellTemperature | None = None) -> Array:
        """Return the coloured quantity on every vertex, in the unit of its legend."""
        if colour == "displacement":
            return np.asarray(np.linalg.norm(self.surface.displacement, axis=1))
        if colour == "energy":
            return self.surface.energy * MICROMETRE**2
        if field is None:
            raise InputError("the colour 'temperature' needs a field along the meridian: give --field FIELD.csv.")
        return field(self.surface.position)

    def scene(self, colour: Colour = "displacement", field: ShellTemperature | None = None) -> Scene:
        """Return the scene for `shell.render`."""
        axes, marks = None, ""
        if self.split is not None:
            from shell.imperfection.surface import draw_axes

            axes, marks = draw_axes(self.surface, self.split.slow_axis), ", 0° and 90°: azimuth"
        return compose_scene(self.surface, self.values(colour, field), LEGENDS[colour], self.title + marks, axes)

    def colours(self, colour: Colour = "displacement", field: ShellTemperature | None = None) -> NDArray[np.uint8]:
        """Return the colour of every vertex (N, 4) as bytes, cividis between the smallest and the largest value."""
        import matplotlib as mpl

        values = self.values(colour, field)
        top = np.percentile(values, 99.5) if colour == "energy" else values.max()
        span = (top - values.min()) or 1.0
        scaled = np.clip((values - values.min()) / span, 0, 1)
        return np.asarray(mpl.colormaps["cividis"](scaled, bytes=True), dtype=np.uint8)


def show_mode(
    instrument: Instrument, harmonic: int = 2, index: int = 0, temperature: float | None = None,
    theory: Literal["solid", "shell"] = "solid", exaggerated: bool = True,
) -> ModeScene:  # fmt: skip
    """Solve one mode (at K, or the reference) and build its surface; of an imperfect card the slower mode, departures `exaggerated` or not."""
    from shell.modes import solve_modes

    T = instrument.reference_temperature if temperature is None else temperature
    resonator, elastic = instrument.at(T)
    mode = solve_modes(resonator, elastic, harmonic, index + 1, theory, tolerance=1e-4)[index]
    surface = build_surface(resonator, mode)
    if harmonic < 1 or not instrument.is_imperfect:
        return ModeScene(instrument, T, resonator, mode, surface)
    from shell.imperfection.surface import depart_surface, turn_surface
    from studies.resonator.splitting import SplitPair

    split = SplitPair(instrument, mode, T).split
    scene = ModeScene(instrument, T, resonator, mode, turn_surface(surface, split.slow_axis), split)
    if scene.imperfection is None:
        return scene
    surface, factor = depart_surface(scene.surface, resonator, scene.imperfection, exaggerated)
    return replace(scene, surface=surface, exaggeration=factor)


def live_chapter(
    instrument: Instrument, harmonic: int, theory: Theory, view: "Callable[[], list[Block]] | None" = None,
    anchor: bool = False,
) -> Chapter:  # fmt: skip
    """Return a mode that swings and sliders that move it; of Rayleigh's closed form the `view` alone, where there is one."""
    live = Blocks(lambda: moving_mode(instrument, harmonic, theory, view=view, anchor=anchor))  # type: ignore[arg-type]
    still = Blocks(view) if view else None
    return Chapter("Mode shape over dimensions and temperature", [still if theory == "rayleigh" else live])


def moving_mode(
    instrument: Instrument, harmonic: int = 2, theory: Literal['solid', 'shell'] = "solid", names: Sequence[str] = (),
    derived: "Sequence[Derived]" = (), view: "Callable[[], list[Block]] | None" = None, anchor: bool = False,
) -> "list[Block]":  # fmt: skip
    """Return the view of the lowest mode of a harmonic, or the `view` that a page has of it and others, and sliders that move it."""
    from studies.reports.live import live_blocks

    shown = view() if view else view_blocks([show_mode(instrument, harmonic, theory=theory)])
    return [*shown, *live_blocks(instrument, harmonic, theory, names, derived, anchor)]


def read_field(path: str | Path) -> ShellTemperature:
    """Read a temperature along the meridian, linear between the rows of a table `position,temperature_degC` with rising positions."""
    from studies.files.columns import read_columns

    table = read_columns(path, FIELD_COLUMNS, required=FIELD_COLUMNS)
    position, temperature = (table.values[name] for name in FIELD_COLUMNS)
    table.require(FIELD_COLUMNS, "a temperature field")
    if (np.diff(position) <= 0).any() or position[0] < 0 or position[-1] > 1:
        raise InputError(f"{path}: position must rise within 0 (start of the meridian) to 1 (rim).")
    return lambda at: np.interp(at, position, temperature)


THEORIES = {
    "solid": "three-dimensional elasticity",
    "shell": "Naghdi shell theory",
    "rayleigh": "Rayleigh's closed form",
}


def mode_blocks(instrument: Instrument, harmonics: Sequence[int] = (2, 3)) -> "list[Block]":
    """Return the interactive view of the lowest mode of each harmonic, with the picture of the first one behind it."""
    return view_blocks([show_mode(instrument, n) for n in harmonics])


def view_blocks(shown: Sequence[ModeScene], remark: str = "") -> "list[Block]":
    """Return the interactive view of modes of one instrument at one temperature."""
    from studies.reports.webgl import Drawn, view_modes

    first = shown[0]
    caption = (
        f"{first.instrument.name} at {first.temperature - zero_Celsius:g} °C: mode shapes of {THEORIES[first.mode.theory]}, on the solid"
        f" of the card with its thickness, rim and stem. The displacement is exaggerated.{remark}"
    )
    for one in shown:
        if one.split is not None:
            times = f"{one.exaggeration:.0f} times as large"
            larger = f"; the departures of the shape are drawn {times}" if one.exaggeration else ""
            caption += f" n = {one.mode.harmonic}: the slower mode of the pair, which is split by {1e3 * one.split.hertz:.4g} mHz, on its axis at an azimuth of {degrees(one.split.slow_axis):.4g}° (from the x axis towards y){larger}."
    lobes = 2 * first.mode.harmonic
    alt = f"The resonator with its rim bent into {lobes} lobes, nodes between them."
    splits = [None if one.split is None else Drawn(one.split, one.imperfection, one.exaggeration) for one in shown]
    modes, still = [one.mode for one in shown], draw_still(first.scene())
    return [view_modes(first.resonator, modes, first.title, still, alt, caption, splits)]
