"""Networks of an instrument's heat path, from the boundary "chamber", "housing" or "base" to the cells of the shell."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from studies.effects.effect import AROUND
from studies.errors import naming
from studies.instrument.tables.law import BETWEEN, NO_LOAD
from thermal.constants import Stefan_Boltzmann
from thermal.meridian import cell_names
from thermal.network import Boundary, Conductor, Network, Node, Part, Radiator, assemble, linearise
from thermal.relaxation import Relaxation, find_relaxation
from thermal.resonator import describe_resonator, describe_shell_and_stem

if TYPE_CHECKING:
    from studies.instrument.card import Instrument
    from studies.instrument.tables.law import PolynomialLaw

SENSOR = "sensor"
"""Node of the sensor on a housing that is predicted; its reading at the start may depart from the housing."""
SENSOR_SHARE = 1e-8  # of the housing's heat capacity: hardly any heat
LEAST_LAG, UNREAD = 1e-3, 1.0  # s; of a sensor without a lag, whose reading is the housing's


def build_network(instrument: "Instrument", radiation: bool | None = None, boundary: str = "chamber") -> Network:
    """Build the heat path from the "chamber", or "housing", to the cells of the shell; without radiation that is conduction, as about the reference; capacities stay."""
    if instrument.polynomial is not None:
        network = lags_in_series(instrument.polynomial, radiation is not False)
        return behind_housing(network) if boundary == "housing" else network
    with naming(f"{instrument.path} [thermal]"):
        network = assemble(describe_resonator(instrument.heat_path))
    if boundary == "housing":
        network = behind_housing(network)
    wanted = instrument.thermal.radiation if radiation is None else radiation
    return network if wanted else replace(linearise(network, instrument.reference_temperature), nodes=network.nodes)


def behind_housing(network: Network) -> Network:
    """Return the part of a whole heat path that the housing drives."""
    return replace(
        network,
        nodes=tuple(node for node in network.nodes if node.name != "housing"),
        boundaries=(Boundary("housing"),),
        conductors=tuple(link for link in network.conductors if "chamber" not in (link.one, link.other)),
    )


def lags_in_series(law: "PolynomialLaw", radiation: bool = True) -> Network:
    """Return the lumps of `[law]`, by their time constants, behind a housing behind a chamber; a negative share is as good a number."""
    (cell,) = cell_names(1)
    parts: list[Part] = [
        Boundary("chamber"),
        Node("housing", 1.0),
        Conductor("chamber", "housing", 1.0 / law.chamber_lag),
    ]
    radiators: list[Radiator] = []
    before, capacity = "housing", 1.0
    for name, lag in zip([*BETWEEN[: len(law.lags) - 1], cell], law.lags, strict=True):
        capacity *= law.capacity_ratio if name == cell and before != "housing" else NO_LOAD
        along, past = law.radiated_shares(name == cell) if radiation else (0.0, 0.0)
        parts += [
            Node(name, law.capacity(capacity, name == cell)),
            Conductor(before, name, (1.0 - along - past) * capacity / lag),
        ]
        area = capacity / lag / (4.0 * Stefan_Boltzmann * AROUND**3)
        radiators += [Radiator(one, name, share * area) for one, share in ((before, along), ("housing", past)) if share]
        before = name
    return replace(assemble(parts), radiators=tuple(radiators))


def with_sensor(network: Network, time_constant: float) -> Network:
    """Return a whole heat path with the sensor on its housing, a node that takes no heat: τ dT_s/dt = T_housing − T_s."""
    housing = next(node for node in network.nodes if node.name == "housing")
    capacity = SENSOR_SHARE * housing.capacity_at(0.0)
    joint = Conductor("housing", SENSOR, capacity / max(time_constant or UNREAD, LEAST_LAG))
    return replace(network, nodes=(*network.nodes, Node(SENSOR, capacity)), conductors=(*network.conductors, joint))


def build_shell_and_stem(instrument: "Instrument") -> Network:
    """Build shell and stem alone, on the boundary "base"."""
    return assemble([Boundary("base"), *describe_shell_and_stem(replace(instrument.heat_path, housing_share=0.0))])


def relax_behind_housing(network: Network, temperature: float) -> Relaxation:
    """Return the modes of what the housing drives, of a whole heat path or of that part, linearised at a temperature (K)."""
    chain = behind_housing(network) if any(node.name == "housing" for node in network.nodes) else network
    return find_relaxation(chain, temperature)


def slowest_lag(network: Network, temperature: float) -> float:
    """Slowest time constant (s) of the resonator behind its housing."""
    return float(relax_behind_housing(network, temperature).time_constants[0])


def departures(network: Network, lumps: Sequence[str], temperature: float) -> dict[str, Array]:
    """Temperatures of the nodes (K) for 1 K of each lump, as far as it persists: Σ v vᵀC e over as many of the slowest modes v."""
    names = [node.name for node in network.nodes]
    relaxation = find_relaxation(network, temperature)
    slow = relaxation.shapes[:, : len(lumps)]
    shapes = {}
    for lump in lumps:
        even = [float(name not in ("housing", "base") if lump == "resonator" else name == lump) for name in names]
        shapes[lump] = np.asarray(slow @ (slow.T @ (relaxation.capacity * even)))
    return shapes
