"""`hrg thermal`: temperatures of the heat path for a chamber profile."""

import re
from typing import Annotated, Any

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from studies.cli.arguments import Card, Course, numbers
from studies.cli.output import answers
from studies.instrument.card import load_card
from studies.instrument.display import name_constant
from studies.reports import style
from studies.results import Column, Drawing, Figure, Result, Table, rows_of
from studies.simulation.chamber import check_profile, load_profile
from studies.simulation.heat_path import build_network, build_shell_and_stem
from thermal.network import Network
from thermal.profile import Profile
from thermal.radiative import simulate
from thermal.relaxation import find_relaxation, time_constant_sensitivities
from thermal.resonator import shell_weights
from thermal.transient import Transient, check_energy

AT_TWO_POINTS = (
    "Stem and the wall above its end are gathered at two points, the second the shell's first cell: the slowest constants are those of a"
    " finely cut stem within 0.1 % (0.3 % with `cells = 1`); of shell and stem alone the shorter ones would be too long by a sixth and more"
    " and are left out, and the first minutes after a jump are coarse. Heat crowds where the stem meets the wall, which is left out: without"
    " a fillet the solid's constant of shell and stem alone is 2 % longer (2.5 mm of stem in 0.9 mm of wall)."
)


@answers("hrg.thermal/1")
def thermal(
    card: Card, profile: Course, *, rows: Annotated[int, numbers(lambda one: 2 <= one <= 10_000, "2 to 10000")] = 13
) -> Result:
    """Show time constants, their sensitivities, and the temperatures of housing, base, stem and shell in time.

    The heat path is the card's table [thermal] with its defaults (hrg keys card).

    Args:
        rows: Rows of the table, evenly spaced in time.
    """
    instrument = load_card(card)
    chamber = load_profile(profile)
    check_profile(chamber, instrument)
    network, T0 = build_network(instrument), instrument.reference_temperature
    alone = find_relaxation(build_shell_and_stem(instrument), T0)
    whole = find_relaxation(network, T0)
    transient = simulate(network, {"chamber": chamber})
    time = np.linspace(chamber.start, chamber.end, rows)
    shown = ["housing", "base", "stem"]
    mean = shell_weights(transient.nodes, instrument.heat_path.cells.volume)
    picks = [[float(node == name) for node in transient.nodes] for name in shown]
    rim = [float(node == transient.nodes[-1]) for node in transient.nodes]
    weights = np.array([*picks, mean, rim])
    T = transient.observe(time, weights) - zero_Celsius
    names = [*shown, "shell", "rim"]
    energy = check_energy(network, {"chamber": chamber}, transient)
    influence = _influence(network, T0)
    temperatures = dict(zip(names, T.T, strict=True))
    housed = {"time_s": time, "chamber_temperature_degC": chamber.at(time) - zero_Celsius}
    payload = {
        "card": instrument.name,
        "radiation": bool(network.radiators),
        "time_constants_s": whole.time_constants,
        "shell_and_stem_time_constants_s": alone.time_constants,
        "slowest_time_constant_sensitivity": influence,
        "energy_balance_error": energy.error,
        **housed,
        "temperature_degC": temperatures,
    }
    constants = [
        {"network": words, "tau": modes.time_constants[:count].tolist() + [None] * 3}
        for words, modes, count in (("whole heat path", whole, 3), ("shell and stem alone", alone, 1))
    ]
    return Result(
        payload,
        f"Heat path of {instrument.name}",
        f"Time constants and temperatures of the heat path for the chamber profile {profile}.",
        [
            Table(f"{instrument.name}: time constants at {T0 - zero_Celsius:g} °C", constants,
                "network | tau.0: slowest (s) .0f | tau.1: second (s) .0f | tau.2: third (s) .0f", AT_TWO_POINTS),
            Table("Sensitivity of the slowest time constant τ to each constant p", list(influence.items())[:6],
                [Column("0", "constant", spell=name_constant), "1: d ln τ / d ln p +.3f"]),
            Figure(lambda: _curves(transient, chamber, weights, names), "Temperatures in time."),
            Table("Temperatures (°C)" + (", with radiation" if network.radiators else ", radiation linearised"),
                rows_of(housed | temperatures), [f"time_s: time (s) .{0 if time[1] - time[0] >= 10 else 1}f | chamber_temperature_degC: chamber .3f", *(f"{name}: {name} .3f" for name in names)],
                "Shell: mean temperature." + f" The heat balance closes within {energy.error:.0e} of the heat exchanged." * (energy.turnover > 0)),
        ],
    )  # fmt: skip


def _curves(transient: Transient, chamber: Profile, weights: Array, names: list[str]) -> Drawing:
    time = np.linspace(chamber.start, chamber.end, 600)
    T = transient.observe(time, weights) - zero_Celsius
    with style.figure(x="time (h)", y="temperature (°C)") as (made, axis):
        axis.plot(time / 3600, chamber.at(time) - zero_Celsius, color=style.BLACK, linestyle=":", label="chamber")
        colours = (style.ORANGE, style.GREEN, style.SKY, style.BLUE, style.VERMILION)
        for k, (name, colour) in enumerate(zip(names, colours, strict=True)):
            axis.plot(time / 3600, T[:, k], color=colour, label=name)
        return made


def _influence(network: Network, T0: float) -> dict[str, Any]:
    """Sensitivity of the slowest time constant, the shell's cells taken together, largest first."""
    found: dict[str, float] = {}
    for name, values in time_constant_sensitivities(network, T0).items():
        key = re.sub(r"shell-\d+", "shell", name)
        found[key] = found.get(key, 0.0) + float(values[0])
    return dict(sorted(found.items(), key=lambda item: -abs(item[1])))
