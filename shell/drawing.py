"""Drawing by pyvista: the part of `shell.render` that runs in the child process."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shell.quadrature import Array
from shell.scene import AZIMUTHS, Scene

ROOM = 0.68  # share of the picture's height for the resonator; the rest is for title and legend
NODE, ANTINODE, SLOW, FAST = "#d81b60", "#1b1f24", "#0072b2", "#e69f00"


def draw_job(folder: str) -> None:
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
    half_height = 0.0  # of the picture, m, in which every swinging resonator fits above the legend
    for scene in scenes:
        _, up, right = look(scene, view)
        corners = scene.reach
        high, wide = float(np.ptp(corners @ up)), float(np.ptp(corners @ right))
        half_height = max(half_height, high / (2 * ROOM), 1.08 * wide / (2 * window[0] / window[1]))
    limits = scale(np.concatenate([scene.values for scene in scenes]))
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


def scale(values: Array) -> tuple[float, float]:
    """Return the ends of the colour scale; a few values at a sharp corner (theory: infinite) do not set it."""
    usual, top = float(np.percentile(values, 99.5)), float(values.max())
    top = usual if top > 4 * usual > 0 else top
    low = float(min(values.min(), 0.0 if values.min() < 0.5 * top else values.min()))
    return low, top if top > low else low + 1.0


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
        "title": scene.legend + "\n", "color": "black", "fmt": "%.3g", "vertical": False,
        "title_font_size": 15, "label_font_size": 14, "n_labels": 5, "width": 0.6, "position_x": 0.2,
        "position_y": 0.05, "height": 0.12,
    }  # fmt: skip
    plotter.add_mesh(
        body, scalars=scene.legend, cmap="cividis", clim=limits, smooth_shading=True,
        show_scalar_bar=bool(scene.legend), scalar_bar_args=bar, ambient=0.38, diffuse=0.72, specular=0.1,
    )  # fmt: skip
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
            axes = "   blue: slow axes   orange: fast axes" if len(scene.axes) else ""
            marked = "red lines: nodes   black dots: antinodes   grey: undeformed" + axes
            plotter.add_text(marked, position=(12, 6), font_size=8, color="#5b6470")
    for k, line in enumerate(scene.axes):
        colour = SLOW if 2 * k < len(scene.axes) else FAST
        plotter.add_mesh(pv.lines_from_points(line), color=colour, line_width=4.0, render_lines_as_tubes=True)
    if len(scene.azimuths):
        plotter.add_point_labels(
            scene.azimuths, list(AZIMUTHS), font_size=15, shape=None, show_points=False, always_visible=True,
            text_color="black", justification_horizontal="center", justification_vertical="center",
        )  # fmt: skip
    title, _, remark = scene.title.partition("\n")
    if title:
        plotter.add_text(title, position="upper_edge", font_size=10, color="black")
    if remark:
        plotter.add_text(remark.replace(", ", "\n"), position="upper_left", font_size=8, color="#5b6470")
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


def look(scene: Scene, view: str) -> tuple[Array, Array, Array]:
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


def _aim(plotter: Any, scene: Scene, view: str, half_height: float) -> None:
    """Look at the resonator from the view's direction, without perspective; it stands in the upper part of the picture."""
    away, up, right = look(scene, view)
    corners = scene.reach
    middle = sum((corners @ axis).max() / 2 * axis + (corners @ axis).min() / 2 * axis for axis in (away, up, right))
    target = middle - (1 - ROOM - 0.12) * half_height * up
    plotter.enable_parallel_projection()
    plotter.camera_position = [tuple(target + 20 * half_height * away), tuple(target), tuple(up)]
    plotter.camera.parallel_scale = half_height
    plotter.reset_camera_clipping_range()
