"""Transfer functions against closed forms, state space and an independent library."""

import numpy as np
import pytest
from scipy import integrate, signal

from compensation.errors import CompensationError
from compensation.transfer import TransferFunction

TURNING = TransferFunction((2.0, 1 - 3j), (1.0, 4 + 5j, 6 - 1j))


def test_frequency_response_equals_scipy():
    frequency = np.array([-30.0, 0.7, 400.0])
    expected = signal.freqs(TURNING.numerator, TURNING.denominator, frequency)[1]
    np.testing.assert_allclose(TURNING.respond(frequency), expected, rtol=1e-14)


def test_step_response_of_a_first_order_lag():
    lag = TransferFunction((3.0,), (0.5, 1.0))
    time = np.linspace(0, 4, 41)
    np.testing.assert_allclose(lag.simulate(time, np.ones(41)), 3 * (1 - np.exp(-time / 0.5)), rtol=1e-13)


def test_double_pole_under_a_ramp():
    twice = TransferFunction((1.0,), (1.0, 2.0, 1.0))
    time = np.linspace(0, 6, 61)
    expected = time - 2 + (time + 2) * np.exp(-time)
    np.testing.assert_allclose(twice.simulate(time, time), expected, atol=1e-12)


def test_complex_simulation_equals_a_general_integrator():
    time = np.linspace(0, 2, 401)
    drive = np.sin(7 * time) + 1j * time
    A, B, C, D = TURNING.realise()
    solution = integrate.solve_ivp(
        lambda t, x: A @ x + B * np.interp(t, time, drive),
        (0, 2),
        np.zeros(2, complex),
        t_eval=time,
        rtol=1e-10,
        atol=1e-12,
        max_step=0.005,
    )
    np.testing.assert_allclose(TURNING.simulate(time, drive), C @ solution.y + D * drive, atol=1e-8)


def test_uneven_times_give_the_same_output():
    even = np.linspace(0, 2, 201)
    drive = np.where(even < 1, even, 2 - even)
    keep = np.sort(np.random.default_rng(1).choice(np.arange(1, 200), 60, replace=False))
    keep = np.unique(np.r_[0, 100, 200, keep])
    np.testing.assert_allclose(
        TURNING.simulate(even[keep], drive[keep]), TURNING.simulate(even, drive)[keep], rtol=1e-10, atol=1e-13
    )


def test_settled_start_stays_settled():
    output = TURNING.simulate(np.linspace(0, 9, 50), np.full(50, 2.5), settled=True)
    np.testing.assert_allclose(output, 2.5 * TURNING.steady_gain, rtol=1e-12)


def test_series_and_scale():
    both = TURNING * TransferFunction((1.0,), (1.0, 3.0)) * 2.0
    assert both.respond(1.3) == pytest.approx(2 * TURNING.respond(1.3) / (3 + 1.3j), rel=1e-13)
    assert set(np.round(both.poles, 9)) == {*np.round(TURNING.poles, 9), -3}


def test_a_pure_number_is_a_transfer_function():
    assert TransferFunction((4.0,), (2.0,)).simulate([0, 1, 3], [1, 2, 3]) == pytest.approx([2, 4, 6])


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda: TransferFunction((1.0,), (0.0,)), "denominator"),
        (lambda: TransferFunction((np.nan,), (1.0,)), "not finite"),
        (lambda: TransferFunction((1.0, 0.0), (1.0,)).simulate([0, 1], [0, 1]), "not causal"),
        (lambda: TransferFunction((1.0,), (1.0, 0.0)).steady_gain, "pole at s = 0"),
        (lambda: TransferFunction((1.0,), (1.0, 0.0)).simulate([0, 1], [1, 1], settled=True), "settled start"),
        (lambda: TURNING.simulate([0, 2, 1], [0, 0, 0]), "row 2 to row 3"),
        (lambda: TURNING.simulate([0, 1], [0, np.nan]), "finite"),
    ],
)
def test_what_cannot_be_computed_is_refused(act, words):
    with pytest.raises(CompensationError, match=words):
        act()
