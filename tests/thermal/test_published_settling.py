"""The heat path of the gyro: settling of the HRG paper's Figure 3 and the emissivities of the field notes."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

from thermal.errors import ThermalError
from thermal.meridian import cut_meridian, describe_meridian
from thermal.network import Boundary, Conductor, Node, Radiator, assemble, linearise
from thermal.radiative import step_remaining
from thermal.relaxation import find_relaxation
from thermal.resonator import HeatPath, describe_resonator, describe_shell_and_stem, shell_weights

R, H, ROOT = 0.015, 0.86e-3, np.arcsin(2.5 / 15)
PATH = HeatPath(
    cells=cut_meridian(R * (np.pi / 2 - ROOT), lambda s: R * np.sin(ROOT + s / R), lambda s: np.full_like(s, H), 16),
    volumetric_capacity=2203 * 740.0,
    conductivity=1.38,
    stem_radius=2.5e-3,
    stem_length=19.5e-3,
    emissivity=0.03,
    base_capacity=25.0,
    housing_capacity=70.0,
    mount_conductance=0.01,
    mount_exchange=1e-3,
    chamber_conductance=0.1,
)


def network(path):
    return assemble(describe_resonator(path))


def weights(path):
    nodes = tuple(node.name for node in network(path).nodes)
    return shell_weights(nodes, path.cells.volume)


@pytest.mark.parametrize(("emissivity", "expected"), [(0.03, 4000.0), (0.8, 150.0)])
def test_film_emissivity_sets_the_radiative_time_constant_of_the_shell(emissivity, expected):
    """Field notes, "Heat path": a 2.6 g shell with 2.0 J/K radiating from both faces."""
    shell = Node("shell", 2.6e-3 * 740.0)
    area = 2 * 2 * np.pi * R**2
    alone = assemble([Boundary("base"), shell, Radiator("shell", "base", emissivity * area)])
    assert find_relaxation(alone, 293.15).time_constants[0] == pytest.approx(expected, rel=0.05)


def test_shell_and_stem_alone_settle_in_the_range_of_the_theory_sheet():
    """Field notes: a stem of 2 to 3 mm radius and 10 mm length; theory sheet: 700 to 1500 s with a 2.5 mm stem."""
    alone = replace(PATH, emissivity=0.0, stem_length=0.01)
    network = assemble([Boundary("base"), *describe_shell_and_stem(alone)])
    assert 700.0 < find_relaxation(network, 293.15).time_constants[0] < 1500.0


def test_limits_one_lump_moves_the_slowest_constants_by_a_hundredth_and_the_next_by_more_than_half():
    """The stem in 40 cells beside the one lump of the heat path; what `hrg thermal` says of it."""
    count, path = 40, replace(PATH, emissivity=0.0, mount_exchange=0.0)
    section = np.pi * path.stem_radius**2
    half = path.stem_length / count / 2 / (path.conductivity * section)
    capacity = path.volumetric_capacity * section * path.stem_length / count
    names = ["base", *(f"stem-{k}" for k in range(count))]
    fine = [Node(name, capacity) for name in names[1:]]
    fine += [Conductor(*pair, 1 / (2 * half)) for pair in pairwise(names[1:])] + [Conductor("base", "stem-0", 1 / half)]
    fine += describe_meridian(path.cells, names[-1], path.volumetric_capacity, path.conductivity, root_resistance=half)
    lumped = describe_shell_and_stem(path)
    around = [part for part in describe_resonator(path) if part not in lumped]
    for others in ([Boundary("base")], around):
        one, exact = (find_relaxation(assemble([*others, *of]), 293.15).time_constants for of in (lumped, fine))
        assert one[0] == pytest.approx(exact[0], rel=0.015)
    alone, exact = (find_relaxation(assemble([Boundary("base"), *of]), 293.15).time_constants for of in (lumped, fine))
    assert 1.5 < alone[1] / exact[1] < 2.0


def test_one_conductance_identified_from_95_percent_at_9000_s_leaves_under_1_percent_at_15000_s():
    """HRG paper, text around Figure 3, read as the theory sheet does; the second number is a prediction."""

    def remaining(conductance, time=9000.0):
        path = replace(PATH, mount_conductance=conductance)
        return step_remaining(linearise(network(path), 293.15), 293.15, 263.15, weights(path), [time])[0]

    mount = 10 ** brentq(lambda decade: remaining(10**decade) - 0.05, -6.0, 3.0, xtol=1e-12)
    assert remaining(mount) == pytest.approx(0.05, abs=1e-9)
    assert 0 < remaining(mount, 15000.0) < 0.01


def test_radiation_makes_cooling_slower_than_heating():
    cold, hot = (step_remaining(network(PATH), 293.15, T, weights(PATH), [9000.0])[0] for T in (263.15, 313.15))
    assert cold > 1.2 * hot


def test_impossible_paths_are_refused():
    with pytest.raises(ThermalError, match="emissivity must lie between 0 and 1"):
        replace(PATH, emissivity=1.2)
    with pytest.raises(ThermalError, match="stem needs a positive radius"):
        replace(PATH, stem_length=0.0)
