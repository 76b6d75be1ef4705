"""Networks against closed forms: eigenvalues, steady states, and sensitivities against finite differences."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.constants import Stefan_Boltzmann

from tests.thermal.test_limits_transient import RADIATIVE
from thermal.network import Boundary, Conductor, Network, Node, Radiator, Source, assemble, linearise
from thermal.relaxation import find_relaxation, time_constant_sensitivities
from thermal.steady import find_steady_state

GYRO = (*RADIATIVE, Source("shell", 2e-3), Source("housing", 0.3))


def test_two_node_eigenvalues_are_the_roots_of_the_quadratic():
    C1, C2, g01, g12 = 70.0, 2.0, 0.05, 1.5e-3
    network = assemble(
        [Boundary("b"), Node("one", C1), Node("two", C2), Conductor("b", "one", g01), Conductor("one", "two", g12)]
    )
    a, b, c = C1 * C2, C1 * g12 + C2 * (g01 + g12), g01 * g12
    rates = np.array([b - np.sqrt(b * b - 4 * a * c), b + np.sqrt(b * b - 4 * a * c)]) / (2 * a)
    assert find_relaxation(network, 300.0).time_constants == pytest.approx(1 / rates, rel=1e-12)


def test_a_radiating_node_linearises_to_four_sigma_a_T_cubed():
    network = assemble([Boundary("b"), Node("n", 2.0), Radiator("n", "b", 1e-4)])
    expected = 2.0 / (4 * Stefan_Boltzmann * 1e-4 * 250.0**3)
    assert find_relaxation(network, 250.0).time_constants == pytest.approx([expected], rel=1e-14)


def test_modes_are_orthonormal_in_the_capacities():
    modes = find_relaxation(assemble(GYRO), 293.15)
    assert modes.shapes.T * modes.capacity @ modes.shapes == pytest.approx(np.eye(3), abs=1e-13)
    rebuilt = modes.shapes.T @ modes.conductance @ modes.shapes
    assert rebuilt == pytest.approx(np.diag(1 / modes.time_constants), abs=1e-15)


def test_capacity_that_depends_on_temperature_is_read_at_the_temperature():
    network = assemble([Boundary("b"), Node("n", lambda T: 0.01 * T), Conductor("n", "b", 0.1)])
    assert find_relaxation(network, 250.0).time_constants == pytest.approx([25.0])
    assert find_relaxation(network, 300.0).time_constants == pytest.approx([30.0])


def test_steady_state_of_a_radiating_heater():
    network = assemble([Boundary("b"), Node("n", 1.0), Radiator("n", "b", 2e-3), Source("n", 5.0)])
    T = find_steady_state(network, {"b": 300.0})
    assert T[0] == pytest.approx((300.0**4 + 5.0 / (Stefan_Boltzmann * 2e-3)) ** 0.25, rel=1e-13)


def test_steady_state_between_two_boundaries_divides_like_resistors():
    network = assemble(
        [Boundary("hot"), Boundary("cold"), Node("n", 1.0), Conductor("hot", "n", 3.0), Conductor("n", "cold", 1.0)]
    )
    T = find_steady_state(network, {"hot": 400.0, "cold": 300.0})
    assert T == pytest.approx([375.0, 400.0, 300.0], rel=1e-13)


def test_without_sources_the_steady_state_is_the_boundary():
    network = assemble([part for part in GYRO if not isinstance(part, Source)])
    assert find_steady_state(network, {"chamber": 263.15}) == pytest.approx(np.full(4, 263.15), rel=1e-12)


def scaled(network: Network, key: str, factor: float) -> Network:
    kind, name = key.split(" ")
    return replace(
        network,
        nodes=tuple(
            replace(n, capacity=n.capacity * factor) if key == f"capacity {n.name}" else n for n in network.nodes
        ),
        conductors=tuple(
            replace(c, conductance=c.conductance * factor) if key == f"conductance {c.name}" else c
            for c in network.conductors
        ),
        radiators=tuple(
            replace(r, exchange_area=r.exchange_area * factor) if (kind, name) == ("exchange", r.name) else r
            for r in network.radiators
        ),
        sources=tuple(replace(s, power=s.power * factor) if key == f"power {s.node}" else s for s in network.sources),
    )


def test_time_constant_sensitivities_match_finite_differences():
    network, step = assemble(GYRO), 1e-5
    sensitivities = time_constant_sensitivities(network, 293.15)
    assert len(sensitivities) == 8
    for key, value in sensitivities.items():
        up, down = (find_relaxation(scaled(network, key, f), 293.15).time_constants for f in (1 + step, 1 - step))
        assert value == pytest.approx(np.log(up / down) / (2 * step), abs=1e-8), key


positive = st.floats(1e-3, 1e3)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(capacity=st.lists(positive, min_size=4, max_size=4), conductance=st.lists(positive, min_size=7, max_size=7))
def test_sensitivities_add_up_because_time_constants_are_homogeneous(capacity, conductance):
    nodes = [Node(name, C) for name, C in zip("abcd", capacity, strict=True)]
    ends = [("x", "a"), ("a", "b"), ("b", "c"), ("c", "d"), ("a", "c"), ("b", "d")]
    links = [Conductor(*pair, g) for pair, g in zip(ends, conductance, strict=False)]
    network = assemble([Boundary("x"), *nodes, *links, Radiator("d", "x", 1e-3 * conductance[-1])])
    sensitivities = time_constant_sensitivities(network, 300.0)
    by_capacity = sum(v for key, v in sensitivities.items() if key.startswith("capacity"))
    by_link = sum(v for key, v in sensitivities.items() if not key.startswith("capacity"))
    assert by_capacity == pytest.approx(np.ones(4), rel=1e-9)
    # The rates of weakly joined modes carry the rounding of the fastest ones.
    modes = find_relaxation(network, 300.0)
    assert by_link == pytest.approx(-np.ones(4), rel=1e-13 * modes.time_constants[0] / modes.time_constants[-1] + 1e-9)


def test_linearised_network_is_linear_and_keeps_the_slope():
    network = assemble(GYRO)
    linear = linearise(network, 300.0)
    assert linear.is_linear
    assert not network.is_linear
    assert linear.conduction == pytest.approx(network.outflow_slope(np.full(4, 300.0)), rel=1e-13)
