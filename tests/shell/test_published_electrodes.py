"""Electrostatic softening, its 4θ part, trim voltages and pull-in against closed forms."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
from scipy.linalg import eigh

from shell.curves import Line
from shell.elastic import find_constants
from shell.electrodes import VACUUM, Electrode, Electrodes, along, reach, ring_of_electrodes, trim_voltages
from shell.errors import ShellError
from shell.imperfection import Pair, wave
from shell.imperfection.block import condense
from shell.meridian import hemisphere
from shell.modes import solve_modes
from shell.resonator import Resonator
from shell.sparse import assemble_elements
from tests.shell.samples import SILICA

R, H = 15e-3, 0.8558e-3


@pytest.fixture(scope="module")
def pair():
    (mode,) = solve_modes(hemisphere(radius=R, thickness=H), SILICA, 2)
    return Pair(mode)


def charged(ring, volts):
    """The same electrodes at other voltages, one for all or one for each."""
    each = np.broadcast_to(volts, len(ring.electrodes))
    return replace(
        ring, electrodes=tuple(replace(one, voltage=float(v)) for one, v in zip(ring.electrodes, each, strict=True))
    )


def uniform_softening(frequency, rho, h, gap, voltage):
    """δf/f = -½ ε₀ V²/(g³ ρ h ω²): a full ring with mode factor 1, as it was published."""
    return -VACUUM * voltage**2 / (2 * gap**3 * rho * h * (2 * pi * frequency) ** 2)


def test_a_full_ring_softens_by_30_28_ppm_and_969_ppm():
    assert 1e6 * uniform_softening(4432.0, 2203.0, H, 100e-6, 100.0) == pytest.approx(-30.28, abs=5e-3)
    assert 1e6 * uniform_softening(4432.0, 2203.0, H, 50e-6, 200.0) == pytest.approx(-969.0, abs=0.5)


def test_a_thin_dome_feels_its_mode_factor_of_rayleighs_solution():
    """Thin limit: ∫ w² dA/∫ |u|² dA = ∫ (2 + cos φ)² t⁴ sin φ dφ / J, t = tan(φ/2); it goes there like √(h/R)."""
    phi = (np.arange(20000) + 0.5) / 20000 * pi / 2
    t = np.tan(phi / 2) ** 4 * np.sin(phi)
    normal, tangent = (2 + np.cos(phi)) ** 2 @ t, 2 * np.sin(phi) ** 2 @ t
    expected = normal / (normal + tangent)
    found = []
    for ratio in (4e-4, 1e-4):
        (mode,) = solve_modes(hemisphere(radius=R, thickness=ratio * R), SILICA, 2)
        shift = Electrodes(Pair(mode), ring_of_electrodes(1, 1.0, 0.01), 100e-6).soften().shift
        found.append(shift / uniform_softening(mode.frequency, 2203.0, ratio * R, 100e-6, 0.01))
    assert 2 * found[1] - found[0] == pytest.approx(expected, rel=1e-3)


def squares_of_a_ring(volts, gap, h, width):
    """ω² of the n = 2 mode of an elastic ring in a coaxial electrode: curvatures of its energy with exact geometry, stretched by the pull."""
    theta, I = 2 * pi * np.arange(64) / 64, width * h**3 / 12

    def energy(a, w, v):
        r, turned = R + a + w * np.cos(2 * theta), 1 + 2 * v / R * np.cos(2 * theta)
        dr, ddr, bent = -2 * w * np.sin(2 * theta), -4 * w * np.cos(2 * theta), -4 * v / R * np.sin(2 * theta)
        length = np.hypot(dr, r * turned)
        curvature = (dr * (2 * dr * turned + r * bent) - r * turned * (ddr - r * turned**2)) / length**3
        stretch, bend = length / R - 1, (curvature * length - 1) / R
        elastic = 2 * pi * R * np.mean(0.5 * SILICA.E * (width * h * stretch**2 + I * bend**2))
        return elastic - 0.5 * volts**2 * VACUUM * width * 2 * pi * np.mean(
            turned / np.log1p((R + gap - r) / (r + h / 2))
        )

    a, d = 0.0, 1e-9
    for _ in range(6):
        below, here, above = (energy(a + side * d, 0, 0) for side in (-1, 0, 1))
        a -= d * (above - below) / 2 / (above - 2 * here + below)
    d, rest = 2e-6, energy(a, 0, 0)
    mixed = sum(s * t * energy(a, s * d, t * d) for s in (-1, 1) for t in (-1, 1)) / 4
    w, v = (sum(energy(a, *(s * d * one)) for s in (-1, 1)) - 2 * rest for one in np.eye(2))
    return float(np.linalg.eigvalsh([[w, mixed], [mixed, v]])[0]) / d**2 / (SILICA.rho * width * h * pi * R)


def test_limits_what_the_static_pull_and_the_round_field_take_of_the_softening_is_one_gap_over_radius():
    """The stress of the pull takes 1.5 g/R, the curvature of the field gives 0.5 g/R back: the springs alone are so much too soft."""
    h, width, gap, volts = 0.15e-3, 1e-3, 300e-6, 30.0
    ring = Resonator((Line((R, 0.0), (R, width)),), ((0.0, h), (1.0, h)))
    (mode,) = solve_modes(ring, SILICA, 2)
    electrodes = Electrodes(Pair(mode), ring_of_electrodes(1, 1.0, volts), gap, face="outer")
    true, plain = (squares_of_a_ring(one, gap, h, width) for one in (volts, 0.0))
    springs = electrodes.mean * (2 * pi * mode.frequency) ** 2
    assert (springs / (true - plain) - 1) / (gap / R) == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("first", [0.0, 0.6])
def test_the_root_is_the_shell_solved_with_the_springs_in_it(first):
    """Dense matrices of the shell with the negative springs added, up to a third of its stiffness; the mode's change of shape is left."""
    (mode,) = solve_modes(hemisphere(radius=R, thickness=H), SILICA, 2, theory="shell")
    system = mode.solution.system
    constants = tuple(find_constants(g.table.position, SILICA, g.table.plane_stress) for g in system.groups)
    matrices, mass = system.operators(constants, 0.0)
    K = assemble_elements(system.pattern.unknowns, matrices, system.pattern.size).toarray()
    M = mass @ np.eye(len(K))
    block = condense(system, constants, 0.0)  # without solid parts its unknowns are all
    x, weights = np.polynomial.legendre.leggauss(200)
    phi, weights = (first + (1 - first) * (x + 1) / 2) * pi / 2, weights * (1 - first) * pi / 4
    w = np.array([block.moves(mode.resonator, at / (pi / 2), -1.0)[2] for at in phi])
    springs = (w.T * weights * (R - H / 2) ** 2 * np.sin(phi)) @ w  # ∫ w² dA of the inner face, over ∫ cos² nθ dθ
    ring = Electrodes(Pair(mode), ring_of_electrodes(1, 1.0, 0.0, first=first), 100e-6)
    for volts in (300.0, 3000.0, 9000.0):
        exact = eigh(
            K - VACUUM * volts**2 / 100e-6**3 * springs, M, eigvals_only=True, subset_by_index=[0, 0], driver="gvx"
        )
        found = charged(ring, volts)
        away = sqrt(exact[0] / mode.solution.eigenvalue) - 1
        assert found.soften().shift == pytest.approx(away, abs=2e-8 + 1e-3 * found.mean**2)
    assert abs(found.mean / 2 - away) > 1e-2  # which the first order alone misses


