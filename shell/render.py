"""Mode shapes as pictures, drawn off-screen by pyvista.

VTK ends the whole process with a segmentation fault where the system has no OpenGL, so everything is drawn in a child
process, and a machine that cannot draw gives a `NoOpenGL` with the remedy.
"""

import io
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, fields
from math import pi
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from shell.errors import ShellError
from shell.quadrature import Array
from shell.surface import Surface

REMEDY = (
    "no OpenGL on this machine, so no picture could be drawn. On Debian or Ubuntu"
    " 'apt install libegl1 libgl1-mesa-dri' brings a software renderer."
)
EXAGGERATION = 0.12  # largest displacement in a picture over the size of the resonator
ROOM = 0.68  # share of the picture's height for the resonator; the rest is for title and legend
PER_FRAME = 15.0  # seconds that one frame may take before the drawing is given up
NODE, ANTINODE = "#d81b60", "#1b1f24"

View = Literal["oblique", "axis", "side"]
VIEWS = ("oblique", "axis", "side")


class NoOpenGL(RuntimeError):
    """The machine cannot draw; the message says how to mend it."""


@dataclass(frozen=True, eq=False)
class Scene:
    """One resonator in a picture.

    Attributes
    ----------
    points, displacement : (N, 3) arrays, m
        Vertices and what is added to them at the largest swing, already exaggerated.
    triangles : (F, 3) array
    values : (N,) array
        What the colour shows.
    legend : str
        Quantity and unit of the values.
    title : str
        A line above the resonator.
    nodes : (L, k) array
        Vertex numbers along each nodal line, -1 after its end.
    antinodes : (A,) array
        Vertex numbers.
    opens_up : bool
        Whether the open end is at the larger z, from where it is then seen.
    """

    points: Array
    displacement: Array
    triangles: NDArray[np.int64]
    values: Array
    legend: str
    title: str
    nodes: NDArray[np.int64]
    antinodes: NDArray[np.int64]
    opens_up: bool


def compose_scene(surface: Surface, values: Array, legend: str, title: str = "") -> Scene:
    """Compose a picture of a mode: nodal meridians and antinodes marked, the swing exaggerated to a visible size."""
    lines = surface.nodes
    nodes = np.full((len(lines), max(map(len, lines), default=0)), -1, dtype=np.int64)
    for k, line in enumerate(lines):
        nodes[k, : len(line)] = line
    rim = surface.position > 0.98
    opens_up = bool(surface.points[rim, 2].mean() > surface.points[:, 2].mean()) if rim.any() else False
    swing = surface.displacement * EXAGGERATION * surface.size
    return Scene(
        surface.points,
        swing,
        surface.triangles,
        np.asarray(values, dtype=float),
        legend,
        title,
        nodes,
        surface.antinodes,
        opens_up,
    )


def render_png(scenes: Scene | Sequence[Scene], view: View = "oblique", width: int = 900, height: int = 700) -> bytes:
    """Return a PNG: the mode at its largest swing, the undeformed shape as a ghost; several scenes stand side by side.

    Parameters
    ----------
    scenes : what to draw; all share one colour scale and one length scale.
    view : "oblique" into the open end, "axis" straight into it, or "side".
    width, height : pixels of each scene.

    Raises
    ------
    NoOpenGL
        The machine cannot draw.
    """
    return _draw(scenes, view, (width, height), [1.0])[0]


def render_animation(
    scenes: Scene | Sequence[Scene],
    kind: Literal["webp", "gif"],
    view: View = "oblique",
    width: int = 640,
    height: int = 520,
    frames: int = 24,
    period: float = 1.2,
) -> bytes:
    """Return a looping WebP or GIF of one period of the swing, which lasts `period` seconds.

    Raises
    ------
    NoOpenGL
        The machine cannot draw.
    """
    from PIL import Image

    swings = [float(np.cos(2 * pi * k / frames)) for k in range(frames)]
    drawn = [Image.open(io.BytesIO(png)).convert("RGB") for png in _draw(scenes, view, (width, height), swings)]
    buffer = io.BytesIO()
    more: dict[str, Any] = {"quality": 80, "method": 4} if kind == "webp" else {"optimize": True}
    drawn[0].save(
        buffer,
        kind.upper(),
        save_all=True,
        append_images=drawn[1:],
        duration=round(1000 * period / frames),
        loop=0,
        **more,
    )
    return buffer.getvalue()


