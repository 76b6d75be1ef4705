"""Demodulated dynamics against direct integration of the motion equations (1), carrier and all."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from compensation.demodulated import (
    map_integral_error,
    measure_rate,
    relate_rate_to_measured_rate,
    relate_rate_to_secondary,
    relate_rate_to_tuned_amplitude,
    respond_to_oscillating_rate,
)
from compensation.errors import CompensationError
from compensation.motion import SensitiveElement, demodulate, propagate_envelope, tune
from compensation.transfer import TransferFunction
from tests.compensation.integrated_motion import integrate_motion

MISTUNED = SensitiveElement(3141.0, 3200.0, 0.02, 0.03, 3100.0, q10=2.0, d3=0.6, g1=1.2, g2=1.7)
TUNED = tune(2 * np.pi * 500, 0.025)


def ramp(element, rate, *, rows=2001, length=10.0, rise=0.5):
    """A rate that rises from zero within `rise` time constants and then stays."""
    tau = 1 / (element.k1 * element.zeta1)
    time = np.linspace(0, length * tau, rows)
    return time, rate * np.clip(time / (rise * tau), 0, 1)


@pytest.mark.slow
@pytest.mark.parametrize("element", [TUNED, MISTUNED], ids=["tuned", "mistuned"])
def test_envelope_equals_the_integrated_carrier(element):
    time, rate = ramp(element, 5.0, length=4, rows=1601)
    motion = integrate_motion(element, time, rate, samples_per_cycle=96)
    envelope = propagate_envelope(element, time, rate)
    for real, complex_amplitude in ((motion.primary, envelope.primary), (motion.secondary, envelope.secondary)):
        carrier = (complex_amplitude * np.exp(1j * element.omega * time)).imag
        inside = time <= motion.time[-1]
        error = np.max(np.abs(CubicSpline(motion.time, real)(time) - carrier)[inside])
        # What is left is the spline between 96 samples of a cycle, about 5 (2π/96)⁴/384 = 2.4e-7 inside.
        assert error < 1e-6 * np.max(np.abs(real))


@pytest.mark.parametrize(("rows", "rate_of_convergence"), [(161, 12.0), (41, 3.0)], ids=["Magnus", "midpoint"])
def test_envelope_converges_with_the_step(rows, rate_of_convergence):
    """Where a step resolves the carrier the order is four, where it does not it is two: halving the step divides
    the error by 16 or 4 in the limit. The rate is a straight line, so that its sampling adds nothing."""
    element = SensitiveElement(1000.0, 1010.0, 0.02, 0.03, 1000.0)

    def final(n):
        time = np.linspace(0, 0.1, n)
        return propagate_envelope(element, time, 300 * time).secondary[-1]

    reference = final(20 * (rows - 1) + 1)
    coarse, fine = abs(final(rows) - reference), abs(final(2 * rows - 1) - reference)
    assert coarse / fine > rate_of_convergence


@pytest.mark.slow
def test_demodulated_carrier_gives_the_transfer_function_and_its_error_falls_with_the_rate():
    """Eq. (12) neglects the reaction on the primary: error (Ω/kζ)² of the carrier-resolved amplitude."""
    errors = []
    for rate in (2.0, 8.0):
        time, Omega = ramp(TUNED, rate, rows=401)
        motion = integrate_motion(TUNED, time, Omega)
        at, amplitude = demodulate(motion.time, motion.secondary, TUNED.omega)
        expected = relate_rate_to_secondary(TUNED).simulate(time, Omega)
        settled = abs(amplitude[-1] - expected[-1]) / abs(expected[-1])
        errors.append(settled / (rate / (TUNED.k1 * TUNED.zeta1)) ** 2)
        assert at[-1] < time[-1]
    # The factor before (Ω/kζ)² is one: Ω² g₁ g₂ ω² / (2ωkζ)².
    np.testing.assert_allclose(errors, 1.0, atol=0.05)


def test_reaction_on_the_primary_scales_with_the_square_of_the_rate():
    errors = []
    for rate in (0.1, 1.0):
        time, Omega = ramp(TUNED, rate)
        full = propagate_envelope(TUNED, time, Omega).secondary
        linear = relate_rate_to_secondary(TUNED).simulate(time, Omega)
        errors.append(np.max(np.abs(full - linear)) / np.abs(linear[-1]))
    assert errors[1] / errors[0] == pytest.approx(100, rel=0.01)
    assert errors[1] == pytest.approx((1 / (TUNED.k1 * TUNED.zeta1)) ** 2, rel=0.02)


def test_slow_form_errs_in_proportion_to_damping_and_tuned_amplitude_to_its_square():
    slow, tuned = [], []
    for zeta in (0.02, 0.01, 0.005):
        element = tune(2 * np.pi * 500, zeta)
        time, Omega = ramp(element, 0.01)
        whole = relate_rate_to_secondary(element)
        less = TransferFunction(whole.numerator, whole.denominator[1:])  # eq. (16): the second derivative neglected
        exact = whole.simulate(time, Omega)
        size = np.abs(exact[-1])
        slow.append(np.max(np.abs(less.simulate(time, Omega) - exact)) / size)
        simple = relate_rate_to_tuned_amplitude(element).simulate(time, Omega)
        tuned.append(np.max(np.abs(np.abs(exact) - simple)) / size)
    np.testing.assert_allclose(np.array(slow[:-1]) / slow[1:], 2, rtol=0.1)
    np.testing.assert_allclose(np.array(tuned[:-1]) / tuned[1:], 4, rtol=0.25)
    assert tuned[0] < 4e-4


@pytest.mark.slow
def test_start_from_rest():
    """The primary builds up, and the secondary with it; against the integrated carrier."""
    time = np.linspace(0, 0.12, 1201)
    rate = np.full(1201, 0.3)
    envelope = propagate_envelope(MISTUNED, time, rate, from_rest=True)
    motion = integrate_motion(MISTUNED, time, rate, from_rest=True, samples_per_cycle=96)
    carrier = (envelope.secondary * np.exp(1j * MISTUNED.omega * time)).imag
    inside = time <= motion.time[-1]
    error = np.abs(CubicSpline(motion.time, motion.secondary)(time) - carrier)[inside]
    assert np.max(error) < 1e-6 * np.max(np.abs(motion.secondary))


@pytest.mark.slow
def test_amplitude_response_is_that_of_the_integrated_carrier():
    """A rate that oscillates at λ: the secondary, through every cycle, has two side bands, A(λ) above and A(−λ) below the carrier."""
    side = 60.0
    time = np.arange(0.0, 0.4, 2e-4)
    motion = integrate_motion(MISTUNED, time, 1e-3 * np.cos(side * time), samples_per_cycle=24)
    late = motion.time > 0.15
    t, x = motion.time[late], motion.secondary[late]
    bands = [MISTUNED.omega, MISTUNED.omega + side, MISTUNED.omega - side]
    waves = np.column_stack([wave(w * t) for w in bands for wave in (np.cos, np.sin)])
    found = np.linalg.lstsq(waves, x, rcond=None)[0]
    for at, sign in ((2, 1), (4, -1)):
        amplitude, _ = respond_to_oscillating_rate(MISTUNED, sign * side)
        assert np.hypot(*found[at : at + 2]) == pytest.approx(amplitude * 1e-3 / 2, rel=2e-3)


@pytest.mark.slow
def test_derived_transfer_functions_are_those_of_the_numbers():
    """Eqs. (8)–(24) as SymPy derives them from (7), at the numbers of a mistuned element."""
    import sympy

    from compensation.derivation import demodulated as derived
    from compensation.derivation.oscillator import omega

    e, s = MISTUNED, 3.0 + 40j
    values = {
        derived.k_1: e.k1, derived.k_2: e.k2, derived.zeta_1: e.zeta1, derived.zeta_2: e.zeta2, derived.g_2: e.g2, derived.q_10: e.q10,
        omega: e.omega, derived.s: s, derived.lam: 41.0, derived.A_1: e.primary_amplitude,
    }  # fmt: skip

    def number(expression):
        return complex(sympy.sympify(expression).subs(values).evalf(18))

    A1, W = e.primary_amplitude, relate_rate_to_secondary(e)
    assert number(derived.settled_primary()) == pytest.approx(A1, rel=1e-12)
    assert number(derived.rate_to_secondary()) * A1 == pytest.approx(complex(W(s)), rel=1e-10)
    less = TransferFunction(W.numerator, W.denominator[1:])
    assert number(derived.rate_to_secondary(slow=True)) * A1 == pytest.approx(complex(less(s)), rel=1e-10)
    assert sorted(map(number, derived.poles()), key=abs) == pytest.approx(sorted(W.poles, key=abs), rel=1e-9)
    assert number(derived.slow_pole()) == pytest.approx(complex(less.poles[0]), rel=1e-9)
    response, amplitude, phase = map(number, derived.responses())
    assert response == pytest.approx(complex(W.respond(41.0)), rel=1e-10)
    assert amplitude * np.exp(1j * phase) == pytest.approx(response, rel=1e-10)
    assert complex(*(part.real for part in map(number, derived.primary_parts()))) == pytest.approx(A1, rel=1e-12)
    # A₂ = Re A₂ + j Im A₂ for a rate of real coefficients
    RR, RI, IR, II, P = map(number, derived.real_parts())
    both = (A1.real * RR + A1.imag * RI + 1j * (A1.real * IR + A1.imag * II)) / P
    assert both == pytest.approx(complex(W(s)), rel=1e-10)
    values |= {derived.k: 300.0, derived.zeta: 0.03}
    tuned = relate_rate_to_tuned_amplitude(tune(300.0, 0.03, q10=e.q10))(s) * e.g2 / 2
    assert number(derived.tuned_gain()) == pytest.approx(complex(tuned), rel=1e-10)


def test_tuned_transfer_function_symbolically():
    """Eq. (24): |A₁ j ω g₂ / (2 (kζ + jω))| is its gain, for every ζ, when ω = k √(1 − 2ζ²)."""
    import sympy

    k, zeta, g2, q10 = sympy.symbols("k zeta g_2 q_10", positive=True)
    omega = k * sympy.sqrt(1 - 2 * zeta**2)
    squared = (q10 * omega * g2) ** 2 / (
        ((k**2 - omega**2) ** 2 + 4 * k**2 * zeta**2 * omega**2) * 4 * ((k * zeta) ** 2 + omega**2)
    )
    printed = g2 * q10 * sympy.sqrt(1 - 2 * zeta**2) / (4 * zeta * k**2 * (1 - zeta**2))
    assert sympy.simplify(squared - printed**2) == 0
    element = tune(300.0, 0.03, q10=4.0)
    gain = printed.subs({k: 300, zeta: 0.03, g2: 2, q10: 4}) / 300 / sympy.Float(0.03)
    assert relate_rate_to_tuned_amplitude(element).steady_gain.real == pytest.approx(float(gain), rel=1e-12)


def test_error_map_against_the_integrated_carrier():
    """One mistuned point of the map, and the same from equations (1) integrated with the carrier and demodulated."""
    k, zeta, ratio, damping = TUNED.k1, TUNED.zeta1, 1.02, 0.8
    mistuned = SensitiveElement(k, k * ratio, zeta, zeta * damping, TUNED.omega)
    time = np.linspace(0, 5 / (k * zeta), 400)
    step = np.where(time > 0, 1.0, 0.0)
    simple = relate_rate_to_tuned_amplitude(TUNED).simulate(time, step)
    tuned, amplitude = (np.abs(propagate_envelope(e, time, step).secondary) for e in (TUNED, mistuned))
    J = np.trapezoid((simple - amplitude) ** 2, time) / np.trapezoid(tuned**2, time)
    assert map_integral_error([ratio], [damping], k=k, zeta=zeta).error[0, 0] == pytest.approx(J, rel=1e-9)
    motion = integrate_motion(mistuned, time, step)
    # Detection loses one carrier period at either end, so both are compared in between.
    at, detected = demodulate(motion.time, motion.secondary, mistuned.omega)
    inside = np.interp(at, time, simple)
    direct = np.trapezoid((inside - np.abs(detected)) ** 2, at)
    from_envelope = np.trapezoid((inside - np.interp(at, time, amplitude)) ** 2, at)
    assert from_envelope == pytest.approx(direct, rel=0.01)


def test_measured_rate_follows_the_simplest_dynamics():
    """Eq. (25), and it keeps the sign of the rate."""
    time, rate = ramp(TUNED, -0.5)
    measured = measure_rate(TUNED, time, rate)
    expected = relate_rate_to_measured_rate(TUNED.k1, TUNED.zeta1).simulate(time, rate)
    assert np.max(np.abs(measured - expected)) < 0.01 * 0.5
    assert measured[-1] == pytest.approx(-0.5, rel=1e-4)


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda: SensitiveElement(1.0, -1.0, 0.1, 0.1, 1.0), "k2"),
        (lambda: tune(1.0, 0.8), "zeta"),
        (lambda: SensitiveElement(1.0, 1.0, 0.1, 0.1, 1.0, g2=0.0), "g2"),
        (lambda: map_integral_error([0.0], [1.0], k=1.0, zeta=0.1), "positive"),
        (lambda: demodulate([0.0, 1.0, 2.5], [0, 0, 0], 1.0), "even sampling"),
        (lambda: demodulate(np.arange(40.0), np.zeros(40), 1.0), "whole number"),
        (lambda: propagate_envelope(TUNED, [0, 1, 2], [0, np.nan, 0]), "row 2"),
    ],
)
def test_what_cannot_be_computed_is_refused(act, words):
    with pytest.raises(CompensationError, match=words):
        act()
