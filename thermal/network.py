"""Thermal networks: heat capacities joined by conduction and radiation, with boundaries of given temperature.

    C_i(T_i) dT_i/dt = Σ_j g_ij (T_j − T_i) + σ Σ_j a_ij (T_j⁴ − T_i⁴) + q_i(t)

with g the conductances, a = area × effective emissivity the exchange areas, q the sources. As matrices over
all temperatures (nodes first, then boundaries): C dT/dt = q − (L T + σ R T⁴), L and R graph Laplacians.
"""

import difflib
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermal.constants import Stefan_Boltzmann, zero_Celsius
from thermal.errors import ThermalError
from thermal.profile import Profile

Array = NDArray[np.float64]
Capacity = float | Callable[[Any], Any]
"""Heat capacity, a number or a callable of temperature (K), of arrays too."""


def growing(at_20_degC: float, slope: float) -> Capacity:
    """Return a heat capacity that grows by a relative `slope` (1/K)."""

    def capacity(T: Any) -> Any:
        with np.errstate(over="ignore"):  # at trial temperatures that no material stands
            return at_20_degC * np.exp(slope * (T - zero_Celsius - 20.0))

    return capacity if slope else at_20_degC


@dataclass(frozen=True)
class Node:
    """A lumped mass at one temperature; `capacity` in J/K."""

    name: str
    capacity: Capacity

    def capacity_at(self, temperature: float) -> float:
        """Heat capacity (J/K) at a temperature (K)."""
        value = float(self.capacity(temperature)) if callable(self.capacity) else float(self.capacity)
        if not (math.isfinite(value) and value > 0):
            where = f" (at {temperature:.1f} K)" if callable(self.capacity) else ""
            raise ThermalError(f"the heat capacity of node '{self.name}' must be positive, not {value:g} J/K{where}.")
        return value


@dataclass(frozen=True)
class Boundary:
    """A place whose temperature is given from outside, as a profile."""

    name: str


@dataclass(frozen=True)
class Link:
    """A path for heat between two ends."""

    one: str
    other: str

    @property
    def name(self) -> str:
        """The two ends."""
        return f"{self.one}-{self.other}"


@dataclass(frozen=True)
class Conductor(Link):
    """Heat flow g (T_other − T_one) into `one`."""

    conductance: float  # g, W/K


@dataclass(frozen=True)
class Radiator(Link):
    """Heat flow σ a (T_other⁴ − T_one⁴) into `one`."""

    exchange_area: float  # a = area × effective emissivity, m²


@dataclass(frozen=True)
class Source:
    """Heat put into a node; `power` in W, a number or a piecewise linear function of time."""

    node: str
    power: float | Profile


Part = Node | Boundary | Conductor | Radiator | Source


