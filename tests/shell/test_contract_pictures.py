"""Pictures: what is drawn is counted in the pixels; without OpenGL there is a sentence, never a crash."""

import io
import subprocess
import sys
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from PIL import Image

import shell.render
from shell.errors import ShellError
from shell.meridian import hemisphere
from shell.modes import solve_modes
from shell.render import NoOpenGL, can_draw, render_animation, render_png
from shell.resonator import Stem
from shell.scene import compose_scene
from shell.still import draw_still
from shell.surface import build_surface
from tests.shell.samples import SILICA

RESONATOR = hemisphere(15e-3, 0.9e-3, support="stem", stem=Stem(2.5e-3, -5e-3, 0.5e-3))


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
    try:
        row = pixels(render_png(plain_pair(2), "axis", 500, 500))[:400]  # without the legend below
    except NoOpenGL as missing:
        pytest.skip(str(missing))
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


@pytest.mark.slow
def test_nodal_lines_in_the_picture_are_2n(drawn):
    assert nodal_lines(*drawn) == 4


def test_nodal_lines_of_a_still_are_2n():
    swinging, rest = (pixels(draw_still(scene, "axis", 500, 500))[40:410] for scene in plain_pair(3))
    assert nodal_lines(swinging, rest) == 6


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.usefixtures("drawn")
def test_animations_loop_and_move(monkeypatch):
    scene = scene_of(2)
    pictures = shell.render._draw(scene, "oblique", (160, 140), [1.0, 0.0, -1.0])
    monkeypatch.setattr(shell.render, "_draw", lambda *_: pictures)
    for kind in ("gif", "webp"):
        picture = Image.open(io.BytesIO(render_animation(scene, kind, frames=4)))
        frames = []
        for k in range(picture.n_frames):
            picture.seek(k)
            frames.append(np.asarray(picture.convert("RGB")).astype(int))
        assert (picture.n_frames, picture.info["loop"]) == (4, 0)
        assert abs(frames[0] - frames[2]).max() > 50


def test_a_name_is_drawn_as_it_is_written():
    assert draw_still(replace(scene_of(3), title="a$\\frac{b$c")).startswith(b"\x89PNG")


def test_an_unknown_view_is_refused():
    with pytest.raises(ShellError, match="oblique, axis, side"):
        render_png(scene_of(2), "above")


@pytest.mark.parametrize("status", [-11, 139, 1])
def test_a_child_that_dies_gives_the_remedy(monkeypatch, status):
    def die(command, **_):
        return subprocess.CompletedProcess(command, status)

    monkeypatch.setattr(subprocess, "run", die)
    drawn, remedy = can_draw()
    assert not drawn
    assert "apt install libegl1" in remedy


def test_a_child_that_hangs_is_stopped(monkeypatch):
    def hang(command, timeout, **_):
        raise subprocess.TimeoutExpired(command, timeout)

    monkeypatch.setattr(subprocess, "run", hang)
    with pytest.raises(NoOpenGL, match="stopped"):
        render_png(scene_of(2))


def test_a_real_child_that_is_killed_does_not_take_us_along(monkeypatch, tmp_path):
    killer = tmp_path / "killer"
    killer.write_text("#!/bin/sh\nkill -SEGV $$\n")
    killer.chmod(0o755)
    monkeypatch.setattr(shell.render.sys, "executable", str(killer))
    assert can_draw()[0] is False
    assert sys.executable == str(killer)
