"""What callers of the solver rely on: names, labels, warnings, shapes, shares that add up."""

import pickle
from math import pi

import numpy as np
import pytest

from shell.elastic import VaryingElastic
from shell.errors import ShellError
from shell.materials import find_material
from shell.meridian import cylinder, hemisphere
from shell.modes import TheoryRangeWarning, solve_modes
from shell.resonator import Resonator, Stem
from tests.shell.samples import DOME, SILICA, STEMMED


def test_axisymmetric_modes_are_labelled_and_do_not_precess() -> None:
    modes = solve_modes(STEMMED, SILICA, 0, 2)
    assert [mode.label for mode in modes] == ["torsion", "axial"]
    assert [mode.bryan_factor for mode in modes] == [0, 0]
    assert [mode.index for mode in modes] == [0, 1]


@pytest.mark.parametrize("theory", ["solid", "shell"])
@pytest.mark.parametrize("resonator", [DOME, STEMMED], ids=["free", "stem"])
def test_shares_add_up(resonator: Resonator, theory: str) -> None:
    (mode,) = solve_modes(resonator, SILICA, theory=theory)
    parts = mode.energy_fractions
    assert parts.bending + parts.membrane + parts.shear + parts.root + parts.stem == pytest.approx(1, abs=1e-12)
    assert all(0 <= share <= 1 for share in (parts.bending, parts.membrane, parts.shear, parts.root, parts.stem))
    assert parts.bending > 0.85
    along = mode.along
    assert [along.elastic.sum(), along.kinetic.sum(), along.width.sum()] == pytest.approx([1, 1, 1], abs=1e-12)
    assert along.nu.sum() == pytest.approx(mode.sensitivities.nu, abs=1e-12)
    assert np.all(np.diff(along.position) >= 0)
    if resonator is DOME:
        assert along.thickness.sum() == pytest.approx(mode.sensitivities.thickness, abs=2e-4)
        assert parts.root == parts.stem == parts.kinetic_stem == 0


@pytest.mark.parametrize("n", [0, 1, 2])
@pytest.mark.parametrize(
    "resonator",
    [
        STEMMED,
        cylinder(12.5e-3, 0.6e-3, 18e-3, bottom_thickness=1e-3, clamp_radius=3e-3),
        hemisphere(15e-3, 0.9e-3, support="stem", stem=Stem(2.5e-3, (-5e-3, 20e-3), side="both")),
        hemisphere(15e-3, 0.9e-3, pole_angle=0.3, support="clamped-pole"),
    ],
    ids=["stem", "cup", "both stems", "clamped"],
)
def test_shape_is_continuous_and_vanishes_where_held(resonator: Resonator, n: int) -> None:
    """Points that several elements share have one displacement."""
    (mode,) = solve_modes(resonator, SILICA, n, tolerance=1e-3)
    fields = np.concatenate(
        [np.array([patch.r, patch.z, patch.u_r, patch.u_theta, patch.u_z]).reshape(5, -1) for patch in mode.shape(5)],
        axis=1,
    )
    order = np.lexsort(np.round(fields[:2] / resonator.size, 9))
    places, moved = fields[:2, order], fields[2:, order]
    same = np.hypot(*np.diff(places, axis=1)) < 1e-8 * resonator.size
    assert same.sum() > 50
    assert abs(np.diff(moved, axis=1)[:, same]).max() < 1e-6 * abs(moved).max()
    if resonator.stem:
        held = np.isin(np.round(places[1], 9), np.round([end for _, end in resonator.stem.roots], 9)) & (
            places[0] <= 2.5e-3 + 1e-9
        )
        assert held.sum() >= 2 * 5  # at least two cells across the end of the stem
        assert abs(moved[:, held]).max() == 0


def test_a_mode_can_be_sent_to_another_process() -> None:
    (mode,) = solve_modes(DOME, SILICA, theory="shell")
    assert pickle.loads(pickle.dumps(mode)) == mode


def test_a_shell_too_thick_for_its_theory_is_warned_of_by_how_much() -> None:
    with pytest.warns(TheoryRangeWarning, match=r"h/R = 0.2 is 2 times the limit"):
        solve_modes(hemisphere(15e-3, 3e-3), SILICA, theory="shell")
    solve_modes(hemisphere(15e-3, 3e-3), SILICA)


def test_a_shell_too_thin_for_double_precision_is_warned_of() -> None:
    with pytest.warns(TheoryRangeWarning, match="was not reached: relative error"):
        solve_modes(cylinder(15e-3, 4e-9, 30e-3), SILICA, theory="shell")


def test_a_tolerance_out_of_reach_is_said() -> None:
    with pytest.warns(TheoryRangeWarning, match="was not reached: relative error"):
        solve_modes(hemisphere(15e-3, 15e-6), SILICA, theory="shell", tolerance=1e-14)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"harmonic": -1}, "harmonic"),
        ({"harmonic": 101}, "up to harmonic n = 100"),
        ({"count": 0}, "at least one mode"),
        ({"theory": "beam"}, "solid, shell, rayleigh"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"resonator": "hrg-30mm"}, "give a Resonator, .* not str and Elastic"),
        ({"elastic": find_material("fused-silica")}, "a material's .elastic"),
    ],
)
def test_arguments_that_make_no_sense(options: dict[str, object], message: str) -> None:
    with pytest.raises(ShellError, match=message):
        solve_modes(**{"resonator": DOME, "elastic": SILICA} | options)  # type: ignore[arg-type]


def test_rayleigh_only_where_its_closed_form_holds() -> None:
    with pytest.raises(ShellError, match="constant thickness"):
        solve_modes(cylinder(12e-3, 1e-3, 20e-3), SILICA, theory="rayleigh")
    with pytest.raises(ShellError, match="free shell"):
        solve_modes(STEMMED, SILICA, theory="rayleigh")
    (mode,) = solve_modes(hemisphere(15e-3, 0.9e-3, rim_angle=1.9), SILICA, 3, theory="rayleigh")
    with pytest.raises(ShellError, match="no shape"):
        mode.shape()


def test_fields_are_checked() -> None:
    with pytest.raises(ShellError, match="must be positive"):
        solve_modes(DOME, VaryingElastic(lambda s: 1 - 2 * s, 0.17, 2203.0), theory="shell")


def test_closed_shell_has_modes() -> None:
    assert solve_modes(hemisphere(15e-3, 0.9e-3, rim_angle=pi), SILICA, theory="shell", count=2)[1].index == 1
