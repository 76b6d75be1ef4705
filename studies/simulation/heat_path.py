"""Networks of an instrument's heat path, from the boundary "chamber", "housing" or "base" to the cells of the shell."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from studies.errors import naming
from thermal.network import Boundary, Network, Part, assemble, linearise
from thermal.relaxation import find_relaxation
from thermal.resonator import describe_resonator, describe_shell_and_stem

if TYPE_CHECKING:
    from studies.instrument.card import Instrument


def build_network(instrument: "Instrument", radiation: bool | None = None, boundary: str = "chamber") -> Network:
    """Build the whole heat path, from the boundary "chamber" to the cells of the shell, or what is behind the "housing".

    Parameters
    ----------
    instrument : Instrument
    radiation : bool, optional
        False linearises at the reference temperature; what the card says when absent.
    boundary : "chamber" or "housing"
    """
    with naming(f"{instrument.path} [thermal]"):
        network = assemble(describe_resonator(instrument.heat_path))
    if boundary == "housing":
        network = behind_housing(network)
    wanted = instrument.thermal.radiation if radiation is None else radiation
    return network if wanted else linearise(network, instrument.reference_temperature)


def behind_housing(network: Network) -> Network:
    """Return the part of a whole heat path that the housing drives."""
    parts: list[Part] = [Boundary("housing"), *network.sources]
    parts += [node for node in network.nodes if node.name != "housing"]
    parts += [link for link in network.conductors if "chamber" not in (link.one, link.other)]
    parts += network.radiators
    return assemble(parts)


def build_shell_and_stem(instrument: "Instrument") -> Network:
    """Build shell and stem alone, on the boundary "base"."""
    return assemble([Boundary("base"), *describe_shell_and_stem(instrument.heat_path)])


def slowest_lag(network: Network, temperature: float) -> float:
    """Slowest time constant (s) of the resonator behind its housing, in a whole heat path linearised at a temperature (K)."""
    chain = behind_housing(network) if any(node.name == "housing" for node in network.nodes) else network
    return float(find_relaxation(chain, temperature).time_constants[0])


def lump_shape(network: Network, lump: str) -> NDArray[np.float64]:
    """1 for the nodes of a lump ("housing", "base", or "resonator": stem and shell), 0 for the others."""
    names = [node.name for node in network.nodes]
    if lump == "resonator":
        return np.array([float(name not in ("housing", "base")) for name in names])
    return np.array([float(name == lump) for name in names])
