"""Charges of the piezo elements, BVG eqs. (27)–(29), lead to the rate that was planted in the equations of motion.

    F_i = (σ_νν + σ_φφ) d₃₁ S_i (27),    p = ς_p (F₃ + F₇),  q = ς_q (F₄ + F₈) (28)

(29) is (26) with p and q from the charges; it is printed for the instant and singular where ṗ = 0, so amplitudes are used.
"""

import numpy as np
from scipy.integrate import solve_ivp

from compensation.loop import BellResonator, read_rate_from_loop
from compensation.motion import demodulate

BELL = BellResonator(m0=2e-3, b=1.1e-3, c0=2e-3 * (2 * np.pi * 4000) ** 2, c1=3.0)


def test_rate_from_charges():
    planted, omega, rebalance = 3.0, BELL.omega, 4.0
    scales = 2.5e3, 2.4e3  # ς, m/C

    def slope(_, y):
        p, q, dp, dq = y
        return [
            dp,
            dq,
            (2 * planted * BELL.b * dq - BELL.c0 * p - BELL.c1 * q) / BELL.m0,
            (-rebalance * dq - 2 * planted * BELL.b * dp - BELL.c0 * q - BELL.c1 * p) / BELL.m0,
        ]

    step = 2 * np.pi / omega / 24
    time = step * np.arange(int(0.02 / step))
    y = solve_ivp(slope, (0, time[-1]), [0, 0, omega * 1e-6, 0], "DOP853", time, rtol=1e-10, atol=1e-16).y
    charges = [(0.6 * x / scale, 0.4 * x / scale) for scale, x in zip(scales, y, strict=False)]
    p, q = (scale * (one + other) for scale, (one, other) in zip(scales, charges, strict=True))
    (at, P), (_, Q), (_, F) = (demodulate(time, x, omega) for x in (p, q, -rebalance * y[3]))
    rate = read_rate_from_loop(BELL, omega, at, P, Q, F)
    assert np.max(np.abs(rate[at > 0.002] - planted)) < 0.01 * planted
