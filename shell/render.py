"""Pictures of mode shapes, still or swinging: triangles seen from the open end, painted from the farthest to the nearest."""

import io
from collections.abc import Callable, Sequence
from math import pi
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from shell.errors import ShellError
from shell.quadrature import Array
from shell.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Normalize
    from PIL.Image import Image

View = Literal["oblique", "axis", "side"]
VIEWS = ("oblique", "axis", "side")
NODE, ANTINODE, SLOW, FAST, GHOST, GREY = "#d81b60", "#1b1f24", "#0072b2", "#e69f00", "#e9ebee", "#5b6470"
LIGHT = (0.25, 0.45, 0.86)  # to the right, upwards, towards the eye
LIFT, THICK, DOT = 0.02, 0.006, 0.012  # lines over their surface, their width, dots; in parts of the size
PIECES = 40  # of a long line, each in front of what is behind it
ROUND = np.linspace(0.0, 2 * np.pi, 13)


def render_png(scenes: Scene | Sequence[Scene], view: View = "oblique", width: int = 900, height: int = 700) -> bytes:
    """Return a PNG of scenes side by side on one scale, views "oblique", "axis" (into the open end) or "side"."""
    png = io.BytesIO()
    _draw(scenes, view, (width, height), 1.0).save(png, "PNG")
    return png.getvalue()