def test_softening_goes_with_the_square_of_the_volts_and_the_cube_of_the_gap(pair):
    ring = Electrodes(pair, ring_of_electrodes(16, 0.8, 50.0), 100e-6)
    base = ring.soften()
    assert charged(ring, 100.0).mean == pytest.approx(4 * ring.mean, rel=1e-12)
    half = Electrodes(pair, ring_of_electrodes(16, 0.8, 50.0), 50e-6)
    assert half.mean == pytest.approx(8 * ring.mean, rel=1e-12)
    assert base.relative < 1e-12 * abs(base.shift)  # sixteen equal electrodes do not split n = 2
    full = Electrodes(pair, ring_of_electrodes(1, 1.0, 50.0), 100e-6)
    assert ring.mean == pytest.approx(0.8 * full.mean, rel=1e-12)


def test_waves_of_the_gap_split_as_the_inverse_cube_says(pair):
    ring = ring_of_electrodes(1, 1.0, 100.0)
    mean, z = Electrodes(pair, ring, 100e-6, wave(4, 1e-3, 0.2)).soften().squares
    assert 2 * z / mean == pytest.approx(-3e-3 * np.exp(0.8j), rel=1e-5)
    # 1/(1 + x)³ = 1 - 3 x + 6 x²: waves 1 and 3 of 1 % each make 6 · 1e-4 of the wave 4
    pairwise = Electrodes(pair, ring, 100e-6, wave(1, 0.01) + wave(3, 0.01)).soften()
    assert (pairwise.wave / pairwise.shift).real == pytest.approx(6e-4, rel=2e-3)
    first = Electrodes(pair, ring, 100e-6, wave(1, 0.01)).soften()
    assert first.relative < 1e-5 * abs(first.shift)


def test_one_electrode_pulls_its_own_azimuth_soft(pair):
    split = Electrodes(pair, (Electrode(0.3, 0.2, 100.0, 0.7, 1.0),), 100e-6).soften()
    assert split.slow_axis == pytest.approx(0.3, abs=1e-9)
    mean, z = split.squares
    assert mean == pytest.approx(-abs(z) / (np.sin(0.4) / 0.4), rel=1e-9)  # ∫ cos 4θ over the width


def test_pull_in_of_a_balanced_ring_is_where_the_frequency_vanishes(pair):
    ring = Electrodes(pair, ring_of_electrodes(1, 1.0, 100.0), 50e-6)
    assert ring.pull_in == pytest.approx(1 / sqrt(-ring.mean), rel=2e-4)


