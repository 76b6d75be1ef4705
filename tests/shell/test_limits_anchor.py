"""Limits of anchor loss: the closed form of a torque on a half-space, balance, squares, bad input."""

from math import pi, sqrt

import numpy as np
import pytest

from shell.damping.anchor import anchor_loss, unbalance_loss
from shell.elastic import Elastic, VaryingElastic
from shell.errors import ShellError
from shell.meridian import hemisphere
from shell.modes import Mode, solve_modes
from shell.resonator import Resonator, Stem
from tests.shell.samples import DOME, SILICA


@pytest.fixture(scope="module")
def standing() -> Resonator:
    return hemisphere(radius=15e-3, thickness=0.86e-3, support="stem", stem=Stem(2.5e-3, -5e-3, 0.5e-3))


def _torsion(resonator: Resonator) -> Mode:
    return next(mode for mode in solve_modes(resonator, SILICA, 0, count=2) if mode.label == "torsion")


def test_torque_on_a_stiff_half_space(standing: Resonator) -> None:
    """1/Q = T² ω/(12 π ρ c⁵ ∫ ρ u² dV) with T = ω² ∫ ρ r u_θ dV: half the power of a point torque 2T in full space.

    The base is 100 times as stiff, so that the mode stays clamped, and the wave long against the stem.
    """
    mode = _torsion(standing)
    solution = mode.solution
    assert solution is not None
    base = Elastic(100 * SILICA.E, SILICA.nu, SILICA.rho)
    found = anchor_loss(mode, SILICA, base)
    omega = 2 * pi * mode.frequency
    torque = 0.0
    for group, displacement in zip(solution.system.groups, solution.displacement, strict=True):
        table = group.table
        if hasattr(table, "radius"):
            radius = table.radius[:, None]
        else:
            section = group.section  # type: ignore[union-attr]
            eta = np.polynomial.legendre.leggauss(table.volume.shape[2])[0]
            radius = section.r[..., None] - section.tangent_z[..., None] * section.thickness[..., None] / 2 * eta
        torque += omega**2 * SILICA.rho * 2 * pi * float(np.sum(radius * displacement[:, :, 1] * table.volume))
    c = sqrt(base.G / base.rho)
    expected = torque**2 * omega / (12 * pi * base.rho * c**5 * solution.mass)
    assert found.inverse_q == pytest.approx(expected, rel=2e-3)
    assert found.frequency == pytest.approx(mode.frequency, rel=1e-3)
    assert found.frequency < mode.frequency


@pytest.mark.slow
def test_balanced_mode_hardly_reaches_the_base(standing: Resonator) -> None:
    """N = 2 dies out along the stem; a stem a fifth as long lets orders of magnitude more through."""
    short = hemisphere(radius=15e-3, thickness=0.86e-3, support="stem", stem=Stem(2.5e-3, 10e-3, 0.5e-3))
    long_one, short_one = (anchor_loss(solve_modes(r, SILICA)[0], SILICA) for r in (standing, short))
    assert 0 < long_one.inverse_q < 1e-15
    assert short_one.inverse_q > 1e4 * long_one.inverse_q
    assert long_one.body == pytest.approx(1.0, abs=1e-9)


def test_unbalanced_rim_pushes_its_base_as_a_moving_mass_does(standing: Resonator) -> None:
    """A point mass has all harmonics: its loss is least where it sits on a node; two opposite ones have none of them."""
    (mode,) = solve_modes(standing, SILICA)
    found = unbalance_loss(mode, SILICA)
    mass, azimuth = 1e-6, 0.4

    def loss(masses: dict[float, float], pattern: float) -> float:
        first, third = (sum(m * np.exp(1j * k * at) for at, m in masses.items()) for k in (1, 3))
        wave = found.wave(first, third)
        return found.inverse_q(first, third) + float(np.real(wave * np.exp(-4j * pattern))) / 2

    one = {azimuth: mass}
    assert found.first > 0
    assert found.third > 0
    assert abs(found.joint) <= np.sqrt(found.first * found.third) * (1 + 1e-6)
    assert loss({azimuth: 2 * mass}, 0.1) == pytest.approx(4 * loss(one, 0.1), rel=1e-12)
    assert loss({azimuth: mass, azimuth + pi: mass}, 0.1) == pytest.approx(0.0, abs=1e-12 * loss(one, 0.1))
    # at an antinode the mass moves radially, at a node around: the force of both is along and across its azimuth
    turned = [loss({azimuth + turn: mass}, turn) for turn in (0.0, 0.7)]
    assert turned[0] == pytest.approx(turned[1], rel=1e-12)
    antinode, node = loss(one, azimuth), loss(one, azimuth + pi / 4)
    assert antinode > node >= 0


def test_bad_input_is_said(standing: Resonator) -> None:
    (free,) = solve_modes(DOME, SILICA)
    with pytest.raises(ShellError, match="on a stem"):
        anchor_loss(free, SILICA)
    (mode,) = solve_modes(standing, SILICA)
    with pytest.raises(ShellError, match="one material"):
        anchor_loss(mode, VaryingElastic(72.7e9, 0.17, 2203.0))
    with pytest.raises(ShellError, match="only the first and third harmonics"):
        unbalance_loss(solve_modes(standing, SILICA, 3)[0], SILICA)
