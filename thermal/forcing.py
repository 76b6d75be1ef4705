"""Inputs of a network over time: boundaries, powers, the initial state; checked before every transient."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from thermal.errors import ThermalError
from thermal.network import Array, Network
from thermal.profile import Profile
from thermal.steady import check_boundary_names, find_steady_state

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


def initial_state(network: Network, boundaries: Mapping[str, Profile], initial: ArrayLike | None) -> Array:
    """Temperatures (K) of the nodes at the start: as given, else the steady state before the profiles begin."""
    if initial is None:
        first = {name: float(profile.value[0]) for name, profile in boundaries.items()}
        start = min(profile.start for profile in boundaries.values())
        return find_steady_state(network, first, start)[: network.count]
    T = np.asarray(initial, dtype=float)
    if T.shape != (network.count,) or not (np.isfinite(T).all() and (T > 0).all()):
        raise ThermalError(f"the initial state needs {network.count} temperatures above 0 K.")
    return T