def can_draw() -> tuple[bool, str]:
    """Tell whether this machine can draw, and the remedy when it cannot."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    none = np.zeros(0, dtype=np.int64)
    try:
        render_png(
            Scene(corners, 0 * corners, faces, np.arange(4.0), "", "", none.reshape(0, 0), none, False),
            width=64,
            height=64,
        )
    except NoOpenGL as error:
        return False, str(error)
    return True, ""


def _draw(scenes: Scene | Sequence[Scene], view: View, window: tuple[int, int], swings: list[float]) -> list[bytes]:
    """Have a child process draw one PNG for every swing (-1 ... 1)."""
    together = [scenes] if isinstance(scenes, Scene) else list(scenes)
    if view not in VIEWS:
        raise ShellError(f"a view is one of {', '.join(VIEWS)}, not {view!r}.")
    with tempfile.TemporaryDirectory() as folder:
        job: dict[str, Any] = {"view": view, "window": window, "swings": swings, "count": len(together)}
        for k, scene in enumerate(together):
            job |= {f"{field.name}_{k}": getattr(scene, field.name) for field in fields(Scene)}
        np.savez(Path(folder, "job.npz"), **job)
        _run_child(folder, 60 + PER_FRAME * len(swings))
        pictures = [Path(folder, f"{k}.png") for k in range(len(swings))]
        if not all(picture.exists() for picture in pictures):
            raise NoOpenGL(REMEDY)
        return [picture.read_bytes() for picture in pictures]


def _run_child(folder: str, seconds: float) -> None:
    job = [sys.executable, "-m", "shell.render", folder]
    try:
        done = subprocess.run(job, capture_output=True, timeout=seconds, cwd=Path(__file__).parents[1])
    except subprocess.TimeoutExpired:
        raise NoOpenGL(
            f"drawing took more than {seconds:.0f} s and was stopped; check the OpenGL of this machine."
        ) from None
    if done.returncode != 0:
        raise NoOpenGL(REMEDY)


def _draw_job(folder: str) -> None:
    """Draw a job; runs in the child process."""
    import pyvista as pv

    with np.load(Path(folder, "job.npz")) as job:
        scenes = [
            Scene(
                *(value.item() if (value := job[f"{field.name}_{k}"]).ndim == 0 else value for field in fields(Scene))
            )
            for k in range(int(job["count"]))
        ]
        view, swings, window = str(job["view"]), job["swings"].tolist(), job["window"].tolist()
    plotter = pv.Plotter(
        off_screen=True, shape=(1, len(scenes)), window_size=[window[0] * len(scenes), window[1]], border=False
    )
    half_height = max(_half_height(scene, view, window[0] / window[1]) for scene in scenes)
    limits = _common_limits([scene.values for scene in scenes])
    moving = []
    for k, scene in enumerate(scenes):
        plotter.subplot(0, k)
        moving += _fill(plotter, scene, limits, first=k == 0)
        _aim(plotter, scene, view, half_height)
    for number, swing in enumerate(swings):
        for mesh, rest, displacement in moving:
            mesh.points = rest + swing * displacement
        plotter.render()
        plotter.screenshot(Path(folder, f"{number}.png"))
    plotter.close()


def _fill(plotter: Any, scene: Scene, limits: tuple[float, float], first: bool) -> list[tuple[Any, Array, Array]]:
    """Put one resonator into the current part of the window; return what moves: mesh, rest position, displacement."""
    import pyvista as pv

    plotter.set_background("white")
    faces = np.column_stack([np.full(len(scene.triangles), 3), scene.triangles]).ravel()
    ghost = pv.PolyData(scene.points.copy(), faces)
    plotter.add_mesh(ghost, color="#8a949e", opacity=0.13)
    edges = ghost.extract_feature_edges(60.0, boundary_edges=False, manifold_edges=False, non_manifold_edges=False)
    if edges.n_cells:
        plotter.add_mesh(edges, color="#8a949e", line_width=1.2)
    body, origin = _split_sharp(scene, faces)
    body[scene.legend] = scene.values[origin]
    bar = {
        "title": scene.legend + "\n",
        "color": "black",
        "fmt": "%.3g",
        "vertical": False,
        "title_font_size": 15,
        "label_font_size": 14,
        "n_labels": 5,
        "width": 0.6,
        "position_x": 0.2,
        "position_y": 0.05,
        "height": 0.12,
    }
    plotter.add_mesh(
        body,
        scalars=scene.legend,
        cmap="cividis",
        clim=limits,
        smooth_shading=True,
        show_scalar_bar=bool(scene.legend),
        scalar_bar_args=bar,
        ambient=0.38,
        diffuse=0.72,
        specular=0.1,
    )
    moving = [(body, body.points.copy(), scene.displacement[origin])]
    for line in scene.nodes:
        members = line[line >= 0]
        if len(members) > 1:
            curve = pv.lines_from_points(scene.points[members])
            plotter.add_mesh(curve, color=NODE, line_width=3.0, render_lines_as_tubes=True)
            moving.append((curve, scene.points[members], scene.displacement[members]))
    if len(scene.antinodes):
        marks = pv.PolyData(scene.points[scene.antinodes])
        plotter.add_mesh(marks, color=ANTINODE, point_size=13.0, render_points_as_spheres=True)
        moving.append((marks, scene.points[scene.antinodes], scene.displacement[scene.antinodes]))
        if first:
            plotter.add_text(
                "red lines: nodes   black dots: antinodes   grey: undeformed",
                position=(12, 6),
                font_size=8,
                color="#5b6470",
            )
    if scene.title:
        plotter.add_text(scene.title, position="upper_edge", font_size=10, color="black")
    return moving


def _split_sharp(scene: Scene, faces: Array) -> tuple[Any, NDArray[np.int64]]:
    """A mesh whose vertices are doubled along sharp edges, for shading, and the vertex that each one came from."""
    import pyvista as pv

    body = pv.PolyData(scene.points.copy(), faces)
    body["origin"] = np.arange(len(scene.points))
    split = body.compute_normals(
        split_vertices=True, feature_angle=35.0, auto_orient_normals=False, consistent_normals=False
    )
    return split, np.asarray(split["origin"], dtype=np.int64)


def _axes(scene: Scene, view: str) -> tuple[Array, Array, Array]:
    """Unit vectors towards the eye, upwards and to the right on the screen: from the open end, the axis upright."""
    side = 1.0 if scene.opens_up else -1.0
    eye, up = {
        "oblique": ((1.0, -1.0, 0.9 * side), (0.0, 0.0, 1.0)),
        "axis": ((0.0, 0.0, side), (0.0, 1.0, 0.0)),
        "side": ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    }[view]
    away = np.array(eye) / np.linalg.norm(eye)
    upwards = np.array(up) - away * (away @ np.array(up))
    upwards /= np.linalg.norm(upwards)
    return away, upwards, np.cross(upwards, away)


def _half_height(scene: Scene, view: str, aspect: float) -> float:
    """Half the height of the picture, m, in which the swinging resonator fits above the legend."""
    _, up, right = _axes(scene, view)
    corners = np.concatenate([scene.points + sign * scene.displacement for sign in (-1, 1)])
    high, wide = np.ptp(corners @ up), np.ptp(corners @ right)
    return float(max(high / (2 * ROOM), 1.08 * wide / (2 * aspect)))


def _aim(plotter: Any, scene: Scene, view: str, half_height: float) -> None:
    """Look at the resonator from the view's direction, without perspective; it stands in the upper part of the picture."""
    away, up, right = _axes(scene, view)
    corners = np.concatenate([scene.points + sign * scene.displacement for sign in (-1, 1)])
    middle = sum((corners @ axis).max() / 2 * axis + (corners @ axis).min() / 2 * axis for axis in (away, up, right))
    target = middle - (1 - ROOM - 0.12) * half_height * up
    plotter.enable_parallel_projection()
    plotter.camera_position = [tuple(target + 20 * half_height * away), tuple(target), tuple(up)]
    plotter.camera.parallel_scale = half_height
    plotter.reset_camera_clipping_range()


def _common_limits(values: list[Array]) -> tuple[float, float]:
    """One colour scale for all scenes; a few values at a sharp corner (theory: infinite) do not set it."""
    every = np.concatenate(values)
    usual, top = float(np.percentile(every, 99.5)), float(every.max())
    top = usual if top > 4 * usual > 0 else top
    low = float(min(every.min(), 0.0 if every.min() < 0.5 * top else every.min()))
    return low, top if top > low else low + 1.0


if __name__ == "__main__":
    _draw_job(sys.argv[1])
