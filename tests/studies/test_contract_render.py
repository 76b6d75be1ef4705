"""`hrg render`: every kind of file, side by side, colours with units, and the exits that a user can mend."""

from functools import partial

import numpy as np
import pytest
from PIL import Image

from shell.surface import build_surface
from studies.cli import main
from studies.errors import InputError
from studies.instrument.card import load_card
from studies.reports.scenes import read_field, show_mode


def hrg_render(*words):
    return main(["render", *(str(word) for word in words)])


@pytest.mark.parametrize(("ending", "count"), [("png", 1), ("webp", 24), ("gif", 24)])
def test_a_picture_or_an_animation_is_written(tmp_path, ending, count, monkeypatch):
    file = tmp_path / f"mode.{ending}"
    monkeypatch.setattr("studies.reports.scenes.build_surface", partial(build_surface, spacing=2e-3, count=32))
    assert hrg_render("free-dome", "--theory", "shell", "--out", file) == 0
    with Image.open(file) as picture:
        assert (picture.n_frames if count > 1 else 1) == count


def test_a_page_has_its_view_and_a_still_picture(tmp_path, drawn):
    page = tmp_path / "mode.html"
    assert hrg_render("free-dome", "--theory", "shell", "--harmonic", "2", "3", "--out", page) == 0
    text = page.read_text()
    assert "webgl2" in text
    assert len(text.partition("data:image/png;base64,")[2].partition('"')[0]) > 50_000


def test_a_temperature_field_colours_the_meridian(tmp_path):
    path = tmp_path / "field.csv"
    path.write_text("position,temperature_degC\n0,20\n1,30\n")
    shown = show_mode(load_card("free-dome"), theory="shell")
    values = shown.values("temperature", read_field(path))
    assert (values.min(), values.max()) == (20.0, 30.0)
    rim = shown.surface.position == 1
    assert np.all(values[rim] == 30)
    path.write_text("position,temperature_degC\n0.5,20\n0.2,30\n")
    with pytest.raises(InputError, match="must rise"):
        read_field(path)


def test_the_strain_energy_of_the_picture_is_that_of_the_solver():
    """At 1 m amplitude the surface's density times the thickness, taken over the shell, is near the mode's energy."""
    shown = show_mode(load_card("free-dome"))
    mode, surface = shown.mode, shown.surface
    outer = surface.grids[0]
    density = surface.energy[outer]
    assert (density >= 0).all()
    # energy of a swing of 1 m: ½ ω² modal mass; the density at the faces is the largest through the thickness
    energy = 0.5 * (2 * np.pi * mode.frequency) ** 2 * mode.modal_mass
    volume = 2 * np.pi / 3 * (15.45e-3**3 - 14.55e-3**3)
    areas = np.linalg.norm(
        np.cross(
            surface.points[surface.triangles[:, 1]] - surface.points[surface.triangles[:, 0]],
            surface.points[surface.triangles[:, 2]] - surface.points[surface.triangles[:, 0]],
        ),
        axis=1,
    )
    mean = float((surface.energy[surface.triangles].mean(axis=1) * areas).sum() / areas.sum())
    # pure bending: the mean through the thickness is a third of the faces'; membrane strain makes it more
    assert 1.0 < mean * volume / energy < 3.2