@dataclass(frozen=True)
class Network:
    """A checked network; made by `assemble`."""

    nodes: tuple[Node, ...]
    boundaries: tuple[Boundary, ...]
    conductors: tuple[Conductor, ...]
    radiators: tuple[Radiator, ...]
    sources: tuple[Source, ...]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the nodes, then of the boundaries: the order of every temperature vector."""
        return (*(node.name for node in self.nodes), *(boundary.name for boundary in self.boundaries))

    @property
    def count(self) -> int:
        """Number of nodes."""
        return len(self.nodes)

    @cached_property
    def conduction(self) -> Array:
        """Laplacian L of the conductances (W/K) over nodes and boundaries."""
        return self._laplacian([(part.one, part.other, part.conductance) for part in self.conductors])

    @cached_property
    def radiation(self) -> Array:
        """Laplacian R of the exchange areas (m²) over nodes and boundaries."""
        return self._laplacian([(part.one, part.other, part.exchange_area) for part in self.radiators])

    @property
    def is_linear(self) -> bool:
        """Whether there is no radiation and every capacity is a number."""
        return not self.radiators and not any(callable(node.capacity) for node in self.nodes)

    def index(self, name: str) -> int:
        """Place of a node or boundary in the temperature vector."""
        if name not in self.names:
            raise ThermalError(f"the network has no node '{name}'{_nearest(name, self.names)}")
        return self.names.index(name)

    def capacities(self, temperature: Array) -> Array:
        """Heat capacities (J/K) of the nodes at their temperatures (K), shape (count, ...)."""
        C = np.empty_like(temperature[: self.count])
        for i, node in enumerate(self.nodes):
            if callable(node.capacity):
                C[i] = node.capacity(temperature[i])
                if not (np.isfinite(C[i]) & (C[i] > 0)).all():
                    worst = np.asarray(temperature[i])[~(np.isfinite(C[i]) & (C[i] > 0))].flat[0]
                    node.capacity_at(float(worst))
            else:
                C[i] = node.capacity
        return C

    def outflow(self, temperature: Array) -> Array:
        """Heat leaving each node and boundary, L T + σ R T⁴ (W); `temperature` has shape (..., nodes and boundaries)."""
        flow: Array = temperature @ self.conduction
        if self.radiators:
            flow += (temperature**2) ** 2 @ (Stefan_Boltzmann * self.radiation)
        return flow

    def outflow_slope(self, temperature: Array) -> Array:
        """Derivative of `outflow` by the temperatures, L + 4 σ R diag(T³) (W/K)."""
        return np.asarray(self.conduction + 4 * Stefan_Boltzmann * self.radiation * temperature**3)

    def power(self, time: ArrayLike, derivative: int = 0) -> Array:
        """Heat that the sources put into each node at times (s), W, or its slope, W/s: shape (..., count)."""
        q = np.zeros((*np.shape(time), self.count))
        for source in self.sources:
            if isinstance(source.power, Profile):
                q[..., self.index(source.node)] += source.power.segments(time)[derivative]
            elif derivative == 0:
                q[..., self.index(source.node)] += source.power
        return q

    def _laplacian(self, links: Sequence[tuple[str, str, float]]) -> Array:
        place = {name: k for k, name in enumerate(self.names)}
        L = np.zeros((len(place), len(place)))
        for one, other, value in links:
            i, j = place[one], place[other]
            L[i, i] += value
            L[j, j] += value
            L[i, j] -= value
            L[j, i] -= value
        return L


def assemble(parts: Iterable[Part]) -> Network:
    """Put nodes, boundaries, links and sources, in any order, together into a network and check it."""
    parts = tuple(parts)
    network = Network(
        nodes=tuple(part for part in parts if isinstance(part, Node)),
        boundaries=tuple(part for part in parts if isinstance(part, Boundary)),
        conductors=tuple(part for part in parts if isinstance(part, Conductor)),
        radiators=tuple(part for part in parts if isinstance(part, Radiator)),
        sources=tuple(part for part in parts if isinstance(part, Source)),
    )
    _check_names(network)
    _check_values(network)
    _check_paths(network)
    return network


def linearise(network: Network, temperature: float) -> Network:
    """Replace radiation by conduction 4 σ a T³ and capacities by their values at one temperature (K), for small departures."""
    if not (math.isfinite(temperature) and temperature > 0):
        raise ThermalError(f"a network is linearised at a temperature above 0 K, not at {temperature:g} K.")
    per_area = 4 * Stefan_Boltzmann * temperature**3
    return Network(
        nodes=tuple(Node(node.name, node.capacity_at(temperature)) for node in network.nodes),
        boundaries=network.boundaries,
        conductors=network.conductors
        + tuple(Conductor(part.one, part.other, per_area * part.exchange_area) for part in network.radiators),
        radiators=(),
        sources=network.sources,
    )


def _check_names(network: Network) -> None:
    names = network.names
    if not network.nodes:
        raise ThermalError("the network has no node; give at least one Node with a heat capacity.")
    for name in names:
        if names.count(name) > 1:
            raise ThermalError(f"the name '{name}' is given to more than one node or boundary.")
    links: tuple[Link, ...] = (*network.conductors, *network.radiators)
    for part in links:
        for end in (part.one, part.other):
            if end not in names:
                kind = type(part).__name__.lower()
                raise ThermalError(f"{kind} '{part.name}' ends at '{end}', which is not a node{_nearest(end, names)}")
        if part.one == part.other:
            raise ThermalError(f"the link '{part.name}' joins a node to itself.")
    inner = [node.name for node in network.nodes]
    for source in network.sources:
        if source.node not in inner:
            raise ThermalError(f"a source heats '{source.node}', which is not a node{_nearest(source.node, inner)}")


def _check_values(network: Network) -> None:
    for node in network.nodes:
        if not callable(node.capacity):
            node.capacity_at(math.nan)
    conductances = [("conductance", one, one.conductance, "W/K") for one in network.conductors]
    areas = [("exchange area", one, one.exchange_area, "m²") for one in network.radiators]
    for kind, part, value, unit in (*conductances, *areas):
        if not (math.isfinite(value) and value > 0):
            raise ThermalError(f"the {kind} '{part.name}' must be positive, not {value:g} {unit}.")
    for source in network.sources:
        if not isinstance(source.power, Profile) and not math.isfinite(source.power):
            raise ThermalError(f"the power put into '{source.node}' must be a number, not {source.power}.")


def _check_paths(network: Network) -> None:
    links = network.conduction + network.radiation
    for i, node in enumerate(network.nodes):
        if links[i, i] == 0:
            raise ThermalError(f"node '{node.name}' is isolated; join it by a conductor or a radiator.")
    if not network.boundaries:
        raise ThermalError("the network has no boundary; give at least one Boundary, such as the chamber.")
    joined = (links != 0).astype(float)
    for _ in range(len(links).bit_length()):  # by paths of twice as many links
        joined = np.minimum(joined @ joined, 1.0)
    reached = joined[: network.count, network.count :].any(axis=1)
    if lost := [node.name for node, ends in zip(network.nodes, reached, strict=True) if not ends]:
        raise ThermalError(f"no path leads from {', '.join(map(repr, lost))} to a boundary; add the missing link.")


def _nearest(word: str, known: Iterable[str]) -> str:
    known = list(known)
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    return f"; did you mean '{close[0]}'?" if close else f"; known: {', '.join(known)}."
