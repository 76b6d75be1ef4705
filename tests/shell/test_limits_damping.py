"""Limits of the loss budget: closed forms, the heat equation in all directions, kinetic theory by quadrature, bad input."""

from math import exp, pi, sqrt

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import solve_banded

from shell.curves import Line
from shell.damping.anelastic import BOLTZMANN, activated_loss
from shell.damping.budget import (
    Budget,
    activated_cause,
    film_causes,
    gas_cause,
    loss_budget,
    surface_cause,
    thermoelastic_cause,
)
from shell.damping.faces import Vibration
from shell.damping.film import Film, exchange
from shell.damping.gas import GASES, R, free_molecular_loss
from shell.damping.heat import Heat
from shell.damping.thermoelastic import heat_flow, trace_share
from shell.elastic import Elastic
from shell.errors import ShellError
from shell.material import Material, constant_material
from shell.materials import find_material
from shell.meridian import hemisphere
from shell.modes import Mode, solve_modes
from shell.resonator import Resonator
from shell.solution import total
from tests.shell.heat_equation import conduct, lifshitz_roukes
from tests.shell.samples import DOME, SILICA

METAL = Elastic(190e9, 0.3, 8000.0)
STEEL = Heat(11e-6, 8000 * 460.0, 20.0)
GLASS = Heat(5.1e-7, 2203 * 740.0, 1.38)
GOLD = Heat(14.2e-6, 19300 * 129.0, 320.0)


def _tube(thickness: float, height: float, radius: float = 10e-3) -> Mode:
    resonator = Resonator((Line((radius, 0.0), (radius, height)),), ((0.0, thickness), (1.0, thickness)))
    (mode,) = solve_modes(resonator, METAL, tolerance=1e-6)
    return mode


@pytest.fixture(scope="module")
def dome() -> Mode:
    (mode,) = solve_modes(DOME, SILICA)
    return mode


def _vibration(mode: Mode, material: Material | None = None) -> Vibration:
    return Vibration(
        mode.solution, mode.resonator, material or constant_material("glass", 72.7e9, 0.17, 2203.0), 293.15
    )


@pytest.mark.parametrize("conductivity", [2.0, 60.0, 4000.0])
def test_bent_ring_is_lifshitz_and_roukes(conductivity: float) -> None:
    """A narrow ring is a curved beam: P = 1 and the flow through its wall is F(ξ), up to (h/R)² and its width."""
    h = 0.05e-3
    mode = _tube(h, 0.1e-3)
    solution = mode.solution
    assert solution is not None
    heat = Heat(11e-6, 8000 * 460.0, conductivity)
    xi = h * sqrt(2 * pi * mode.frequency * heat.capacity / (2 * conductivity))
    x = 2 * pi * mode.frequency * heat.capacity / conductivity
    found = heat_flow(solution, x) / (METAL.E * total(solution.elastic) * trace_share(solution))
    assert trace_share(solution) == pytest.approx(1.0, rel=2e-2)
    assert found == pytest.approx(lifshitz_roukes(xi), rel=5e-5)


def test_long_tube_is_a_plate_strip() -> None:
    """P = (1 + ν)/(1 - ν) where the wall bends to a cylinder: a tube that is long against √(h R)."""
    mode = _tube(0.05e-3, 10e-3)
    assert trace_share(mode.solution) == pytest.approx(1.3 / 0.7, rel=5e-2)


@pytest.mark.parametrize("heat", [GLASS, STEEL], ids=["glass", "steel"])
def test_flow_through_the_wall_against_the_heat_equation_in_all_directions(dome: Mode, heat: Heat) -> None:
    """What flows along the wall and around adds 2 % in the edge layer of the dome; through the wall is the fast form."""
    solution = dome.solution
    assert solution is not None
    x = 2 * pi * dome.frequency * heat.capacity / heat.conductivity
    whole = conduct(solution, dome.resonator, x)
    assert conduct(solution, dome.resonator, x, through=36) == pytest.approx(whole, rel=2e-4)
    assert heat_flow(solution, x) == pytest.approx(whole, rel=0.025)
    assert heat_flow(solution, x) < whole


def test_heat_equation_of_a_tube_is_that_of_its_wall() -> None:
    """Where nothing varies along the wall the two-dimensional solution is the one-dimensional."""
    mode = _tube(0.3e-3, 10e-3)
    x = 2 * pi * mode.frequency * STEEL.capacity / STEEL.conductivity
    assert heat_flow(mode.solution, x) == pytest.approx(conduct(mode.solution, mode.resonator, x), rel=5e-3)


