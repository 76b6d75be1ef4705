"""A still picture of a mode without OpenGL: triangles seen from the open end, painted from the farthest to the nearest."""

import io

import numpy as np

from shell.drawing import ANTINODE, FAST, NODE, SLOW, look, scale
from shell.quadrature import Array
from shell.scene import AZIMUTHS, Scene

LIGHT = (0.25, 0.45, 0.86)  # to the right, upwards, towards the eye
GHOST = "#e9ebee"
LIFT, THICK, DOT = 0.02, 0.006, 0.012  # lines over their surface, their width, dots; in parts of the size
PIECES = 40  # of a long line, each in front of what is behind it
ROUND = np.linspace(0.0, 2 * np.pi, 13)


def draw_still(scene: Scene, view: str = "oblique", width: int = 900, height: int = 700) -> bytes:
    """Return a PNG of the mode at maximum displacement, the undeformed shape in grey behind it."""
    from matplotlib import colormaps, colors
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import TriMesh
    from matplotlib.figure import Figure
    from matplotlib.tri import Triangulation

    eye, up, right = look(scene, view)
    seen = np.array([right, up, eye]).T
    bent = (scene.points + scene.displacement) @ seen
    size = float(np.ptp(bent, axis=0).max())
    faces = bent[scene.triangles]
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    front = normal[:, 2] > 0.0  # what faces away is behind something
    faces, normal, triangles = faces[front], normal[front], scene.triangles[front]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    norm = colors.Normalize(*scale(scene.values))
    colour = colormaps["cividis"](norm(scene.values))[triangles, :3]
    colour *= 0.42 + 0.58 * np.abs(normal @ LIGHT)[:, None, None]
    ghost = (scene.points @ seen)[triangles] - [0.0, 0.0, 9.0 * size]
    marks = [(_ribbon(bent[line[line >= 0]], THICK * size), NODE) for line in scene.nodes]
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
    figure = Figure(figsize=(width / 100, height / 100), dpi=100)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.03, 0.17, 0.94, 0.74), aspect="equal", xlim=(x.min(), x.max()), ylim=(y.min(), y.max()))
    axes.set_axis_off()
    axes.add_collection(mesh, autolim=False)
    for (across, high, _), name in zip(scene.azimuths @ seen, AZIMUTHS, strict=False):  # or no marks
        axes.text(across, high, name, ha="center", va="center", size=10)
    title, _, remark = scene.title.partition("\n")
    figure.text(0.5, 0.95, title, ha="center", size=13, parse_math=False)
    figure.text(0.02, 0.92, remark.replace(", ", "\n"), va="top", size=9, color="#5b6470", parse_math=False)
    bar = figure.add_axes((0.2, 0.1, 0.6, 0.035))
    figure.colorbar(ScalarMappable(norm, "cividis"), cax=bar, orientation="horizontal", label=scene.legend)
    png = io.BytesIO()
    figure.savefig(png, format="png")
    mesh.remove()  # a figure holds itself and is freed late
    return png.getvalue()


def _ribbon(line: Array, width: float) -> Array:
    """Triangles (k, 3, 3) of a line of a width on the screen."""
    along = np.diff(line, axis=0)[:, [1, 0, 2]] * [-1.0, 1.0, 0.0]
    aside = along * (width / 2 / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300))
    sides = line[:-1] + aside, line[:-1] - aside, line[1:] + aside, line[1:] - aside
    return np.concatenate([np.stack(sides[k : k + 3], axis=1) for k in (0, 1)])


def _dot(point: Array, radius: float) -> Array:
    rim = point + radius * np.stack([np.cos(ROUND), np.sin(ROUND), 0 * ROUND], axis=1)
    return np.stack([np.broadcast_to(point, (len(rim) - 1, 3)), rim[:-1], rim[1:]], axis=1)