def test_pull_in_of_a_small_electrode_is_that_of_two_plates(pair):
    """V² = 8 k g³/(27 ε₀ A): √(8/27) of the voltage whose softening equals the stiffness."""
    small = Electrodes(pair, (Electrode(0.0, 0.01, 100.0, 0.985, 1.0),), 50e-6)
    softest = abs(small.mean) + abs(small.soften().squares[1])
    assert small.pull_in == pytest.approx(sqrt(8 / 27 / softest), rel=2e-3)


def test_trim_voltages_null_the_split_within_their_reach(pair):
    sixteen = Electrodes(pair, ring_of_electrodes(16, 0.8, 0.0, first=0.7), 50e-6)
    limit, f = 100.0, pair.mode.frequency
    most = reach(sixteen, limit)
    for angle in np.linspace(0, 2 * pi, 7):
        wanted = 0.999 * most * np.exp(1j * angle)
        trim = trim_voltages(sixteen, wanted, limit)
        assert max(trim.voltages) <= limit * (1 + 1e-9)
        assert abs(charged(sixteen, trim.voltages).soften().squares[1] + wanted) < 1e-6 * most
    longest = abs(sixteen.per_square_volt[1]).sum() * limit**2  # no direction reaches as far
    with pytest.raises(ShellError, match=r"at most 0\.\d+ Hz along this axis \(0\.239 Hz along any\)"):
        trim_voltages(sixteen, longest, limit)
    assert 0.1 < most * f < 1.0  # Hz


def test_electrodes_that_act_along_one_axis_null_a_split_there_and_no_other(pair):
    """Eight of them reach none along any axis; that of the split that four of them make was refused."""
    eight, limit = Electrodes(pair, ring_of_electrodes(8, 0.75, 0.2), 80e-6), 100.0
    assert reach(eight, limit) == 0.0
    made = complex(charged(eight, [0.0, 60.0] * 4).soften().squares[1])
    trim = trim_voltages(eight, made, limit)
    assert trim.voltages == pytest.approx([60.0, 0.0] * 4, abs=1e-3)
    most = along(eight, made, limit)
    assert most == pytest.approx(abs(made) * (limit / 60.0) ** 2, rel=1e-9)
    with pytest.raises(ShellError, match=r"along this axis \(0 Hz along any\)"):
        trim_voltages(eight, 1.01 * most * made / abs(made), limit)
    assert along(eight, made * np.exp(1j), limit) == 0.0
    with pytest.raises(ShellError, match=r"no voltage on these electrodes .* such as 16 around"):  # it said to raise it
        trim_voltages(eight, made * np.exp(1j), limit)


def test_trim_voltages_do_not_pull_the_shell_sideways(pair):
    """A quarter of a turn leaves what an electrode does to n = 2 alone: Σ V² exp(iθ) can be 0 at the same null and Σ V²."""
    sixteen = Electrodes(pair, ring_of_electrodes(16, 1.0, 0.0), 100e-6)
    turn, per_volt = np.exp(2j * pi * np.arange(16) / 16), abs(sixteen.per_square_volt[1][0])
    wave = 40000 * per_volt * np.exp(1j * np.radians(220))  # nulled by Σ V² exp(4iθ) = 40 000 V² exp(220° i)
    squares = np.array(trim_voltages(sixteen, wave, 100.0).voltages) ** 2
    for side in range(0, 16, 4):
        # the third and fourth of every quarter act along 180° and 270°
        x, y = 10000 * np.cos(np.radians(40)), 10000 * np.sin(np.radians(40))
        np.testing.assert_allclose(squares[side : side + 4], [0, 0, x, y], atol=1e-3)
    assert abs(squares @ turn) < 1e-6 * squares.sum()
    assert abs(squares @ turn**3) < 1e-6 * squares.sum()


def test_coefficients_are_the_slopes_of_the_softening(pair):
    ring = Electrodes(pair, ring_of_electrodes(16, 0.8, 60.0), 80e-6)
    step = charged(ring, 60.01).soften().shift - charged(ring, 59.99).soften().shift
    assert ring.per_volt() == pytest.approx(step / 0.02, rel=1e-9)
    wider = Electrodes(pair, ring_of_electrodes(16, 0.8, 60.0), 80e-6 * (1 + 1e-5)).soften().shift
    assert ring.per_kelvin(1e-5) == pytest.approx(wider - ring.soften().shift, rel=1e-4)


def test_bad_electrodes_are_refused(pair):
    with pytest.raises(ShellError, match="pull in the shell"):
        Electrodes(pair, ring_of_electrodes(1, 1.0, 20000.0), 50e-6).soften()
    with pytest.raises(ShellError, match="is it in µm"):
        Electrodes(pair, ring_of_electrodes(1, 1.0, 100.0), 50e-3)
    with pytest.raises(ShellError, match="the gap closes"):
        Electrodes(pair, ring_of_electrodes(1, 1.0, 100.0), 50e-6, wave(2, 1.1)).soften()
    with pytest.raises(ShellError, match="share of the circle"):
        ring_of_electrodes(8, 1.2, 1.0)
