"""The heat path of a twin has unit constants, which its parameters scale: no value of a card stands in both."""

import numpy as np
import pytest

from studies.instrument.card import load_card
from studies.twin.plan import plan_twin
from studies.twin.source import exposed

MASS = {"thermal.second_mass_J_per_K": 15.0, "thermal.second_mass_conductance_W_per_K": 0.03}


@pytest.fixture(scope="module")
def card():
    return load_card("hrg-30mm").with_table("thermal", load_card("hrg-30mm").content["thermal"] | {
        key.removeprefix("thermal."): value for key, value in MASS.items()
    })  # fmt: skip


def unit_constants(instrument):
    """Conduction, radiation and capacities at two temperatures."""
    network = plan_twin(instrument).network
    T = np.array([280.0, 300.0])
    capacities = network.capacities(np.tile(T, (network.count, 1)))
    return [network.conduction, network.radiation, capacities]


def test_second_mass_has_unit_capacity(card):
    mass = next(node for node in plan_twin(card).network.nodes if node.name == "mass")
    assert mass.capacity_at(300.0) == 1.0


def test_no_value_that_is_a_parameter_is_in_the_network_too(card):
    plan, here = plan_twin(card), unit_constants(card)
    scaled = [key for key in plan.parameters if key.startswith("thermal.") and exposed(plan, key)]
    assert set(MASS) < set(scaled)
    for key in scaled:
        there = unit_constants(card.with_values({key: 1.25 * plan.parameters[key]}))
        for before, after in zip(here, there, strict=True):
            np.testing.assert_allclose(after, before, rtol=1e-12, err_msg=key)
