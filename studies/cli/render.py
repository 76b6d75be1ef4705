"""`hrg render`: a mode shape as picture, animation, interactive page or mesh.

`frequency_Hz` in the JSON is that of the mode that is shown. Of an imperfect card that is the slower one of the pair, and `split` has `slow_Hz`, `fast_Hz`,
`split_Hz` and `slow_axis_deg`, the azimuth of an antinode, from the card's x axis (0°) towards its y axis (90°); all to first order.
"""

from collections.abc import Sequence
from functools import partial
from math import degrees
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from shell.constants import zero_Celsius
from shell.mesh import encode_animation, encode_mesh
from shell.scene import EXAGGERATION
from studies.cli.arguments import MANY, POSITIVE, WHOLE, Out, Theory, ending_of
from studies.cli.output import answers
from studies.errors import InputError, MissingEnvironment
from studies.files.writing import written_whole
from studies.instrument.card import load_card
from studies.progress import tell
from studies.reports.scenes import Colour, ModeScene, ShellTemperature, read_field, show_mode, view_blocks
from studies.results import Blocks, Chapter, Result, Sentence, Table, row_of
from studies.results.page import render_result

PICTURES = (".png", ".webp", ".gif")
KINDS = (*PICTURES, ".html", ".glb", ".stl", ".ply")
View = Literal["oblique", "axis", "side"]
HIDDEN = Parameter(show_default=False)
MOST = 4  # resonators in one picture
MODE = "harmonic: n | index | frequency_Hz: f (Hz) .4f | split.fast_Hz: faster (Hz) .4f | split.slow_axis_deg: slow axis (°) .2f"


@answers("hrg.render/1")
def render(
    *card: str,
    out: Out,
    harmonic: Annotated[tuple[int, ...], MANY, HIDDEN] = (2,),
    index: Annotated[int, WHOLE] = 0,
    temperature: Annotated[tuple[float, ...], MANY, HIDDEN] = (),
    theory: Theory = "solid",
    colour: Colour = "displacement",
    field: str | None = None,
    view: View = "oblique",
    swing_mm: Annotated[float | None, POSITIVE] = None,
) -> Result:
    """Show a mode shape: the real solid, its nodes (red) and antinodes (black dots), the undeformed shape in grey.

    The extension of --out selects the format: .png a picture, .webp or .gif a looping animation, .html an interactive page that works
    offline, .glb an animated mesh, .stl or .ply the solid for slicers, in mm.
    A card with an imperfection shows the slower mode of the split pair on its axis, its imperfections exaggerated in
    pictures and to scale in .stl and .ply; lines across the rim are the axes of the slower (blue) and the faster mode (orange), and the azimuths 0° (x axis) and 90° (y axis) of
    the card are marked: seen into a shell that opens downwards, as --view axis does, azimuths run clockwise.
    Several cards, or one card at several temperatures, stand side by side in pictures and animations on one scale.
    A PNG, WebP or GIF needs OpenGL; without it the exit status is 3 and the message says what to install.

    Args:
        card: Cards by path, or the names of built-in ones (hrg cards).
        harmonic: Circumferential harmonic n, 2 unless given; several only for .html, which lets you choose among them.
        index: 0 for the lowest mode of its harmonic.
        temperature: Temperature of the resonator in °C; the card's reference temperature unless given.
        colour: What the colour shows: displacement, strain-energy density, or a temperature field.
        field: Table with position (0 ... 1 along the meridian) and temperature_degC, for --colour temperature.
        view: oblique into the open end, along the axis, or from the side.
        swing_mm: Displacement at the antinode in mesh files; else .stl and .ply are undeformed, .glb moves visibly.
    """
    kind = ending_of(out, KINDS)
    if len(harmonic) > 1 and kind != ".html":
        raise InputError("several harmonics go together only in an .html page; make one file for each.")
    if colour == "temperature" and field is None:
        raise InputError("--colour temperature needs --field FIELD.csv (position,temperature_degC along the meridian).")
    unused = {
        "--field": field is not None and colour != "temperature",
        "--swing-mm": swing_mm is not None and (kind in PICTURES or kind == ".html"),
        "--view": view != "oblique" and kind not in PICTURES,
        "--colour": colour != "displacement" and kind in (".html", ".stl"),
    }
    if named := ", ".join(option for option, idle in unused.items() if idle):
        raise InputError(
            f"{named}: without effect on {out} as it is asked for; leave it out, or see 'hrg render --help'."
        )
    along = read_field(field) if field is not None else None
    shown = _solve(card, harmonic, index, temperature, theory, kind)
    if kind in PICTURES:
        data = _picture(shown, kind, colour, along, view)
    elif kind == ".html":
        data = _page(shown)
    else:
        data = _mesh(shown[0], kind, colour, along, swing_mm)
    with written_whole(out) as file:
        file.write(data)
    modes = [_row(one) for one in shown]
    return Result(
        {"file": out, "bytes": len(data), "modes": modes},
        f"Mode shapes of {', '.join(dict.fromkeys(one.instrument.name for one in shown))}",
        f"The modes of {out}.",
        [
            Sentence(f"{out}: {'; '.join(one.title.replace(chr(10), ', ') for one in shown)}.", where="terminal"),
            Table("Modes", modes, f"card | temperature_degC: T (°C) g | {MODE}", where="page"),
            Blocks(lambda: view_blocks(shown[:1])),
        ],
    )


