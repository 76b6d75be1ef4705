"""Pictures: what is drawn is counted in the pixels."""

import io
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from PIL import Image

from shell.elastic import Elastic
from shell.errors import ShellError
from shell.meridian import hemisphere
from shell.modes import solve_modes
from shell.render import render_animation, render_png
from shell.resonator import Stem
from shell.scene import compose_scene
from shell.surface import build_surface

RESONATOR = hemisphere(15e-3, 0.9e-3, support="stem", stem=Stem(2.5e-3, -5e-3, 0.5e-3))
SILICA = Elastic(72.7e9, 0.17, 2203.0)


@lru_cache
def scene_of(n):
    mode = solve_modes(RESONATOR, SILICA, n, theory="shell", tolerance=1e-2)[0]
    surface = build_surface(RESONATOR, mode, spacing=1e-3, count=96)
    return compose_scene(surface, np.linalg.norm(surface.displacement, axis=1), "displacement (µm)", f"n = {n}")


def pixels(png):
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)


def is_node(rgb):
    red, green, blue = np.moveaxis(rgb, -1, 0)
    return (red > 90) & (red > 2.2 * green) & (red > 1.5 * blue)


def is_body(rgb):
    return (rgb[..., 2] - rgb[..., 0] > 25) & (rgb[..., 0] < 110)  # the dark blue of the value 0


def polar(mask, centre):
    rows, columns = np.nonzero(mask)
    return np.hypot(columns - centre[0], centre[1] - rows), np.arctan2(centre[1] - rows, columns - centre[0])


def count_clusters(angles, gap=0.15):
    """Number of groups of angles on the circle that are apart by more than `gap`."""
    ordered = np.sort(angles)
    steps = np.diff(np.append(ordered, ordered[0] + 2 * np.pi))
    return int((steps > gap).sum())


@pytest.fixture(scope="module")
def drawn():
    """The axial view of n = 2, swinging and at rest, side by side in one picture."""
    row = pixels(render_png(plain_pair(2), "axis", 500, 500))[:400]  # without the legend below
    return row[:, :500], row[:, 500:]


def plain_pair(n):
    scene = replace(scene_of(n), title="", antinodes=np.zeros(0, dtype=np.int64))
    scene = replace(scene, values=0 * scene.values)
    return [scene, replace(scene, displacement=0 * scene.displacement, nodes=scene.nodes[:0])]


def nodal_lines(swinging, rest):
    rows, columns = np.nonzero(is_body(rest))
    centre = (columns.min() + columns.max()) / 2, (rows.min() + rows.max()) / 2
    radius = (columns.max() - columns.min()) / 2
    away, angle = polar(is_node(swinging), centre)
    ring = (away > 0.5 * radius) & (away < 1.05 * radius)
    return count_clusters(angle[ring])


def test_nodal_lines_in_the_picture_are_2n(drawn):
    assert nodal_lines(*drawn) == 4


def test_the_drawn_rim_crosses_the_circle_at_rest_2n_times(drawn):
    swinging, rest = drawn
    rows, columns = np.nonzero(is_body(rest))
    centre = (columns.min() + columns.max()) / 2, (rows.min() + rows.max()) / 2
    radius = (columns.max() - columns.min()) / 2
    away, angle = polar(is_body(swinging) | is_node(swinging), centre)
    sector = ((angle + np.pi) / (2 * np.pi) * 72).astype(int) % 72
    outermost = np.array([away[sector == k].max() for k in range(72)])
    beyond = outermost - radius
    told = np.sign(beyond[abs(beyond) > 4])  # pixels; sectors near a crossing say nothing
    assert int((told != np.roll(told, 1)).sum()) == 4


def test_the_rim_shows_the_thickness_and_the_stem(drawn):
    _, rest = drawn
    rows, columns = np.nonzero(is_body(rest))
    radius = (columns.max() - columns.min()) / 2
    # axial view at rest: outer rim at R + h/2; the picture's scale follows from it
    pixel = (15e-3 + 0.45e-3) / radius
    row = rest[int((rows.min() + rows.max()) / 2)]
    bright = row.sum(axis=-1)
    edges = np.flatnonzero(abs(np.diff(bright)) > 25)
    centre = (columns.min() + columns.max()) / 2
    distance = abs(edges - centre) * pixel
    for expected in (14.55e-3, 2.5e-3):  # inner edge of the rim, side of the stem
        assert abs(distance - expected).min() < 2 * pixel


def test_animations_loop_and_move():
    for kind in ("gif", "webp"):
        picture = Image.open(io.BytesIO(render_animation(scene_of(2), kind, width=160, height=140, frames=4)))
        frames = []
        for k in range(picture.n_frames):
            picture.seek(k)
            frames.append(np.asarray(picture.convert("RGB")).astype(int))
        assert (picture.n_frames, picture.info["loop"]) == (4, 0)
        assert abs(frames[0] - frames[2]).max() > 50


def test_an_unknown_view_is_refused():
    with pytest.raises(ShellError, match="oblique, axis, side"):
        render_png(scene_of(2), "above")
