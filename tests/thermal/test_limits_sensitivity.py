"""Derivatives of transients against a closed form and against central differences; sweeps against integration."""

from functools import partial

import numpy as np
import pytest

from thermal.network import Boundary, Conductor, Network, Node, Part, Radiator, Source, assemble
from thermal.profile import Profile, parse_profile
from thermal.radiative import integrate, simulate
from thermal.sensitivity import NetworkChange, difference, no_change, respond
from thermal.sweeping import SweepError, run_sweeps, sweep

VALUES = {"air": 0.1, "mount": 0.012, "exchange": 1e-3, "film": 8e-5, "base": 25.0, "shell": 2.0, "power": 5e-3}
CHAMBER = {"chamber": parse_profile("step 20 -10 1h then ramp -10 40 1 then soak 35 1h")}
ROWS = np.arange(0.0, CHAMBER["chamber"].end, 10.0)
WEIGHTS = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def build(values: dict[str, float], boundary: str = "chamber", bend: float = 1e-3) -> Network:
    """A housing, a base and a shell whose capacity grows with temperature; with "housing" the first two are one."""
    parts: list[Part] = [
        Boundary("chamber"),
        Node("housing", 70.0),
        Conductor("chamber", "housing", values["air"]),
        Node("base", values["base"]),
        Node("shell", lambda T: values["shell"] * (1 + bend * (T - 293.15))),
        Conductor("housing", "base", values["mount"]),
        Conductor("base", "shell", 1.5e-3),
        Radiator("housing", "base", values["exchange"]),
        Radiator("base", "shell", values["film"]),
        Source("shell", values["power"]),
    ]
    if boundary == "housing":
        parts = [Boundary("housing"), *parts[3:]]
    return assemble(parts)


def change(name: str, boundary: str = "chamber") -> NetworkChange:
    step = 1e-3 * VALUES[name]
    above, below = (build({**VALUES, name: VALUES[name] + part * step}, boundary) for part in (0.5, -0.5))
    return difference(above, below, step)


def test_the_derivative_of_one_lag_is_its_closed_form():
    """After a step Δ, T = T₁ + Δ e^(−gt/C): ∂T/∂g = −Δ t/C e^(−gt/C) and ∂T/∂ln C = Δ (g t/C) e^(−gt/C)."""
    g, C, t = 1e-3, 2.0, np.linspace(0.0, 7200.0, 300)
    network = assemble([Boundary("b"), Node("n", C), Conductor("n", "b", g)])
    above, below = (assemble([Boundary("b"), Node("n", C), Conductor("n", "b", g * (1 + d))]) for d in (1e-4, -1e-4))
    heavy, light = (assemble([Boundary("b"), Node("n", C * (1 + d)), Conductor("n", "b", g)]) for d in (1e-4, -1e-4))
    changes = [difference(above, below, 2e-4 * g), difference(heavy, light, 2e-4 * C)]
    found = respond(network, {"b": parse_profile("step 20 -10 2h")}, t, np.eye(1), changes)
    decay = 30.0 * np.exp(-g * t / C)
    assert found.temperature[:, 0] == pytest.approx(263.15 + decay, rel=1e-12)
    assert found.rate[:, 0] == pytest.approx(-g / C * decay, rel=1e-10)
    assert found.slope[0, :, 0] == pytest.approx(-decay * t / C, abs=2e-6 * 11000)
    assert found.slope[1, :, 0] == pytest.approx(decay * g * t / C**2, abs=2e-6 * 6)


@pytest.mark.parametrize("name", VALUES)
def test_every_constant_of_a_radiating_network_against_central_differences(name):
    step = 1e-3 * VALUES[name]
    found = respond(build(VALUES), CHAMBER, ROWS, WEIGHTS, [change(name)])
    up, down = (respond(build({**VALUES, name: VALUES[name] + d}), CHAMBER, ROWS, WEIGHTS) for d in (step, -step))
    expected = (up.temperature - down.temperature) / (2 * step)
    assert found.slope[0] == pytest.approx(expected, abs=2e-5 * np.abs(expected).max())
    rates = (up.rate - down.rate) / (2 * step)
    assert found.rate_slope[0] == pytest.approx(rates, abs=1e-3 * np.abs(rates).max())


def test_boundary_and_initial_state_against_central_differences():
    rng = np.random.default_rng(4)
    time = np.cumsum(rng.uniform(5.0, 15.0, 2000))
    measured = 293.15 + 20 * np.sin(time / 3000.0) + 5e-3 * rng.standard_normal(time.size)
    lag = Profile(time, np.gradient(measured, time))
    network = build(VALUES, "housing")
    weights, start = np.array([[0.0, 1.0]]), np.array([1.0, 2.0])
    changes = [
        no_change(network, {"housing": lag}),
        no_change(network, {"housing": Profile(time, np.ones_like(time))}),
        no_change(network, initial=start),
    ]
    found = respond(network, {"housing": Profile(time, measured)}, time, weights, changes, departure=0.5 * start)
    for k, (moved, departure) in enumerate([(lag.value, 0.0), (np.ones_like(time), 0.0), (0.0 * time, 1.0)]):
        up, down = (
            respond(
                network,
                {"housing": Profile(time, measured + d * moved)},
                time,
                weights,
                departure=(0.5 + d * departure) * start,
            ).temperature
            for d in (0.1, -0.1)
        )
        expected = (up - down) / 0.2
        assert found.slope[k] == pytest.approx(expected, abs=3e-3 * np.abs(expected).max())


