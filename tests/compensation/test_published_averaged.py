"""The averaged dynamics that SymPy derives: Lynch's form and the CVG paper's equations as printed, and the carrier ODE."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from compensation.derivation import averaging, demodulated, design_code
from compensation.derivation.averaging import a, phi, psi, q, u_a, u_phi, u_q, u_r
from compensation.derivation.oscillator import Omega, delta_omega, delta_tau, k, n, omega, psi_omega, psi_tau, t, tau


def vanishes(expression):
    return sp.simplify(sp.expand_trig(sp.expand(expression))) == 0


@pytest.mark.slow
def test_lynch_form():
    """IEEE Std 1431 Annex B / Lynch (1995), in n θ, azimuth in the sense of the precession, Δω axis at the stiffer mode."""
    T, W = 2 * (psi - psi_tau), 2 * (psi - psi_omega)
    size, energy, half = a**2 - q**2, a**2 + q**2, sp.Rational(1, 2)
    rates = averaging.ellipse_rates()
    assert vanishes(rates.a + (1 / tau + half * delta_tau * sp.cos(T)) * a + half * delta_omega * sp.sin(W) * q - u_a)
    assert vanishes(rates.q + (1 / tau - half * delta_tau * sp.cos(T)) * q - half * delta_omega * sp.sin(W) * a - u_q)
    turn = n * k * Omega * size + half * delta_tau * energy * sp.sin(T) - delta_omega * a * q * sp.cos(W)
    assert vanishes(rates.psi * size - turn - a * u_r + q * u_phi)
    phase = half * delta_omega * energy * sp.cos(W) - delta_tau * a * q * sp.sin(T)
    assert vanishes(rates.phi * size - phase - a * u_phi + q * u_r)
    assert phi not in rates.phi.free_symbols


def test_amplitude_equations_are_the_papers_seventh():
    from compensation.derivation.demodulated import A1, A2, g_2, k_1, k_2, q_10, rate, zeta_1, zeta_2

    j, first, second = sp.I, A1(t), A2(t)
    primary = first.diff(t, 2) + 2 * (zeta_1 * k_1 + j * omega) * first.diff(t)
    primary += (k_1**2 - omega**2 + 2 * j * omega * k_1 * zeta_1) * first - q_10
    secondary = second.diff(t, 2) + 2 * (zeta_2 * k_2 + j * omega) * second.diff(t)
    secondary += (k_2**2 - omega**2 + 2 * j * omega * k_2 * zeta_2) * second
    secondary -= (j * omega * g_2 * rate + rate.diff(t)) * first + g_2 * first.diff(t) * rate
    assert [sp.expand(x - y) for x, y in zip(demodulated.amplitude_equations(), (primary, secondary), strict=True)] == [
        0,
        0,
    ]


def test_both_forms_differ_by_the_neglected_reaction_alone():
    _, Y, _, _ = averaging.amplitudes()
    assert demodulated.neglected() == sp.Matrix([-demodulated.g_2 * Omega * Y / 2, 0])


def test_measured_rate_is_equation_25():
    s, decay = demodulated.s, sp.Symbol("kzeta", positive=True)
    assert sp.simplify(demodulated.measured_rate().subs(tau, 1 / decay) - decay / (s + decay)) == 0


def carrier_orbit(Q, seconds, y0, w, spread, detuning, axis_tau, axis_omega, coupling):
    """Both patterns through every cycle: the plain equations of motion, written anew."""
    decay = w / (2 * Q)
    c, s = np.cos(2 * axis_tau), np.sin(2 * axis_tau)
    D = 2 * decay * np.eye(2) + spread * np.array([[c, s], [s, -c]])
    c, s = np.cos(2 * axis_omega), np.sin(2 * axis_omega)
    K = w**2 * np.eye(2) + w * detuning * np.array([[c, s], [s, -c]])
    G = 2 * coupling * np.array([[0, 1], [-1, 0]])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-K, -(D + G)]])
    return solve_ivp(lambda _, y: A @ y, (0, seconds), y0, "DOP853", [seconds], rtol=1e-11, atol=1e-16).y[:, -1]


@pytest.mark.slow
@pytest.mark.parametrize(("coupling", "detuning"), [(0.8, 0.0), (0.0, 3.0), (-0.5, 2.0)])
def test_emitted_python_follows_the_carrier_at_a_quality_factor_of_1000(coupling, detuning):
    """The averaged orbit after most of a decay time against the carrier; the difference is of order 1/Q, Δω/ω, Ω/ω."""
    space = {}
    exec(design_code.emit_code("python"), space)
    w, Q, spread, axis_tau, axis_omega = 2 * np.pi * 4432.0, 1e3, 1.2, 0.3, 0.8
    seconds = round(0.05 * 4432) / 4432
    start = np.array([1.0, 0.05, 0.4, 0.0])  # a, q, ψ, φ

    def slope(_, y):
        return space["averaged_rates"](
            y[0], y[1], y[2], 2 * Q / w, spread, axis_tau, detuning, axis_omega, 2.0, 0.277, coupling / (2 * 0.277)
        )

    end = solve_ivp(slope, (0, seconds), start, rtol=1e-10, atol=1e-12).y[:, -1]

    def amplitudes(y):
        a, q, psi, phase = y
        turn = np.array([[np.cos(psi), -np.sin(psi)], [np.sin(psi), np.cos(psi)]])
        return turn @ np.array([a, -1j * q]) * np.exp(1j * phase)

    Z = amplitudes(start)
    last = carrier_orbit(Q, seconds, [*Z.real, *(-w * Z.imag)], w, spread, detuning, axis_tau, axis_omega, coupling)
    found = last[:2] - 1j * last[2:] / w  # a whole number of cycles: e^{iωt} = 1
    assert np.max(np.abs(found - amplitudes(end))) < 3e-3 * abs(end[0])
    assert end[0] < 0.7
