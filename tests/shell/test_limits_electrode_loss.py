"""What the resistances of charged electrodes lose: eigenvalues of the mode with its circuits, and the limits of small and large ones."""

import numpy as np
import pytest

from shell.electrodes import VACUUM, Electrodes, ring_of_electrodes
from shell.imperfection import Pair
from shell.modes import solve_modes
from tests.shell.samples import DOME, SILICA


@pytest.fixture(scope="module")
def pair():
    return Pair(solve_modes(DOME, SILICA, 2, theory="shell")[0])


def by_circuits(ring, R):
    """1/Q from the eigenvalues of two orthogonal modes and one charge q for each electrode, V = q/C(x) + R dq/dt, linear about rest."""
    n, omega = ring.pair.mode.harmonic, 2 * np.pi * ring.pair.mode.frequency
    mass = np.pi * ring.pair.scale / omega**2
    count = len(ring.electrodes)
    A = np.zeros((4 + count, 4 + count))  # x_c, x_s, their velocities, charges
    A[0, 2] = A[1, 3] = 1.0
    A[2, 0] = A[3, 1] = -(omega**2)
    for k, one in enumerate(ring.electrodes):
        area, w, theta, weight, _ = ring._patch(one)
        C = VACUUM / ring.gap * area.sum() * weight.sum()
        slope = VACUUM / ring.gap**2 * (area @ w) * np.array([weight @ np.cos(n * theta), weight @ np.sin(n * theta)])
        push = one.voltage / C * slope  # force per charge, volts per displacement
        A[2:4, 4 + k] = push / mass
        A[4 + k, :2], A[4 + k, 4 + k] = push / R, -1 / (R * C)
        A[2:4, :2] += np.outer(slope, push) * one.voltage / mass * -1  # the force at a constant charge, not voltage
    roots = np.linalg.eigvals(A)
    swinging = roots[roots.imag > omega / 2]
    return float(np.mean(-2 * swinging.real / swinging.imag))


@pytest.mark.parametrize("R", [1e3, 1e6, 3e7])
def test_limits_it_is_the_damping_of_mode_and_circuits(pair, R):
    ring = Electrodes(pair, ring_of_electrodes(16, 0.8, 60.0, 0.1, 0.6, 1.0), 100e-6)
    assert ring.ohmic_loss(R) == pytest.approx(by_circuits(ring, R), rel=2e-3)


def test_limits_it_goes_as_the_square_of_the_bias_and_vanishes_with_the_resistance(pair):
    ring = Electrodes(pair, ring_of_electrodes(8, 0.6, 50.0), 80e-6)
    twice = Electrodes(pair, ring_of_electrodes(8, 0.6, 100.0), 80e-6)
    assert twice.ohmic_loss(1e4) == pytest.approx(4 * ring.ohmic_loss(1e4), rel=1e-12)
    assert ring.ohmic_loss(1e-3) == pytest.approx(1e-6 * ring.ohmic_loss(1e3), rel=1e-4)
    assert ring.ohmic_loss(1e12) < 1e-3 * ring.ohmic_loss(1e8)  # the charge cannot flow
