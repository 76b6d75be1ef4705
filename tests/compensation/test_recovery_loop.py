"""The rate of a bell-shaped gyro from its loop, against the integrated equations (23)."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from compensation.errors import CompensationError
from compensation.loop import BellResonator, read_rate_from_loop, scale_of_rebalance
from compensation.motion import demodulate

BELL = BellResonator(m0=2e-3, b=1.1e-3, c0=2e-3 * (2 * np.pi * 4000) ** 2, c1=3.0)
OMEGA = BELL.omega


def integrate(rate, rebalance, seconds=0.03):
    """p, q and f_q of eq. (23); f_p = 0, f_q = −rebalance · q̇ brings q to rest."""
    b, m0, c0, c1 = BELL.b, BELL.m0, BELL.c0, BELL.c1

    def slope(t, y):
        p, q, dp, dq = y
        Omega = rate(t)
        force = -rebalance * dq
        return [
            dp,
            dq,
            (2 * Omega * b * dq - c0 * p - c1 * q) / m0,
            (force - 2 * Omega * b * dp - c0 * q - c1 * p) / m0,
        ]

    step = 2 * np.pi / OMEGA / 24
    time = step * np.arange(int(seconds / step))
    y = solve_ivp(slope, (0, time[-1]), [0.0, 0.0, OMEGA * 1e-6, 0.0], "DOP853", time, rtol=1e-10, atol=1e-16).y
    return time, y[0], y[1], -rebalance * y[3]


@pytest.mark.slow
@pytest.mark.parametrize("rebalance", [0.0, 4.0], ids=["open loop", "force rebalance"])
def test_planted_rate_is_read(rebalance):
    planted = 3.0
    time, p, q, force = integrate(lambda t: planted * min(t / 0.01, 1.0), rebalance)
    at, P = demodulate(time, p, OMEGA)
    Q, F = demodulate(time, q, OMEGA)[1], demodulate(time, force, OMEGA)[1]
    read = read_rate_from_loop(BELL, OMEGA, at, P, Q, F if rebalance else None)
    inside = (at > 0.001) & (at < at[-1] - 0.001)
    error = read - planted * np.clip(at / 0.01, 0, 1)
    # The kink at 10 ms is smeared over two carrier periods (0.5 ms).
    away = inside & (np.abs(at - 0.01) > 0.001)
    assert np.max(np.abs(error[away])) < 0.01 * planted


def test_rebalance_force_is_proportional_to_the_rate():
    """Eq. (30): where the loop holds q at rest, Ω = K A_q."""
    time, p, _, force = integrate(lambda t: 2.0, 40.0)
    P, F = demodulate(time, p, OMEGA)[1], demodulate(time, force, OMEGA)[1]
    K = scale_of_rebalance(BELL, OMEGA, abs(P[-1]))
    velocity = 1j * P[-1] / abs(P[-1])
    # In phase with the velocity stands the rate, in quadrature the coupling c₁ that the loop holds down too.
    assert K * (F[-1] / velocity).real == pytest.approx(2.0, rel=1e-4)
    assert (F[-1] / velocity * 1j).real / abs(P[-1]) == pytest.approx(BELL.c1, rel=1e-3)


def test_what_cannot_be_read_is_refused():
    with pytest.raises(CompensationError, match="does not vibrate"):
        read_rate_from_loop(BELL, OMEGA, [0, 1], [0, 0], [0, 0])
    with pytest.raises(CompensationError, match="modal mass"):
        BellResonator(0.0, 1.0, 1.0)
