"""The steady state of a network and its sensitivities."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from thermal.errors import ThermalError
from thermal.network import Array, Network
from thermal.profile import Profile

NEWTON_STEPS = 50
TOLERANCE = 1e-9  # relative size of the last Newton step; its error is the square of it


def find_steady_state(network: Network, boundaries: Mapping[str, float], time: float = 0.0) -> Array:
    """Solve q = L T + σ R T⁴ by Newton's method: temperatures (K) of nodes and boundaries, sources at `time` (s)."""
    check_boundary_names(network, boundaries)
    n = network.count
    held = np.array([float(boundaries[boundary.name]) for boundary in network.boundaries])
    if not (np.isfinite(held).all() and (held > 0).all()):
        raise ThermalError("the temperature of a boundary must be above 0 K; temperatures here are in kelvin.")
    T = np.concatenate([np.full(n, held.mean()), held])
    power = network.power(time)
    for _ in range(NEWTON_STEPS):
        step = np.linalg.solve(network.outflow_slope(T)[:n, :n], power - network.outflow(T)[:n])
        # A step may not carry a node past absolute zero, where T⁴ turns back.
        T[:n] = np.maximum(T[:n] + step, 0.1 * T[:n])
        if np.abs(step).max() < TOLERANCE * T.max():
            return T
    raise ThermalError(f"no steady state was found after {NEWTON_STEPS} Newton steps; look for a source whose heat the network cannot carry away.")  # fmt: skip


def check_boundary_names(network: Network, boundaries: Mapping[str, object]) -> None:
    """Raise `ThermalError` unless exactly the network's boundaries are given."""
    names = {boundary.name for boundary in network.boundaries}
    for name in sorted(boundaries.keys() - names):
        raise ThermalError(f"the network has no boundary '{name}'; it has {', '.join(sorted(names))}.")
    for name in sorted(names - boundaries.keys()):
        raise ThermalError(f"the boundary '{name}' has no temperature; give it one.")


MOST_ROWS = 200_000  # of a profile


def find_corners(network: Network, boundaries: Mapping[str, Profile]) -> Array:
    """Times (s) at which any profile has a row; raises `ThermalError` for profiles that do not fit the network."""
    check_boundary_names(network, boundaries)
    for node in network.nodes:
        if not callable(node.capacity):
            node.capacity_at(0.0)
    profiles = [*boundaries.values(), *(s.power for s in network.sources if isinstance(s.power, Profile))]
    if len({(profile.start, profile.end) for profile in profiles}) > 1:
        raise ThermalError("the profiles of boundaries and powers must all cover the same time.")
    for name, profile in boundaries.items():
        if not (profile.value > 0).all():
            raise ThermalError(f"the profile of '{name}' reaches 0 K; temperatures here are in kelvin.")
    knots = np.unique(np.concatenate([profile.time for profile in profiles]))
    if len(knots) > MOST_ROWS:
        raise ThermalError(f"the profile has {len(knots)} rows; average it to at most {MOST_ROWS} rows.")
    return knots


def boundary_forcing(network: Network, boundaries: Mapping[str, Profile], time: Array) -> tuple[Array, Array]:
    """Temperatures of the boundaries and their slopes, each (times, boundaries)."""
    pieces = [boundaries[boundary.name].segments(time) for boundary in network.boundaries]
    value, slope = (np.column_stack(part) for part in zip(*pieces, strict=True))
    return value, slope


def first_steady_state(network: Network, boundaries: Mapping[str, Profile]) -> Array:
    """The steady state before the profiles begin."""
    first = {name: float(profile.value[0]) for name, profile in boundaries.items()}
    return find_steady_state(network, first, min(profile.start for profile in boundaries.values()))


def initial_state(network: Network, boundaries: Mapping[str, Profile], initial: ArrayLike | None) -> Array:
    """Temperatures (K) of the nodes at the start: as given, else the steady state before the profiles begin."""
    if initial is None:
        return first_steady_state(network, boundaries)[: network.count]
    T = np.asarray(initial, dtype=float)
    if T.shape != (network.count,) or not (np.isfinite(T).all() and (T > 0).all()):
        raise ThermalError(f"the initial state needs {network.count} temperatures above 0 K.")
    return T
