"""The piezo system of the bell, BVG eqs. (27)–(29): from voltages of its elements alone comes the rate that was planted."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from compensation.errors import CompensationError
from compensation.loop import BellResonator, read_rate_from_drive, read_rate_from_loop
from compensation.motion import demodulate
from compensation.piezo import DRIVE_Q, SENSE_Q, PiezoRing

BELL = BellResonator(m0=2e-3, b=1.1e-3, c0=2e-3 * (2 * np.pi * 4000) ** 2, c1=3.0)
RING = PiezoRing(stress=3e11, d31=-1.7e-10, area=1.8e-5, arc=np.radians(20), capacitance=1e-9)
STEP = 2 * np.pi / BELL.omega / 24


def test_charge_is_the_mean_stress_under_the_element():
    """F = d₃₁ S · mean of Σ (p cos 2θ + q sin 2θ) over the arc of each element, by quadrature."""
    p, q = 2e-6, -0.7e-6
    for i, charge in enumerate(RING.charges(p, q)):
        middle = np.pi / 4 * i
        ends = middle - RING.arc / 2, middle + RING.arc / 2
        mean = quad(lambda a: RING.stress * (p * np.cos(2 * a) + q * np.sin(2 * a)), *ends)[0] / RING.arc
        assert charge == pytest.approx(RING.d31 * RING.area * mean, rel=1e-10)


def test_displacements_come_back_from_voltages():
    p, q = RING.displacements(RING.voltages(RING.charges(2e-6, -0.7e-6)))
    assert (p, q) == pytest.approx((2e-6, -0.7e-6), rel=1e-12)


def test_elements_give_back_the_work_that_charges_them():
    """Reciprocity: a slow closed path of displacement and voltage returns no net energy, ∮ (f·dx + F dV) = 0 of the enthalpy."""
    x = np.array([2e-6, -0.7e-6])
    V = np.linspace(-5.0, 9.0, 8)
    enthalpy = RING.charges(*x) @ V
    assert RING.forces(V) @ x == pytest.approx(enthalpy, rel=1e-12)


def run_gyro(planted, gain, sensed, driven, seconds=0.03):
    """Voltages of all amplifiers and of the drives while a controller of voltages alone holds q: eq. (23) with the elements as springs see them."""
    e = RING.coupling
    c = -RING.capacitance  # volts of an amplifier to charge

    # the rates of the sensed amplifiers, on the driven pair, against what they see, with the sign that damps
    seen = -sum(e[j - 1] for j in sensed) / RING.capacitance
    sign = np.sign(sum(e[i - 1, 1] for i in sensed) * sum(e[i - 1, 1] for i in driven))
    on = np.zeros(8)
    on[[i - 1 for i in driven]] = sign * gain
    volts = np.outer(on, seen)  # of the drives, by ṗ and q̇
    turning = 2 * planted * BELL.b * np.array([[0.0, 1.0], [-1.0, 0.0]])
    elastic = np.array([[BELL.c0, BELL.c1], [BELL.c1, BELL.c0]])
    motion = np.block([[np.zeros((2, 2)), np.eye(2)], [-elastic / BELL.m0, (e.T @ volts + turning) / BELL.m0]])
    time = STEP * np.arange(int(seconds / STEP))
    start = [0, 0, BELL.omega * 1e-6, 0]
    y = solve_ivp(lambda _, y: motion @ y, (0, time[-1]), start, "DOP853", time, rtol=1e-10, atol=1e-16).y
    return time, (e @ y[:2]) / c, volts @ y[2:], y


@pytest.mark.parametrize(
    ("sensed", "driven"), [(SENSE_Q, DRIVE_Q), (DRIVE_Q, SENSE_Q)], ids=["section 3.2", "section 2.2"]
)
def test_rate_from_voltages(sensed, driven):
    """Either choice of the paper reads 3 rad/s: the signs of q and of its force change together."""
    planted = 3.0
    time, amplifiers, drives, _ = run_gyro(planted, 2e-3, sensed, driven)
    scale_p = RING.scales[0]
    scale_q = RING.scales[1] * (1 if sensed == SENSE_Q else -1)
    p = scale_p * (amplifiers[2] + amplifiers[6])
    q = scale_q * sum(amplifiers[i - 1] for i in sensed)
    force = RING.forces(drives)[1]
    (at, P), (_, Q), (_, F) = (demodulate(time, x, BELL.omega) for x in (p, q, force))
    rate = read_rate_from_loop(BELL, BELL.omega, at, P, Q, F)
    inside = (at > 0.002) & (at < at[-1] - 0.002)
    assert np.max(np.abs(rate[inside] - planted)) < 0.01 * planted
    assert np.max(np.abs(Q[inside])) < 0.5 * planted * 2 * 0.275 * 0.03 * np.max(np.abs(P))  # the force does hold it


@pytest.mark.slow
def test_second_form_reads_the_same_rate_from_the_driven_axis():
    """(24) has two forms; in open loop, with q in motion, the first of (23) gives the rate too."""
    planted = 3.0
    time, _, _, y = run_gyro(planted, 0.0, SENSE_Q, DRIVE_Q, seconds=0.06)
    (at, P), (_, Q) = (demodulate(time, x, BELL.omega) for x in y[:2])
    still = np.zeros_like(P)
    inside = (at > 0.02) & (at < at[-1] - 0.002)
    one = read_rate_from_loop(BELL, BELL.omega, at, P, Q)
    other = read_rate_from_drive(BELL, BELL.omega, at, P, Q, still)
    assert np.max(np.abs(one[inside] - planted)) < 0.01 * planted
    assert np.max(np.abs(other[inside] - planted)) < 0.01 * planted


def test_what_no_elements_can_be_is_refused():
    with pytest.raises(CompensationError, match="45° at most"):
        PiezoRing(1.0, 1.0, 1e-5, 1.0, 1e-9)
    with pytest.raises(CompensationError, match="does not vibrate"):
        read_rate_from_drive(BELL, BELL.omega, [0, 1], [1, 1], [0, 0], [0, 0])
