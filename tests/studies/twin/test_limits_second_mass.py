"""The heat path of a twin has unit constants, which its parameters scale: a second mass too, whatever its value."""

from studies.instrument.card import load_card
from studies.twin.plan import plan_twin


def test_values_of_a_second_mass_enter_once():
    thermal = dict(load_card("hrg-30mm").content["thermal"])
    thermal |= {"second_mass_J_per_K": 15.0, "second_mass_conductance_W_per_K": 0.03}
    network = plan_twin(load_card("hrg-30mm").with_table("thermal", thermal)).network
    mass = next(node for node in network.nodes if node.name == "mass")
    assert mass.capacity_at(300.0) == 1.0  # the parameter scales it