def test_varying_wall_takes_the_flow_of_its_own_thickness() -> None:
    """A wall of 0.9 mm with a kink of 1e-9 in its profile takes the general path and must give the same."""
    same = DOME
    varied = hemisphere(radius=15e-3, thickness=[(0.0, 0.9e-3), (1.0, 0.9e-3 * (1 + 1e-9))])
    one, other = (solve_modes(r, METAL)[0].solution for r in (same, varied))
    assert one is not None
    assert other is not None
    assert heat_flow(other, 1e10) == pytest.approx(heat_flow(one, 1e10), rel=1e-6)


def test_surface_and_film_on_a_thin_bent_wall() -> None:
    """In bending ∫ energy dA over both faces is 6/h of that in the volume; a film of the wall's own elasticity follows it."""
    h = 0.1e-3
    vibration = _vibration(_tube(h, 10e-3), constant_material("metal", METAL.E, METAL.nu, METAL.rho))
    film = Film(50e-9, METAL.E, METAL.nu, 1e-3)
    budget = loss_budget(
        vibration, [surface_cause(1e-12, 0.0, ""), *film_causes("own", film, None, (0.0, 0.0), "")], 293.15
    )
    by_name = {part.name: float(part.inverse_q[0]) for part in budget.parts}
    assert by_name["own film"] == pytest.approx(1e-3 * 6 * 50e-9 / h, rel=2e-2)
    assert by_name["surface"] == pytest.approx(1e-12 * 6 / h, rel=3e-2)


def test_film_on_one_face_or_half_covered(dome: Mode) -> None:
    vibration = _vibration(dome)

    def loss(**changes: object) -> float:
        film = Film(100e-9, 78e9, 0.44, 1e-4, **changes)  # type: ignore[arg-type]
        return float(loss_budget(vibration, film_causes("gold", film, None, (0.0, 0.0), ""), 293.15).inverse_q[0])

    both = loss()
    assert loss(faces=("inner",)) + loss(faces=("outer",)) == pytest.approx(both, rel=1e-12)
    assert loss(coverage=0.5) == pytest.approx(both / 2, rel=1e-12)
    assert loss(span=(0.0, 0.6)) + loss(span=(0.6, 1.0)) == pytest.approx(both, rel=1e-12)
    assert loss(span=(0.0, 0.5)) < 0.3 * both  # the mode bends most towards the rim


def test_heat_between_film_and_wall_against_finite_differences() -> None:
    """Film 2 µm on glass: the two-layer heat equation with sources, stepped in space, gives Re[a b/(a + b)]."""
    omega, t = 2 * pi * 5000.0, 2e-6
    depth, cells = 150e-6, 60_000
    edges = np.concatenate([np.linspace(0, t, 4001), t + (depth - t) * np.linspace(0, 1, cells)[1:] ** 2])
    middle, width = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    inside = middle < t
    capacity, k = (
        np.where(inside, GOLD.capacity, GLASS.capacity),
        np.where(inside, GOLD.conductivity, GLASS.conductivity),
    )
    link = 1 / (width[1:] / (2 * k[1:]) + width[:-1] / (2 * k[:-1]))
    source = np.where(inside, 1.0, 0.0)  # θ_f = 1, θ_s = 0 without conduction
    diagonal = 1j * omega * capacity * width
    diagonal[:-1] += link
    diagonal[1:] += link
    bands = np.array([np.append(0, -link), diagonal, np.append(-link, 0)])
    theta = solve_banded((1, 1), bands, 1j * omega * capacity * width * source)
    lost = omega * np.sum((capacity * width * source * theta).imag)
    assert lost == pytest.approx(exchange(t, GOLD, GLASS, omega), rel=1e-4)


def test_resistance_of_free_molecules_by_quadrature(dome: Mode) -> None:
    """Momentum of Maxwell's molecules on a wall that moves at v: its slope at v = 0, specular and diffuse, by integration."""
    vibration, gas, T, p = _vibration(dome), GASES["air"], 293.15, 1e-3
    speed = sqrt(R * T / gas.molar_mass)  # √(R T/M); p = n m speed²

    def arriving(power: int, v: float) -> float:
        """∫ (c + v)^power over molecules that meet the wall, in units of the thermal speed."""
        return float(quad(lambda c: (c + v) ** power * exp(-(c**2) / 2) / sqrt(2 * pi), -v, 12)[0])

    step = 1e-4
    specular = (2 * arriving(2, step) - 2 * arriving(2, -step)) / (2 * step)
    diffuse = (
        (arriving(2, step) + arriving(1, step) * sqrt(pi / 2))
        - (arriving(2, -step) + arriving(1, -step) * sqrt(pi / 2))
    ) / (2 * step)
    along = arriving(1, 0.0)
    omega = float(vibration.omega(T))
    for accommodation, normal, tangential in ((0.0, specular, 0.0), (1.0, diffuse, along)):
        hit = sum(
            face.integrate(normal * face.moved[2] ** 2 + tangential * (face.moved[0] ** 2 + face.moved[1] ** 2))
            for face in vibration.faces
        )
        expected = p / speed * hit / (omega * vibration.kinetic)
        found = free_molecular_loss(vibration, gas, p, T, accommodation)
        assert found == pytest.approx(expected, rel=1e-6)


