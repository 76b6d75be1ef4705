"""What is diagnosed: the measured responses, with their columns, units and what their baseline needs."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Response:
    """One measured response.

    Attributes
    ----------
    column, word, unit, shown, scale : str, str, str, str, float
        Column of the record; name and unit for people; unit in which small numbers are shown, and how many of it make one.
    powers : int
        Order of the static law in the baseline.
    own_offset : bool
        Whether every run has an offset of its own (turn-on bias).
    relative : bool
        Whether sizes of effects count in parts of the response's level.
    thermometer : bool
        Whether the other responses read the resonator's temperature from it.
    bent : bool
        Whether its law runs over the thermometer's reading (the change of frequency) rather than over temperature.
    """

    column: str
    word: str
    unit: str
    powers: int
    own_offset: bool = False
    relative: bool = False
    thermometer: bool = False
    bent: bool = False
    shown: str = ""
    scale: float = 1.0


RESPONSES: dict[str, Response] = {
    r.column: r
    for r in (
        Response("frequency_Hz", "frequency", "Hz", 2, relative=True, thermometer=True, shown="mHz", scale=1e3),
        Response("bias_deg_per_h", "bias", "°/h", 3, own_offset=True, bent=True, shown="°/h"),
        Response("inverse_q", "1/Q", "1", 2, relative=True, shown="ppb", scale=1e9),
    )
}
"""By column, the thermometer first: what it finds is known when the others are asked."""
