"""Conduction along the meridian against closed forms; the order of convergence of its cells."""

import numpy as np
import pytest
from scipy.constants import Stefan_Boltzmann
from scipy.optimize import brentq
from scipy.special import j0, j1, y0, y1

from thermal.errors import ThermalError
from thermal.meridian import cell_names, cut_meridian, cut_meridian_table, describe_meridian, energy_weights, lump
from thermal.network import Boundary, assemble
from thermal.profile import parse_profile
from thermal.relaxation import find_relaxation
from thermal.transient import propagate

RHO_C, K = 2203 * 740.0, 1.38


def tube(count):
    return cut_meridian(0.02, lambda s: np.full_like(s, 0.01), lambda s: np.full_like(s, 1e-3), count)


def disc(count):
    return cut_meridian(0.013, lambda s: 0.002 + s, lambda s: np.full_like(s, 1e-3), count)


def dome(count):
    return cut_meridian(
        0.015 * (np.pi / 2 - 0.17), lambda s: 0.015 * np.sin(0.17 + s / 0.015), lambda s: np.full_like(s, 8.6e-4), count
    )


def rates(cells, exchange=0.0):
    parts = describe_meridian(cells, "base", RHO_C, K, exchange={"base": exchange})
    return 1 / find_relaxation(assemble([Boundary("base"), *parts]), 293.15).time_constants


def test_modes_of_a_tube_with_losses_converge_with_order_two():
    """k/(ρc) (π (2j − 1) / (2 L))² plus the loss 4 σ T³ ε / (ρ c h); a cell's leading error is (wavenumber Δs)²/12."""
    loss = 4 * Stefan_Boltzmann * 293.15**3 * 0.06 / (RHO_C * 1e-3)
    exact = K / RHO_C * (np.pi * (2 * np.arange(1, 4) - 1) / 0.04) ** 2 + loss
    errors = [np.abs(rates(tube(n), 0.06)[:3] / exact - 1).max() for n in (10, 20, 40)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.1)
    assert errors[2] == pytest.approx((np.pi * 5 / 0.04 * 0.02 / 40) ** 2 / 12, rel=0.05)


def test_modes_of_an_annular_disc_are_bessels():
    """T = 0 at r = a, no flow at r = b: J₀(κa) Y₁(κb) = J₁(κb) Y₀(κa)."""
    a, b = 0.002, 0.015

    def cross(kappa):
        return j0(kappa * a) * y1(kappa * b) - j1(kappa * b) * y0(kappa * a)

    grid = np.linspace(5.0, 700.0, 2000)
    signs = np.flatnonzero(np.diff(np.sign(cross(grid))))[:3]
    exact = K / RHO_C * np.array([brentq(cross, grid[k], grid[k + 1]) for k in signs]) ** 2
    errors = [np.abs(rates(disc(n))[:3] / exact - 1).max() for n in (16, 32, 64)]
    assert errors[2] < 2e-3
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.15)


def test_cells_hold_the_surface_and_volume_of_the_dome():
    cells = dome(24)
    assert cells.area.sum() == pytest.approx(2 * np.pi * 0.015**2 * np.cos(0.17), rel=1e-12)
    assert cells.volume.sum() == pytest.approx(2 * np.pi * 0.015**2 * np.cos(0.17) * 8.6e-4, rel=1e-12)
    assert cells.shape_resistance.sum() < np.log(1 / np.tan(0.085)) / (2 * np.pi * 8.6e-4)


def test_a_table_and_callables_give_the_same_cells():
    s = np.linspace(0.0, 0.013, 2001)
    table = cut_meridian_table(s, 0.002 + s, np.full_like(s, 1e-3), 12)
    assert table.volume == pytest.approx(disc(12).volume, rel=1e-12)
    assert table.shape_resistance == pytest.approx(disc(12).shape_resistance, rel=1e-10)


@pytest.mark.parametrize("cut", [tube, disc, dome])
def test_the_lump_keeps_the_slowest_time_constant_the_better_the_more_resistance_lies_before_it(cut):
    """The resistance to the mean temperature is right to first order in the unevenness of the field."""

    def slowest(cells, before):
        parts = describe_meridian(cells, "base", RHO_C, K, root_resistance=before)
        return find_relaxation(assemble([Boundary("base"), *parts]), 293.15).time_constants[0]

    own = lump(cut(48)).shape_resistance[0] / K
    errors = [abs(slowest(lump(cut(48)), own * x) / slowest(cut(48), own * x) - 1) for x in (10.0, 20.0, 40.0)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.2)
    assert errors[0] < 2e-3


def test_a_slow_ramp_leaves_the_parabola_of_even_heating_along_a_tube():
    """Behind a ramp of rate ṙ the tube lags by ρ c ṙ (L s − s²/2) / k once its modes have died out."""
    parts = describe_meridian(tube(40), "base", RHO_C, K)
    transient = propagate(assemble([Boundary("base"), *parts]), {"base": parse_profile("ramp -40 80 0.5")})
    cells, rate = tube(40), 0.5 / 60
    behind = 353.15 - transient.at([transient.end])[0]
    expected = RHO_C * rate * (0.02 * cells.middle - cells.middle**2 / 2) / K
    assert behind == pytest.approx(expected, abs=2e-4 * expected.max())


def test_energy_weights_keep_their_sum_and_take_the_mean_of_the_field():
    """Shares of a density s² at Gauss points: the mean of cos(π s/L) is −2/π² · 3 = −0.60793, to second order."""
    x, w = np.polynomial.legendre.leggauss(40)
    errors = []
    for count in (15, 30, 60):
        cells = cut_meridian(0.02, lambda s: 0.01 + s, lambda s: np.full_like(s, 1e-3), count)
        place, share = 0.01 * (x + 1), 8e-5 * 1.5 * w * ((x + 1) / 2) ** 2
        weights = energy_weights(cells, place, share)
        assert weights.sum() == pytest.approx(8e-5, rel=1e-12)
        field = 293.15 + np.outer([0.0, 1.0], np.cos(np.pi * cells.middle / 0.02))
        mean = field @ weights / weights.sum()
        assert mean[0] == pytest.approx(293.15)
        errors.append(abs(mean[1] - 293.15 + 6 / np.pi**2))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.3)
    assert errors[2] < 2e-3


def test_impossible_meridians_are_refused():
    with pytest.raises(ThermalError, match="start it at the stem"):
        cut_meridian(0.02, lambda s: s - 0.01, lambda s: np.full_like(s, 1e-3), 8)
    with pytest.raises(ThermalError, match="must start at 0 and increase"):
        cut_meridian_table([0.0, 1.0, 1.0], [1.0] * 3, [1.0] * 3, 4)
    with pytest.raises(ThermalError, match="same number of rows"):
        cut_meridian_table([0.0, 1.0], [1.0] * 3, [1.0] * 2, 4)
    with pytest.raises(ThermalError, match="positive length"):
        cut_meridian(0.0, lambda s: 1 + s, lambda s: 1 + s, 4)
    assert cell_names(2) == ["shell-1", "shell-2"]