def test_debye_peak() -> None:
    """Half the peak where ωτ = 2 ± √3."""
    height, energy, peak = 1e-9, 0.5, 400.0
    assert activated_loss(height, energy, peak, peak) == height
    half = 1 / (1 / peak + np.log(2 + sqrt(3)) * BOLTZMANN / energy)
    assert activated_loss(height, energy, peak, float(half)) == pytest.approx(height / 2, rel=1e-12)


def test_sum_slopes_and_ranking(dome: Mode) -> None:
    """Parts add up; with constant properties thermoelastic loss goes as T, a sealed gas as √T, a Debye flank by its energy."""
    vibration = _vibration(dome)
    causes = [
        thermoelastic_cause(vibration, lambda T: GLASS, (0.1, 0.0, 0.0), "steel"),
        gas_cause(vibration, GASES["argon"], 1e-4, 0.1),
        activated_cause(1e-8, 0.5, 500.0, 0.3, ""),
    ]
    T = np.array([250.0, 293.15, 330.0])
    budget = loss_budget(vibration, causes, T)
    assert isinstance(budget, Budget)
    parts = {part.name: part for part in budget.parts}
    assert budget.inverse_q == pytest.approx(sum(part.inverse_q for part in budget.parts), rel=1e-14)
    assert parts["thermoelastic"].slope == pytest.approx(1 / T, rel=1e-3)
    assert parts["gas"].relative_sd == pytest.approx(sqrt(0.1**2 + 0.1**2))
    assert gas_cause(vibration, GASES["air"], 1e3, 0.0).relative_sd == 0.5
    assert parts["gas"].slope == pytest.approx(0.5 / T, rel=2e-3)
    assert parts["activated"].slope[0] == pytest.approx(0.5 / (BOLTZMANN * 250.0**2), rel=1e-3)
    assert parts["thermoelastic"].relative_sd == pytest.approx(sqrt(0.2**2 + 0.02**2), rel=1e-9)
    means = [float(np.mean(part.inverse_q)) for part in budget.parts]
    assert means == sorted(means, reverse=True)
    rest = sum(part.inverse_q for part in budget.parts[1:])
    assert budget.without(budget.first.name) == pytest.approx(1 / rest, rel=1e-12)


def test_budget_over_temperature_follows_the_direct_form(dome: Mode) -> None:
    """Between its nodes the budget's thermoelastic part is the direct one at that frequency."""
    silica = find_material("fused-silica")
    vibration = _vibration(dome, silica)
    cause = thermoelastic_cause(vibration, lambda T: GLASS, (0, 0, 0), "")
    T = 340.0
    x = float(vibration.omega(T)) * GLASS.capacity / GLASS.conductivity
    direct = GLASS.expansion**2 * T / GLASS.capacity * heat_flow(vibration.solution, x) / vibration.strain_energy
    assert cause.inverse_q(vibration, np.array([T]))[0] == pytest.approx(direct, rel=1e-6)


def test_bad_input_is_said(dome: Mode) -> None:
    vibration = _vibration(dome)
    thick = Film(1e-3, 78e9, 0.44, 1e-4)
    with pytest.raises(ShellError, match="thicker than the wall"):
        loss_budget(vibration, film_causes("gold", thick, None, (0, 0), ""), 293.15)
    with pytest.raises(ShellError, match="5 % of the wall"):
        loss_budget(vibration, film_causes("gold", Film(0.1e-3, 78e9, 0.44, 1e-4), None, (0, 0), ""), 293.15)
    with pytest.raises(ShellError, match="pressure must be 0 or positive"):
        gas_cause(vibration, GASES["air"], -1.0, 0.1)
    with pytest.raises(ShellError, match="at least one cause"):
        loss_budget(vibration, [], 293.15)
    with pytest.raises(ShellError, match="height"):
        activated_cause(-1.0, 0.5, 300.0, 0.1, "")
    with pytest.raises(ShellError, match="a share 0"):
        Film(1e-7, 78e9, 0.44, 1e-4, coverage=1.2)
    (closed,) = solve_modes(DOME, SILICA, theory="rayleigh")
    with pytest.raises(ShellError, match="solid or shell"):
        _vibration(closed)