def _solve(
    cards: Sequence[str], harmonics: Sequence[int], index: int, temperatures: Sequence[float],
    theory: Literal["solid", "shell"], kind: str,
) -> list[ModeScene]:  # fmt: skip
    if not cards:
        raise InputError("a card is missing: give its path or the name of a built-in one ('hrg cards').")
    count = len(cards) * max(len(temperatures), 1)
    most = MOST if kind in PICTURES else 1
    if count > most:
        raise InputError(f"{count} resonators are too many for one {kind} file, which shows {most} at most.")
    wanted: list[float | None] = [*(T + zero_Celsius for T in temperatures)] or [None]
    instruments = [load_card(card) for card in cards]
    exaggerated = kind not in (".stl", ".ply")  # those are the solid itself
    return [show_mode(one, n, index, T, theory, exaggerated) for one in instruments for T in wanted for n in harmonics]


def _picture(
    shown: Sequence[ModeScene], kind: str, colour: Colour, field: ShellTemperature | None, view: View
) -> bytes:
    from shell.render import NoOpenGL, render_animation, render_png

    scenes = [one.scene(colour, field) for one in shown]
    try:
        if kind == ".png":
            return render_png(scenes, view)
        told = partial(tell, "drawing")
        return render_animation(scenes, "webp" if kind == ".webp" else "gif", view, progress=told)
    except NoOpenGL as error:
        raise MissingEnvironment(f"{error} An .html page or a mesh needs none.") from None


def _page(shown: Sequence[ModeScene]) -> bytes:
    first = shown[0]
    rows = [_row(one) | row_of(one.mode, "bryan_factor") for one in shown]
    lead = f"Mode shapes of {first.instrument.name} at {first.temperature - zero_Celsius:g} °C, {first.mode.theory} theory."
    table = Table("Modes of this page", rows, f"{MODE} | bryan_factor: Bryan factor .5f")
    chapter = Chapter("Mode shapes", [Blocks(lambda: view_blocks(shown)), table])
    return render_result(Result({}, first.instrument.name, lead, [chapter])).encode()


def _row(one: ModeScene) -> dict[str, Any]:
    row = row_of(one, harmonic="mode.harmonic", index="mode.index", card="instrument.name", frequency_Hz="frequency")
    row |= {"temperature_degC": one.temperature - zero_Celsius}
    if one.split is None:
        return row
    slow, fast = one.split.frequencies
    angle = {"split_Hz": one.split.hertz, "slow_axis_deg": degrees(one.split.slow_axis)}
    return row | {"split": {"slow_Hz": slow, "fast_Hz": fast, **angle}}


def _mesh(one: ModeScene, kind: str, colour: Colour, field: ShellTemperature | None, swing_mm: float | None) -> bytes:
    colours = one.colours(colour, field)
    if kind == ".glb":
        visible = EXAGGERATION * one.surface.size
        return encode_animation(one.surface, visible if swing_mm is None else swing_mm * 1e-3, colours)
    return encode_mesh(one.surface, "stl" if kind == ".stl" else "ply", (swing_mm or 0.0) * 1e-3, colours)
