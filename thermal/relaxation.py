"""Relaxation of a network: time constants, modes, and their sensitivities to the constants of the network."""

from dataclasses import dataclass

import numpy as np
import scipy

from thermal.network import Array, Network, linearise


@dataclass(frozen=True)
class Relaxation:
    """Modes of C dT/dt = −G T, slowest first."""

    nodes: tuple[str, ...]  # names of the nodes
    temperature: float  # float, K, where the network was linearised
    capacity: Array  # array (n,), J/K
    conductance: Array  # array (n, n), W/K, the matrix G over the nodes
    coupling: Array  # array (n, boundaries), W/K, heat into the nodes per kelvin of each boundary
    time_constants: Array  # array (n,), s
    shapes: Array  # array (n, n); column k is mode k, normalised to shapesᵀ C shapes = 1


def find_relaxation(network: Network, temperature: float) -> Relaxation:
    """Solve G v = λ C v for the network linearised at a uniform temperature (K); time constants are 1/λ."""
    linear = linearise(network, temperature)
    n = linear.count
    L = linear.conduction
    capacity = linear.capacities(np.full(n, temperature))
    rates, shapes = scipy.linalg.eigh(L[:n, :n], np.diag(capacity))
    return Relaxation(
        nodes=tuple(node.name for node in network.nodes),
        temperature=temperature,
        capacity=capacity,
        conductance=L[:n, :n],
        coupling=-L[:n, n:],
        time_constants=1 / rates,
        shapes=shapes,
    )


def time_constant_sensitivities(network: Network, temperature: float) -> dict[str, Array]:
    """Relative change of every time constant per relative change of each constant of the network.

    d ln τ_k / d ln p = −(1/λ_k) v_kᵀ (∂G/∂ln p − λ_k ∂C/∂ln p) v_k, by "capacity NODE", "conductance ONE-OTHER",
    "exchange ONE-OTHER". Capacities sum to 1 in every mode, links (of equal ends together) to −1.
    """
    modes = find_relaxation(network, temperature)
    n = network.count
    shares = {
        f"capacity {name}": C * modes.shapes[i] ** 2
        for i, (name, C) in enumerate(zip(modes.nodes, modes.capacity, strict=True))
    }
    linear = linearise(network, temperature)
    kinds = ["conductance"] * len(network.conductors) + ["exchange"] * len(network.radiators)
    ends = np.vstack([modes.shapes, np.zeros((len(network.boundaries), n))])
    for kind, link in zip(kinds, linear.conductors, strict=True):
        drop = ends[network.index(link.one)] - ends[network.index(link.other)]
        key = f"{kind} {link.name}"
        shares[key] = shares.get(key, 0.0) - modes.time_constants * link.conductance * drop**2
    return shares
