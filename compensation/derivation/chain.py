"""The averaged dynamics as one chain of equations, from the oscillator of two patterns to the measured rate."""

from typing import Any, TypeAlias

import sympy as sp

from compensation.derivation import averaging, demodulated, filters, oscillator

Row: TypeAlias = tuple[str, str, Any, Any]


def steps() -> list[Row]:
    """Return the whole chain."""
    position, velocity = (sp.ImmutableMatrix(sp.symbols(names, real=True)) for names in ("x y", "x' y'"))
    motion = oscillator.small_forces(position, velocity, sp.ImmutableMatrix([sp.Symbol("f_x"), sp.Symbol("f_y")]))
    orbit = "Orbit (X, Y) = R(ψ)(a, −iq) exp(iφ): amplitude, quadrature, precession, phase (Lynch's form)"
    less = demodulated.neglected()
    noisy = "Optimal filter in series, for white noise of γ² times the signal's power, normalised"
    false = "Rate error from a varying cross-damping ζ_12, equal modes (paper on cross-damping, (9) from (8))"
    white, rising = (filters.derive_wiener_filter(noise).renormalised for noise in ("white", "high-pass"))
    oscillating = "Two patterns of a rotating shell as a planar oscillator, constant rate"
    return [
        ("", oscillating, "x''+ω²x y''+ω²y", motion),
        ("", "Amplitudes x = Re{X exp(iωt)}, averaged over a cycle", "X' Y'", averaging.amplitude_rates()),
        ("", orbit, "a' q' ψ' φ'", averaging.ellipse_rates()),
        (
            "7",
            "Amplitude equations of the paper, from (4) with x = Im{A exp(jωt)}",
            demodulated.amplitude_equations(),
            0,
        ),
        ("", "Leading order of (7) for slow A_1, A_2", "A_1' A_2'", demodulated.slow_rates()),
        ("3", "Averaged minus published equations: the neglected reaction of the secondary", "ΔA_1' ΔA_2'", less),
        *_demodulated(),
        ("25", "Ratio of measured to actual rate, 1/τ = kζ", "W", demodulated.measured_rate()),
        ("35", noisy, "G", white),
        ("36", "Optimal filter for noise that rises with frequency", "G", rising),
        ("", false, "W_12", filters.tuned_cross_damping()),
    ]


def _demodulated() -> list[Row]:
    """Return eqs. (8)–(24): the settled primary, and what a rate does to the secondary."""
    found = demodulated
    secondary, slow = found.rate_to_secondary(), found.rate_to_secondary(slow=True)
    response, *polar = found.responses()
    real = "Secondary with real coefficients: A_2R = (A_1R M_RR + A_1I M_RI) W/P, A_2I = (A_1R M_IR + A_1I M_II) W/P, W the rate"
    stray = "Real and imaginary parts of (8); the printed equation has an extra j"
    return [
        ("8", "Steady state of the primary", "A_1", found.settled_primary()),
        ("9", "Second equation of (7) for a steady primary", found.settled_equation(), 0),
        ("10-12", "Laplace transform of (9): secondary over rate", "W_2", found.A_1 * secondary),
        ("13", "Frequency response for a rate that oscillates at lambda", "W_2(jλ)", response),
        ("14", "Amplitude and phase of (13)", "A(λ) φ(λ)", polar),
        ("15", "Poles of (12)", "s_1 s_2", found.poles()),
        ("16", "Slow motion: second derivative neglected", "W_2", found.A_1 * slow),
        ("17", "Pole of (16)", "s_1", found.slow_pole()),
        ("18, 19", stray, "A_1R A_1I", found.primary_parts()),
        ("20-22", real, "M_RR M_RI M_IR M_II P", found.real_parts()),
        ("23, 24", "Equal modes, primary at resonance, slow", "W_20", found.tuned_gain()),
    ]
