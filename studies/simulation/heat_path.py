"""Networks of an instrument's heat path, from the boundary "chamber", "housing" or "base" to the cells of the shell."""

from typing import TYPE_CHECKING

from studies.errors import naming
from thermal.network import Boundary, Network, Part, assemble, linearise
from thermal.relaxation import find_relaxation
from thermal.resonator import describe_resonator, describe_shell_and_stem

if TYPE_CHECKING:
    from studies.instrument.card import Instrument


def build_network(instrument: "Instrument", radiation: bool | None = None) -> Network:
    """Build the whole heat path, from the boundary "chamber" to the cells of the shell.

    Parameters
    ----------
    instrument : Instrument
    radiation : bool, optional
        False linearises at the reference temperature; what the card says when absent.
    """
    with naming(f"{instrument.path} [thermal]"):
        network = assemble(describe_resonator(instrument.heat_path))
    wanted = instrument.thermal.radiation if radiation is None else radiation
    return network if wanted else linearise(network, instrument.reference_temperature)


def build_shell_and_stem(instrument: "Instrument") -> Network:
    """Build shell and stem alone, on the boundary "base"."""
    return assemble([Boundary("base"), *describe_shell_and_stem(instrument.heat_path)])


def slowest_lag(network: Network, temperature: float) -> float:
    """Slowest time constant (s) of the resonator behind its housing, in a whole heat path linearised at a temperature (K)."""
    parts: list[Part] = [Boundary("housing")]
    parts += [node for node in network.nodes if node.name != "housing"]
    parts += [link for link in network.conductors if "chamber" not in (link.one, link.other)]
    parts += network.radiators
    return float(find_relaxation(assemble(parts), temperature).time_constants[0])