def render_animation(
    scenes: Scene | Sequence[Scene], kind: Literal["webp", "gif"], view: View = "oblique", width: int = 640,
    height: int = 520, frames: int = 24, period: float = 1.2, progress: Callable[[float], None] = lambda part: None,
) -> bytes:  # fmt: skip
    """Return a looping WebP or GIF of one period of the swing, which lasts `period` seconds; `progress` is told which part is drawn."""
    drawn = []
    for k in range(frames // 2 + 1):  # and back again
        drawn.append(_draw(scenes, view, (width, height), float(np.cos(2 * pi * k / frames))))
        progress(len(drawn) / (frames // 2 + 1))
    pictures = [drawn[min(k, frames - k)] for k in range(frames)]
    buffer = io.BytesIO()
    more: dict[str, Any] = {"quality": 80, "method": 4} if kind == "webp" else {"optimize": True}
    pictures[0].save(
        buffer, kind.upper(), save_all=True, append_images=pictures[1:], duration=round(1000 * period / frames),
        loop=0, **more,
    )  # fmt: skip
    return buffer.getvalue()


def _draw(scenes: Scene | Sequence[Scene], view: View, window: tuple[int, int], swing: float) -> "Image":
    """Draw scenes at a swing (-1 ... 1), each in a window of so many pixels."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure
    from PIL import Image

    together = [scenes] if isinstance(scenes, Scene) else list(scenes)
    if view not in VIEWS:
        raise ShellError(f"a view is one of {', '.join(VIEWS)}, not {view!r}.")
    count = len(together)
    figure = Figure(figsize=(window[0] * count / 100, window[1] / 100), dpi=100)
    canvas = FigureCanvasAgg(figure)
    norm = Normalize(*_scale(np.concatenate([scene.values for scene in together])))
    seen = [_look(scene, view) for scene in together]
    # the room that each takes at its largest swing to either side, right and up
    rooms = [_room(scene, turn) for scene, turn in zip(together, seen, strict=True)]
    largest = np.max([room[1] - room[0] for room in rooms], axis=0)
    for k, (scene, turn, room) in enumerate(zip(together, seen, rooms, strict=True)):
        axes = figure.add_axes(((k + 0.03) / count, 0.21, 0.94 / count, 0.71), aspect="equal")
        low, high = room.mean(axis=0) - largest / 2, room.mean(axis=0) + largest / 2
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        axes.set_axis_off()
        _paint(axes, scene, turn, norm, swing)
        title, _, remark = scene.title.partition("\n")
        figure.text((k + 0.5) / count, 0.95, title, ha="center", size=13, parse_math=False)
        figure.text(
            (k + 0.02) / count, 0.92, remark.replace(", ", "\n"), va="top", size=9, color=GREY, parse_math=False
        )
    if together[0].legend:
        bar = figure.add_axes((0.5 - 0.3 / count, 0.14, 0.6 / count, 0.035))
        figure.colorbar(ScalarMappable(norm, "cividis"), cax=bar, orientation="horizontal", label=together[0].legend)
    if len(together[0].antinodes):
        split = "   blue: slow axes   orange: fast axes" if len(together[0].axes) else ""
        marks = "red lines: nodes   black dots: antinodes   grey: undeformed" + split
        figure.text(0.01, 0.01, marks, size=8, color=GREY)
    canvas.draw()
    picture = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())
    figure.clear()  # a figure holds itself and is freed late
    return picture


def _paint(axes: "Axes", scene: Scene, seen: Array, norm: "Normalize", swing: float) -> None:
    """Paint the bent resonator with its marks, the undeformed shape in grey behind it."""
    from matplotlib import colormaps, colors
    from matplotlib.collections import TriMesh
    from matplotlib.tri import Triangulation

    bent = (scene.points + swing * scene.displacement) @ seen
    size = float(np.ptp(scene.points, axis=0).max())
    faces = bent[scene.triangles]
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    front = normal[:, 2] > 0.0  # what faces away is behind something
    faces, normal, triangles = faces[front], normal[front], scene.triangles[front]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    colour = colormaps["cividis"](norm(scene.values))[triangles, :3]
    colour *= 0.42 + 0.58 * np.abs(normal @ LIGHT)[:, None, None]
    ghost = (scene.points @ seen)[triangles] - [0.0, 0.0, 9.0 * size]
    marks = [(_ribbon(bent[line], THICK * size), NODE) for line in scene.nodes]
    marks += [(_dot(bent[k], DOT * size), ANTINODE) for k in scene.antinodes]
    names = np.repeat([SLOW, FAST], len(scene.axes) // 2)
    ends = scene.axes @ seen
    lines = np.linspace(ends[:, 0], ends[:, 1], PIECES, axis=1)
    marks += [(_ribbon(line, THICK * size), name) for line, name in zip(lines, names, strict=True)]
    flat = [(ghost, GHOST), *((np.add(mark, (0.0, 0.0, LIFT * size)), name) for mark, name in marks)]
    painted = [colour, *(np.broadcast_to(colors.to_rgb(name), mark.shape) for mark, name in flat)]
    corners = np.concatenate([faces, *(mark for mark, _ in flat)])
    order = np.argsort(corners[:, :, 2].mean(axis=1))
    x, y, _ = corners[order].reshape(-1, 3).T
    mesh = TriMesh(Triangulation(x, y, np.arange(x.size).reshape(-1, 3)))
    mesh.set_facecolor(np.concatenate(painted)[order].reshape(-1, 3))
    axes.add_collection(mesh, autolim=False)


def _scale(values: Array) -> tuple[float, float]:
    """Return the ends of the colour scale; a few values at a sharp corner (theory: infinite) do not set it."""
    usual, top = float(np.percentile(values, 99.5)), float(values.max())
    top = usual if top > 4 * usual > 0 else top
    low = float(min(values.min(), 0.0 if values.min() < 0.5 * top else values.min()))
    return low, top if top > low else low + 1.0


def _look(scene: Scene, view: View) -> Array:
    """Unit vectors to the right on the screen, upwards and towards the eye, as columns: from the open end, the axis upright."""
    side = 1.0 if scene.opens_up else -1.0
    eye, up = {
        "oblique": ((1.0, -1.0, 0.9 * side), (0.0, 0.0, 1.0)),
        "axis": ((0.0, 0.0, side), (0.0, 1.0, 0.0)),
        "side": ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    }[view]
    away = np.array(eye) / np.linalg.norm(eye)
    upwards = np.array(up) - away * (away @ np.array(up))
    upwards /= np.linalg.norm(upwards)
    return np.array([np.cross(upwards, away), upwards, away]).T


def _room(scene: Scene, seen: Array) -> Array:
    """The lowest and the highest place on the screen at the largest swing to either side, (2, 2)."""
    bent = [scene.points + sign * scene.displacement for sign in (-1, 1)]
    places = np.concatenate([*bent, scene.axes.reshape(-1, 3)]) @ seen[:, :2]
    return np.array([places.min(axis=0), places.max(axis=0)])


def _ribbon(line: Array, width: float) -> Array:
    """Triangles (k, 3, 3) of a line of a width on the screen."""
    along = np.diff(line, axis=0)[:, [1, 0, 2]] * [-1.0, 1.0, 0.0]
    aside = along * (width / 2 / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300))
    sides = line[:-1] + aside, line[:-1] - aside, line[1:] + aside, line[1:] - aside
    return np.concatenate([np.stack(sides[k : k + 3], axis=1) for k in (0, 1)])


def _dot(point: Array, radius: float) -> Array:
    rim = point + radius * np.stack([np.cos(ROUND), np.sin(ROUND), 0 * ROUND], axis=1)
    return np.stack([np.broadcast_to(point, (len(rim) - 1, 3)), rim[:-1], rim[1:]], axis=1)
