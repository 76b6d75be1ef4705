"""Energy balance of a transient."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from thermal.network import Network
from thermal.profile import Profile
from thermal.transient import Transient

POINTS = 8  # Gauss points per piece
PIECES = 12  # pieces per smooth stretch of a transient, shorter towards its start


@dataclass(frozen=True)
class EnergyBalance:
    """Heat stored in the nodes and heat received from boundaries and sources (J)."""

    stored: float
    received: float
    turnover: float

    @property
    def error(self) -> float:
        """Difference over the turnover, the sum of the sizes of all heats that flowed."""
        return abs(self.stored - self.received) / self.turnover if self.turnover else 0.0


def check_energy(network: Network, boundaries: Mapping[str, Profile], transient: Transient) -> EnergyBalance:
    """Compare Σ ∫ C dT with ∫ (heat from the boundaries + sources) dt along a transient."""
    n = network.count
    received = turnover = 0.0
    x, w = np.polynomial.legendre.leggauss(POINTS)
    shares = np.concatenate([[0.0], 2.0 ** np.arange(1 - PIECES, 1)])  # of a stretch, finer after its start
    for start, end in zip(transient.knots[:-1], transient.knots[1:], strict=True):
        edges = start + (end - start) * shares
        half = np.diff(edges)[:, None] / 2
        time, weight = (edges[:-1, None] + half * (x + 1)).ravel(), (half * w).ravel()
        held = np.column_stack([boundaries[boundary.name].at(time) for boundary in network.boundaries])
        outflow = network.outflow(np.hstack([transient.at(time), held]))
        inflow = np.hstack([outflow[:, n:], network.power(time)])
        received += float((weight @ inflow).sum())
        turnover += float((weight @ np.abs(inflow)).sum())
    first, last = transient.at(transient.knots[[0, -1]])
    T = first + np.outer((x + 1) / 2, last - first)
    capacity = np.array(
        [[node.capacity_at(float(one)) for node, one in zip(network.nodes, row, strict=True)] for row in T]
    )
    stored = (last - first) / 2 * (w @ capacity)
    turnover += float(np.abs(stored).sum())
    return EnergyBalance(float(np.sum(stored)), received, turnover)
