"""The general Wiener filter, eqs. (31)–(34) with H, R and cross-spectra: against an equivalent gyro and by perturbation."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from compensation.demodulated import relate_rate_to_measured_rate
from compensation.errors import CompensationError
from compensation.motion import translate
from compensation.spectral import CrossSpectrum, Spectrum, rate_spectrum, white_spectrum
from compensation.transfer import TransferFunction
from compensation.wiener import UNITY, WienerFilter, design_wiener_filter, judge_filter

GYRO = relate_rate_to_measured_rate(2 * math.pi * 60, 0.03)
RATE = rate_spectrum(0.5, 4.0)
NOISE = white_spectrum(0.2, 0.5)


def _even(numerator, denominator) -> Spectrum:
    numerator, denominator = (np.array(x, dtype=float) for x in (numerator, denominator))
    numerator[-2::-2] = denominator[-2::-2] = 0.0
    return Spectrum(tuple(numerator), tuple(denominator))


@pytest.mark.parametrize(("gain", "corner"), [(0.4, 3.0), (-0.3, 20.0)])
def test_noise_that_follows_the_rate_is_another_gyro(gain: float, corner: float) -> None:
    """φ = c(s) Ω + e has S_φΩ = c(−s) S_Ω and S_φ = |c|² S_Ω + S_e; then W + c with noise e alone is the same problem."""
    follow = TransferFunction((gain * corner,), (1.0, corner))
    n_w, d_w = np.real(GYRO.numerator), np.real(GYRO.denominator)
    whole = np.polyadd(np.polymul(n_w, [1.0, corner]), np.polymul([gain * corner], d_w))
    equivalent = TransferFunction(tuple(whole), tuple(np.polymul(d_w, [1.0, corner])))
    mirrored = [-1.0, corner]
    square = np.polymul([1.0, corner], mirrored)
    rate_top, rate_bottom = np.array(RATE.numerator), np.array(RATE.denominator)
    noise = _even(
        np.polyadd((gain * corner) ** 2 * rate_top, NOISE.numerator[0] * np.polymul(square, rate_bottom)),
        np.polymul(square, rate_bottom),
    )
    cross = CrossSpectrum(tuple(np.real(follow.numerator[0]) * rate_top), tuple(np.polymul(mirrored, rate_bottom)))
    general = design_wiener_filter(GYRO, RATE, noise, cross=cross)
    simple = design_wiener_filter(equivalent, RATE, NOISE)
    frequency = np.array([0.0, 0.3, 3.0, 30.0, 300.0])
    assert general.filter.respond(frequency) == pytest.approx(simple.filter.respond(frequency), rel=1e-6)
    assert general.error == pytest.approx(simple.error, rel=1e-6)
    assert general.joint != 0


def _weighted_error(candidate: TransferFunction, wanted: TransferFunction, weight: Spectrum | None) -> float:
    """∫ R (|G W − H|² S_Ω + |G|² S_φ) dω/2π by quadrature."""

    def density(frequency: float) -> float:
        g, w, h = (one.respond(frequency) for one in (candidate, GYRO, wanted))
        error = abs(g * w - h) ** 2 * RATE.density(frequency) + abs(g) ** 2 * NOISE.density(frequency)
        return float(error * (1.0 if weight is None else weight.density(frequency)))

    return float(quad(density, 0, 50, limit=400)[0] + quad(density, 50, math.inf, limit=400)[0]) / math.pi


CASES = [
    (TransferFunction((1.0, 0.0), (0.05, 1.0)), None),
    (TransferFunction((1.0,), (0.3, 1.0)), Spectrum((-1.0, 0.0, 100.0), (-1.0, 0.0, 1.0))),
    (UNITY, Spectrum((-25.0, 0.0, 25.0), (-1.0, 0.0, 400.0))),
]


@pytest.mark.parametrize(("wanted", "weight"), CASES, ids=["slope", "lag, low weighted", "high weighted"])
def test_no_neighbouring_filter_is_better(wanted: TransferFunction, weight: Spectrum | None) -> None:
    """A stable change of G in either direction makes the weighted error larger, and by its square."""
    best = design_wiener_filter(GYRO, RATE, NOISE, wanted, weight)
    least = _weighted_error(best.filter, wanted, weight)
    if weight is None:
        assert best.error == pytest.approx(least, rel=1e-5)
    for corner in (1.0, 15.0):
        changes = []
        for step in (-0.02, 0.02):
            n, d = np.real(best.filter.numerator), np.real(best.filter.denominator)
            moved = TransferFunction(
                tuple(np.polyadd(np.polymul(n, [1.0, corner]), step * corner * d)), tuple(np.polymul(d, [1.0, corner]))
            )
            changes.append(_weighted_error(moved, wanted, weight) - least)
        assert min(changes) > 0
        assert changes[0] == pytest.approx(changes[1], rel=2e-3)


def test_weight_that_is_a_number_moves_nothing() -> None:
    plain = design_wiener_filter(GYRO, RATE, NOISE)
    weighed = design_wiener_filter(GYRO, RATE, NOISE, weight=Spectrum((7.0,), (1.0,)))
    frequency = np.array([0.0, 1.0, 50.0])
    assert weighed.filter.respond(frequency) == pytest.approx(plain.filter.respond(frequency), rel=1e-9)
    assert isinstance(plain, WienerFilter)
    assert judge_filter(plain.filter, GYRO, RATE, NOISE).error == pytest.approx(plain.error)


def test_bad_input_is_said() -> None:
    with pytest.raises(CompensationError, match="H\\(s\\) must be stable"):
        design_wiener_filter(GYRO, RATE, NOISE, TransferFunction((1.0,), (1.0, -1.0)))
    with pytest.raises(CompensationError, match="imaginary axis"):
        design_wiener_filter(GYRO, RATE, NOISE, cross=CrossSpectrum((0.1,), (1.0, 0.0)))


def test_translational_element_has_the_printed_coefficients() -> None:
    """d₁ = d₂ = 1, d₃ = m₂/(m₁ + m₂), g₁ = 2 m₂/(m₁ + m₂), g₂ = 2; a frame without mass is the plain oscillator."""
    element = translate(3e-6, 1e-6, (6000.0, 6100.0), (0.01, 0.02), 6000.0)
    assert (element.d1, element.d2, element.d3, element.g1, element.g2) == (1.0, 1.0, 0.25, 0.5, 2.0)
    assert (element.k2, element.zeta2) == (6100.0, 0.02)
    bare = translate(0.0, 1e-6, (6000.0, 6000.0), (0.01, 0.01), 6000.0)
    assert (bare.d3, bare.g1) == (1.0, 2.0)
    with pytest.raises(CompensationError, match="proof mass must be positive"):
        translate(1e-6, 0.0, (6000.0, 6000.0), (0.01, 0.01), 6000.0)


@pytest.mark.parametrize("excess", [1.001, 30.0])
def test_more_than_perfect_coherence_is_refused(excess: float) -> None:
    """φ = c Ω alone has |S_φΩ|² = S_φ S_Ω; a larger cross-spectrum belongs to no two signals, and would give a negative variance."""
    gain = 0.4
    noise = Spectrum(tuple(gain**2 * np.array(RATE.numerator)), RATE.denominator)
    possible = CrossSpectrum(tuple(gain * np.array(RATE.numerator)), RATE.denominator)
    assert judge_filter(UNITY, GYRO, RATE, noise, cross=possible).error > 0
    more = CrossSpectrum(tuple(np.sqrt(excess) * np.array(possible.numerator)), RATE.denominator)
    for call in (judge_filter, lambda _, *rest, **given: design_wiener_filter(*rest, **given)):
        with pytest.raises(CompensationError, match=f"coherence .* of {excess:.3g}"):
            call(UNITY, GYRO, RATE, noise, cross=more)


def test_a_narrow_peak_of_coherence_is_found() -> None:
    """|c(jω)|² of a resonance at 7 rad/s with Q = 500 is 1e4 within 0.1 % of it and far below 1 elsewhere."""
    lag = (1.0, 7.0 / 500, 49.0)
    cross = CrossSpectrum((0.2, 0.0), lag)
    with pytest.raises(CompensationError, match="at 7 rad/s"):
        judge_filter(UNITY, GYRO, white_spectrum(1.0, 1.0), white_spectrum(1.0, 1.0), cross=cross)
