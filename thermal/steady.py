"""The steady state of a network and its sensitivities."""

from collections.abc import Mapping

import numpy as np
from scipy.constants import Stefan_Boltzmann

from thermal.errors import ThermalError
from thermal.network import Array, Network

NEWTON_STEPS = 50
TOLERANCE = 1e-9  # relative size of the last Newton step; its error is the square of it


def find_steady_state(network: Network, boundaries: Mapping[str, float], time: float = 0.0) -> Array:
    """Solve q = L T + σ R T⁴ by Newton's method.

    Parameters
    ----------
    network : Network
    boundaries : mapping
        Temperature (K) of every boundary.
    time : float
        Moment (s) at which sources that vary are read.

    Returns
    -------
    array (nodes + boundaries,)
        Temperatures in kelvin, in the order of `network.names`.
    """
    n = network.count
    held = boundary_vector(network, boundaries)
    T = np.concatenate([np.full(n, held.mean()), held])
    power = network.power(time)
    for _ in range(NEWTON_STEPS):
        step = np.linalg.solve(network.outflow_slope(T)[:n, :n], power - network.outflow(T)[:n])
        # A step may not carry a node past absolute zero, where T⁴ turns back.
        T[:n] = np.maximum(T[:n] + step, 0.1 * T[:n])
        if np.abs(step).max() < TOLERANCE * T.max():
            return T
    raise ThermalError(
        f"no steady state was found after {NEWTON_STEPS} Newton steps; "
        "look for a source whose heat the network cannot carry away."
    )


def steady_state_sensitivities(
    network: Network, boundaries: Mapping[str, float], time: float = 0.0
) -> dict[str, Array]:
    """Change of every node's steady temperature (K) per relative change of each constant of the network.

    From J dT = −∂(outflow − q)/∂ln p at the steady state, J the slope of the outflow; boundaries are per kelvin.

    Returns
    -------
    dict
        "conductance ONE-OTHER", "exchange ONE-OTHER", "power NODE", "boundary NAME" to an array (nodes,).
    """
    n = network.count
    T = find_steady_state(network, boundaries, time)
    slope = network.outflow_slope(T)
    causes: dict[str, Array] = {}

    def add(key: str, cause: Array) -> None:
        causes[key] = causes.get(key, np.zeros(len(T))) + cause

    def along(one: str, other: str, flow: float) -> Array:
        cause = np.zeros(len(T))
        cause[network.index(one)] += flow
        cause[network.index(other)] -= flow
        return cause

    for conductor in network.conductors:
        drop = T[network.index(conductor.other)] - T[network.index(conductor.one)]
        flow = conductor.conductance * drop
        add(f"conductance {conductor.name}", along(conductor.one, conductor.other, flow))
    for radiator in network.radiators:
        drop = T[network.index(radiator.other)] ** 4 - T[network.index(radiator.one)] ** 4
        flow = Stefan_Boltzmann * radiator.exchange_area * drop
        add(f"exchange {radiator.name}", along(radiator.one, radiator.other, flow))
    for source in network.sources:
        power = source.power if isinstance(source.power, int | float) else float(source.power.at(time))
        cause = np.zeros(len(T))
        cause[network.index(source.node)] = power
        add(f"power {source.node}", cause)
    for k, boundary in enumerate(network.boundaries):
        add(f"boundary {boundary.name}", -slope[:, n + k])
    inverse = np.linalg.inv(slope[:n, :n])
    changes: dict[str, Array] = {}
    for key, cause in causes.items():
        changes[key] = inverse @ cause[:n]
    return changes


def boundary_vector(network: Network, boundaries: Mapping[str, float]) -> Array:
    """Temperatures (K) of the boundaries in the network's order; every boundary needs one, above 0 K."""
    names = [boundary.name for boundary in network.boundaries]
    check_boundary_names(network, boundaries)
    held = np.array([float(boundaries[name]) for name in names])
    if not (np.isfinite(held).all() and (held > 0).all()):
        raise ThermalError("the temperature of a boundary must be above 0 K; temperatures here are in kelvin.")
    return held


def check_boundary_names(network: Network, boundaries: Mapping[str, object]) -> None:
    """Raise `ThermalError` unless exactly the network's boundaries are given."""
    names = {boundary.name for boundary in network.boundaries}
    for name in sorted(boundaries.keys() - names):
        raise ThermalError(f"the network has no boundary '{name}'; it has {', '.join(sorted(names))}.")
    for name in sorted(names - boundaries.keys()):
        raise ThermalError(f"the boundary '{name}' has no temperature; give it one.")
