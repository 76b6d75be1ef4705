"""Charges of the piezo elements, BVG eqs. (27)–(29), lead to the rate that was planted in the equations of motion."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from compensation.errors import CompensationError
from compensation.loop import BellResonator
from compensation.piezo import PiezoPair, convert_charge, read_rate_from_charges

BELL = BellResonator(m0=2e-3, b=1.1e-3, c0=2e-3 * (2 * np.pi * 4000) ** 2, c1=3.0)


def test_rate_from_charges():
    planted, omega, rebalance = 3.0, BELL.omega, 4.0
    primary, secondary = PiezoPair(-171e-12, 12e-6, 2.5e3), PiezoPair(-171e-12, 12e-6, 2.4e3)

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
    charges = [(pair, x / pair.scale * 0.6, x / pair.scale * 0.4) for pair, x in ((primary, y[0]), (secondary, y[1]))]
    at, rate = read_rate_from_charges(BELL, omega, time, *charges, -rebalance * y[3])
    assert np.max(np.abs(rate[at > 0.002] - planted)) < 0.01 * planted


def test_charge_of_a_stress_and_its_volts():
    """1 MPa in both directions on 12 mm² of d31 = −171 pC/N: −4.1 nC; over 1 nF, 4.1 V."""
    charge = PiezoPair(-171e-12, 12e-6, 1.0).charge(1e6, 1e6)
    assert charge == pytest.approx(-4.104e-9)
    assert convert_charge(charge, 1e-9) == pytest.approx(4.104)
    with pytest.raises(CompensationError, match="feedback capacitor"):
        convert_charge(charge, 0.0)
