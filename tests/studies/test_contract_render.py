"""`hrg render`: every kind of file, side by side, colours with units, and the exits that a user can mend."""

import subprocess
import sys

import numpy as np
import pytest

from shell.drawing import look
from studies.cli import main
from studies.errors import InputError
from studies.instrument.card import load_card
from studies.reports.scenes import read_field, show_mode


def hrg_render(*words):
    return main(["render", *(str(word) for word in words)])


@pytest.fixture
def no_opengl(monkeypatch, drawn):
    """A machine whose child process cannot draw."""
    monkeypatch.setattr("shell.render._run_child", lambda *_: None)


@pytest.mark.parametrize("ending", ["png", "webp", "gif"])
def test_without_opengl_a_picture_is_status_3_and_nothing_is_left(tmp_path, capsys, no_opengl, ending):
    assert hrg_render("free-dome", "--theory", "shell", "--out", tmp_path / f"mode.{ending}") == 3
    assert "apt install libegl1" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_without_opengl_the_page_has_its_view_and_a_still_picture(tmp_path, no_opengl):
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


WAVE = """schema = "hrg.card/1"
name = "wavy"
resonator = {shape = "hemisphere", radius_mm = 15.0, thickness_mm = 0.9}
material = {name = "fused-silica"}
imperfection = {wave = [{of = "inner", order = 4, amplitude_um = 2.0, azimuth_deg = 20}]}
"""


def test_contract_a_split_pair_is_told_by_the_mode_that_is_shown_and_its_azimuth(tmp_path, ask):
    """The frequency is the slower mode's, as `hrg modes` has it; in the picture the azimuths 0° and 90° lie along x and y, beyond the axes."""
    card = tmp_path / "wave.toml"
    card.write_text(WAVE)
    (told,) = ask(["render", card, "--out", tmp_path / "mode.stl"])["modes"]
    split = ask(["modes", card])["modes"][0]["split"]
    assert told["split"] == pytest.approx({key: split[key] for key in told["split"]}, rel=1e-9)
    assert told["frequency_Hz"] == told["split"]["slow_Hz"] < told["split"]["fast_Hz"]
    shown = show_mode(load_card(card))
    assert f"{split['slow_Hz']:.2f} Hz" in shown.title
    scene = shown.scene()
    along, up, _ = scene.azimuths.T
    assert along == pytest.approx([np.hypot(*scene.axes[0, 0, :2]) * 1.08, 0.0])
    assert up == pytest.approx(along[::-1])
    _, upwards, right = look(scene, "axis")
    (x0, y0), (x1, y1) = scene.azimuths @ np.array([right, upwards]).T
    assert not scene.opens_up
    assert x0 * y1 - y0 * x1 < 0  # clockwise, seen into a dome
    assert not len(show_mode(load_card("free-dome"), theory="shell").scene().azimuths)


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


def test_the_drawing_process_ends_with_the_one_that_wants_it(tmp_path):
    """Where the parent was killed its end of the pipe closes: no process and no folder stay behind."""
    folder = tmp_path / "job"
    folder.mkdir()
    child = [sys.executable, "-m", "shell.render", str(folder)]
    done = subprocess.run(child, stdin=subprocess.DEVNULL, capture_output=True, timeout=600, check=False)
    assert done.returncode == 1
    assert not folder.exists()
