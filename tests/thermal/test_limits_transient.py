"""Transients against closed forms; exact against integrated; conservation of energy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.constants import Stefan_Boltzmann

from thermal import sweeping
from thermal.lag import lag, scan
from thermal.network import Boundary, Conductor, Node, Radiator, Source, assemble, linearise
from thermal.profile import Profile, constant, parse_profile
from thermal.radiative import integrate, simulate
from thermal.sweeping import sweep
from thermal.transient import check_energy, propagate

LINEAR = (
    Boundary("chamber"),
    Node("housing", 70.0),
    Node("base", 25.0),
    Node("shell", 2.0),
    Conductor("chamber", "housing", 0.1),
    Conductor("housing", "base", 0.012),
    Conductor("base", "shell", 1.5e-3),
)
RADIATIVE = (*LINEAR, Radiator("housing", "base", 1e-3), Radiator("base", "shell", 8e-5))
CHAMBER = {"chamber": parse_profile("step 20 -10 2h then ramp -10 30 1 then soak 25 1h")}
LUMP = (Boundary("b"), Node("n", 2.0), Conductor("n", "b", 1e-3))


def test_one_radiating_node_follows_the_closed_form():
    """C dT/dt = σ a (T_b⁴ − T⁴) gives t = C/(2 σ a T_b³) [artanh x + arctan x] between two x = T/T_b."""
    area, T_b = 8e-5, 313.15
    network = assemble([Boundary("b"), Node("n", 2.0), Radiator("n", "b", area)])
    times = np.linspace(100.0, 15000.0, 40)
    transient = integrate(network, {"b": constant(T_b, 15000.0)}, initial=[233.15], relative_tolerance=1e-10)
    x = np.concatenate([[233.15], transient.node("n", times)]) / T_b
    clock = 2.0 / (2 * Stefan_Boltzmann * area * T_b**3) * (np.arctanh(x) + np.arctan(x))
    assert clock[1:] - clock[0] == pytest.approx(times, rel=1e-7)


def test_one_node_step_is_an_exponential_and_a_ramp_is_followed_one_lag_behind():
    network, tau = assemble(LUMP), 2000.0
    t = np.linspace(0.0, 7200.0, 200)
    step = propagate(network, {"b": parse_profile("step 20 -10 2h")}).node("n", t)
    assert step == pytest.approx(263.15 + 30 * np.exp(-t / tau), rel=1e-13)
    ramp = propagate(network, {"b": parse_profile("ramp 20 40 1")}).node("n", t[t <= 1200])
    t = t[t <= 1200]
    assert ramp == pytest.approx(293.15 + (t - tau * (1 - np.exp(-t / tau))) / 60, rel=1e-13)


def test_power_that_varies_heats_exactly():
    power = Profile(np.array([0.0, 100.0, 100.0, 400.0]), np.array([0.0, 1.0, 0.5, 0.5]))
    network = assemble([*LUMP, Source("n", power)])
    held = {"b": constant(300.0, 400.0)}
    t = np.linspace(0.0, 400.0, 41)
    exact = propagate(network, held).node("n", t)
    # ramp of 0.01 W/s through C dT/dt + g T = q
    early = 0.01 * t / 1e-3 - 0.01 * 2.0 / 1e-3**2 * (1 - np.exp(-t / 2000.0))
    assert exact[t <= 100] - 300 == pytest.approx(early[t <= 100], abs=1e-9)
    assert integrate(network, held, relative_tolerance=1e-10).node("n", t) == pytest.approx(exact, abs=1e-7)


def test_exact_and_integrated_agree_for_a_linear_network():
    network = assemble(LINEAR)
    t = np.linspace(0.0, propagate(network, CHAMBER).end, 500)
    exact = propagate(network, CHAMBER).at(t)
    coarse, fine = (integrate(network, CHAMBER, relative_tolerance=tol).at(t) for tol in (1e-6, 1e-9))
    assert np.abs(coarse - exact).max() < 1e-3
    assert np.abs(fine - exact).max() < 1e-6


@pytest.mark.slow
def test_radiation_tends_to_its_linearisation_quadratically():
    network = assemble(RADIATIVE)
    linear = linearise(network, 293.15)
    t = np.linspace(0.0, 10000.0, 300)
    distance = []
    for size in (4.0, 2.0, 1.0):
        step = {"chamber": Profile(np.array([0.0, 0.0, 10000.0]), 293.15 + size * np.array([0.0, 1.0, 1.0]))}
        full = integrate(network, step, relative_tolerance=1e-11).at(t)
        distance.append(np.abs(full - propagate(linear, step).at(t)).max())
    ratios = np.array(distance[:-1]) / distance[1:]
    assert ratios == pytest.approx([4.0, 4.0], rel=0.02)
    assert distance[-1] < 2e-3


def test_energy_is_conserved_exactly_and_by_integration():
    linear, radiative = assemble(LINEAR), assemble(RADIATIVE)
    assert check_energy(linear, CHAMBER, propagate(linear, CHAMBER)).error < 1e-11
    assert check_energy(radiative, CHAMBER, integrate(radiative, CHAMBER)).error < 1e-9
    assert check_energy(radiative, CHAMBER, integrate(radiative, CHAMBER)).turnover > 1000.0


def test_energy_is_conserved_with_capacity_over_temperature_and_power():
    parts = [part for part in RADIATIVE if part != LINEAR[3]]
    network = assemble([*parts, Node("shell", lambda T: 2.0 * (1 + 2e-3 * (T - 293.15))), Source("shell", 0.01)])
    assert check_energy(network, CHAMBER, integrate(network, CHAMBER)).error < 1e-8


def test_energy_check_sees_a_wrong_transient():
    network = assemble(LINEAR)
    wrong = assemble([*LINEAR[:3], Node("shell", 2.4), *LINEAR[4:]])
    assert check_energy(network, CHAMBER, propagate(wrong, CHAMBER)).error > 1e-4


def test_a_settled_network_stays_where_it_is():
    network = assemble([*RADIATIVE, Source("shell", 0.01)])
    rest = {"chamber": constant(293.15, 3600.0)}
    T = integrate(network, rest).at(np.linspace(0.0, 3600.0, 50))
    assert np.ptp(T, axis=0).max() < 1e-8
    assert T[0, 2] > 293.15 + 1.0
    still = assemble(RADIATIVE)
    assert check_energy(still, rest, integrate(still, rest)).error == 0.0  # it was 0.8 of rounding


def test_a_profile_with_many_rows_is_integrated_through_its_jump():
    t = np.linspace(0.0, 7200.0, 721)
    wave = 293.15 + 5 * np.sin(2 * np.pi * t / 1800.0)
    rows = Profile(np.insert(t, 361, t[360]), np.concatenate([wave[:361], wave[360:] - 20.0]))
    network = assemble(LINEAR)
    exact, steps = propagate(network, {"chamber": rows}), integrate(network, {"chamber": rows})
    assert steps.at(t) == pytest.approx(exact.at(t), abs=1e-4)


@pytest.mark.slow
@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.lists(st.floats(230.0, 340.0), min_size=3, max_size=8), st.floats(200.0, 350.0))
def test_no_temperature_leaves_the_range_of_boundary_and_start(values, first):
    profile = Profile(600.0 * np.arange(len(values)), np.array(values))
    transient = propagate(assemble(LINEAR), {"chamber": profile}, initial=[first, first, first])
    T = transient.at(np.linspace(0.0, transient.end, 200))
    assert T.min() >= min(*values, first) - 1e-9
    assert T.max() <= max(*values, first) + 1e-9


def test_lag_is_the_one_node_network():
    t = np.linspace(0.0, 5000.0, 301)
    T = 293.15 + np.sin(t / 700.0) - 1e-3 * t
    by_network = propagate(assemble(LUMP), {"b": Profile(t, T)}, initial=[280.0]).node("n", t)
    assert lag(t, T, 2000.0, initial=280.0) == pytest.approx(by_network, rel=1e-13)


def test_scan_is_the_same_with_even_and_uneven_rows():
    rng = np.random.default_rng(3)
    t = np.sort(rng.uniform(0.0, 5000.0, 400))
    T = np.interp(t, [0.0, 2000.0, 5000.0], [290.0, 280.0, 300.0])
    even = np.linspace(0.0, 5000.0, 5001)
    uneven = lag(t, T, 900.0, initial=290.0)
    smooth = lag(even, np.interp(even, [0.0, 2000.0, 5000.0], [290.0, 280.0, 300.0]), 900.0, initial=290.0)
    start = np.interp(t[0], even, smooth)
    assert lag(t, T, 900.0, initial=start)[-1] == pytest.approx(np.interp(t[-1], even, smooth), abs=2e-2)
    assert uneven.shape == t.shape
    decay = np.full((50, 2), 0.9)
    forced = rng.normal(size=(50, 2))
    states = [np.array([1.0, -1.0])]
    for row in forced:
        states.append(0.9 * states[-1] + row)
    assert scan(decay, forced, np.array([1.0, -1.0])) == pytest.approx(np.array(states), rel=1e-12, abs=1e-14)


@pytest.mark.slow
def test_sums_of_nodes_are_observed_in_blocks_of_rows():
    network = assemble(LINEAR)
    transient = propagate(network, CHAMBER)
    t = np.linspace(0.0, transient.end, 150_000)
    mean = transient.observe(t, np.array([[0.0, 0.5, 0.5]]))[:, 0]
    assert mean == pytest.approx((transient.node("base", t) + transient.node("shell", t)) / 2, rel=1e-14)


def test_simulate_chooses_the_exact_way_where_there_is_one():
    t = np.linspace(0.0, 7000.0, 50)
    linear, radiative = assemble(LINEAR), assemble(RADIATIVE)
    assert np.array_equal(simulate(linear, CHAMBER).at(t), propagate(linear, CHAMBER).at(t))
    assert np.array_equal(simulate(radiative, CHAMBER).at(t), sweep(radiative, CHAMBER).at(t))
    rows = np.linspace(0.0, 7200.0, 721)
    measured = {"chamber": Profile(rows, 293.15 + np.sin(rows / 500.0))}
    assert np.array_equal(simulate(radiative, measured).at(t), sweep(radiative, measured).at(t))


@pytest.mark.slow
def test_sweeps_tend_to_the_integrated_radiation_with_the_fourth_power_of_the_rows(monkeypatch):
    monkeypatch.setattr(sweeping, "LONGEST_ROW", 1e4)
    parts = [part for part in RADIATIVE if part != LINEAR[3]]
    network = assemble([*parts, Node("shell", lambda T: 2.0 * (1 + 2e-3 * (T - 293.15))), Source("shell", 0.01)])
    errors = []
    for step in (600.0, 300.0, 150.0):
        t = np.arange(0.0, 7201.0, step)
        corners = Profile(np.array([0.0, 1200.0, 7200.0]), np.array([293.15, 263.15, 273.15]))
        rows = {"chamber": Profile(t, corners.at(t))}
        exact = integrate(network, {"chamber": corners}, relative_tolerance=1e-11).at(t)
        errors.append(np.abs(sweep(network, rows).at(t) - exact).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.5)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(4.0, abs=0.5)
    assert errors[2] < 1e-5


@pytest.mark.slow
def test_many_cycles_with_long_ramps_are_simulated_as_exactly_as_few():
    network = assemble(RADIATIVE)
    few = parse_profile("cycle 20 -20 60 1 1h 2")
    many = parse_profile("cycle 20 -20 60 1 1h 60")
    t = np.linspace(0.0, few.time[-2], 200)  # the last ramp of the short one leads home
    exact = integrate(network, {"chamber": few}, relative_tolerance=1e-10).at(t)
    assert simulate(network, {"chamber": many}).at(t) == pytest.approx(exact, abs=1e-5)