def test_a_departure_that_fades_between_two_knots_fades_in_the_derivative():
    """Of a sensor of 5 s on the housing, e^(−t/5 s); a cubic between knots 60 s apart once made −90 K s of its 5."""
    plain, t = build(VALUES), np.arange(0.0, 600.0, 0.5)
    parts: list[Part] = [*plain.nodes, Node("sensor", 1e-6), *plain.boundaries, *plain.sources, *plain.conductors]
    network = assemble([*parts, *plain.radiators, Conductor("housing", "sensor", 1e-6 / 5.0)])
    found = respond(network, CHAMBER, t, np.eye(4), [no_change(network, initial=np.array([0.0, 0.0, 0.0, 1.0]))])
    assert found.slope[0, :, 3] == pytest.approx(np.exp(-t / 5.0), abs=1e-6)
    assert found.rate_slope[0, :, 3] == pytest.approx(-np.exp(-t / 5.0) / 5.0, abs=1e-6)


def test_a_bump_of_a_measured_boundary_between_two_knots_acts_when_it_comes():
    """Of one lag τ behind a boundary of many rows, that departs by a tent about s for w s to either side: T(t) = Σ w_j R(t − t_j) of ramps.

    R(t) = t − τ (1 − e^(−t/τ)). Knots are 60 s apart and none is at its corners: a parabola between them once acted 40 s before the tent.
    """
    g, C, t = 1e-3, 0.2, np.arange(0.0, 3000.0, 5.0)
    network = assemble([Boundary("b"), Node("n", C), Conductor("n", "b", g)])
    measured, tau = Profile(t, 293.15 + 0.1 * np.sin(t)), C / g
    corners = np.array([1013.0, 1085.0, 1157.0])
    tent = Profile(np.array([t[0], *corners, t[-1]]), np.array([0.0, 0.0, 1.0, 0.0, 0.0]))
    found = respond(network, {"b": measured}, t, np.eye(1), [no_change(network, {"b": tent})])
    since = np.maximum(t[:, None] - corners, 0.0)
    ramps = since - tau * (1.0 - np.exp(-since / tau))
    assert found.slope[0, :, 0] == pytest.approx(ramps @ [1.0, -2.0, 1.0] / 72.0, abs=1e-10)
    assert found.rate_slope[0, :, 0] == pytest.approx((1.0 - np.exp(-since / tau)) @ [1.0, -2.0, 1.0] / 72.0, abs=1e-12)


def test_power_that_goes_with_the_temperatures_is_answered_as_sweeps_would_answer_it():
    grid = run_sweeps(build(VALUES), CHAMBER).grid
    rng = np.random.default_rng(5)
    power, start = rng.standard_normal((3, len(grid.length), 2, 3)), rng.standard_normal((2, 3))
    feedback = 1e-4 * rng.standard_normal((3, len(grid.length), 3, 3))
    T, rate = (modes @ grid.modes.shapes.T for modes in grid.answer_with(power, feedback, start))
    own = power + T @ feedback
    exact, states = grid.answer(own, start)
    assert pytest.approx(exact, abs=1e-9 * np.abs(T).max()) == T
    assert rate == pytest.approx(grid.rates(own, states), abs=1e-9 * np.abs(rate).max())


def test_the_rate_is_that_of_the_temperature():
    found = respond(build(VALUES), CHAMBER, ROWS, WEIGHTS)
    middle = np.gradient(found.temperature, ROWS, axis=0)
    corners = CHAMBER["chamber"].time
    smooth = np.abs(ROWS[:, None] - corners).min(axis=1) > 15.0
    assert found.rate[smooth] == pytest.approx(middle[smooth], abs=2e-5)


def test_sweeps_through_jumps_agree_with_the_integrator():
    network = build(VALUES)
    exact = integrate(network, CHAMBER, relative_tolerance=1e-11).at(ROWS)
    assert np.abs(sweep(network, CHAMBER).at(ROWS) - exact).max() < 2e-6


def test_radiation_too_strong_for_sweeps_is_integrated():
    network = assemble([Boundary("b"), Node("n", 2.0), Radiator("n", "b", 8e-5)])
    jump = {"b": Profile(np.array([0.0, 0.0, 36000.0]), np.array([700.0, 100.0, 100.0]))}
    with pytest.raises(SweepError, match="too strong"):
        sweep(network, jump)
    t = np.linspace(0.0, 36000.0, 20)
    assert np.array_equal(simulate(network, jump).at(t), integrate(network, jump).at(t))


def test_a_heat_capacity_that_grows_with_temperature_against_central_differences():
    """C = C₀ exp(c (T − T₀)): ∂ ln C/∂c is T − T₀, another number at every moment."""
    t, profile, step = np.linspace(0.0, 7200.0, 200), {"b": parse_profile("step 20 -30 2h")}, 1e-5

    def lump(c: float) -> Network:
        capacity = partial(lambda T, c: 2.0 * np.exp(c * (T - 293.15)), c=c)
        return assemble([Boundary("b"), Node("n", capacity), Conductor("n", "b", 1e-3)])

    above, here, below = (lump(c) for c in (2e-3 + step / 2, 2e-3, 2e-3 - step / 2))
    found = respond(here, profile, t, np.eye(1), [difference(above, below, step)]).slope[0, :, 0]
    T1, T0 = (respond(one, profile, t, np.eye(1)).temperature[:, 0] for one in (above, below))
    assert np.abs(found).max() > 50.0
    assert found == pytest.approx((T1 - T0) / step, abs=1e-3)
