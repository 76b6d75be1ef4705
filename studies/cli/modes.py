"""`hrg modes`: frequencies, Bryan factors and sensitivities of a card's modes.

Where the card has imperfections or charged electrodes, the pairs n >= 1 have `split` in the JSON besides: `split_Hz`, `slow_Hz`, `fast_Hz`,
`slow_axis_deg` (azimuth of an antinode of the slower mode), `shift_ppm` of the mean, all to first order, and `every_order_split_Hz`; and
`parts`, split_Hz, slow_axis_deg and shift_ppm by the imperfection, the measured split and the electrodes alone.
Where the card has a [mount] the pairs of n >= 1 have `mount`: `strain_ppm` of the base, `shift_ppm`, `slope_ppm_per_degC`, `per_strain`.
Where the card has films ([[loss.film]]), modes have `films`: `film`, `shift_ppm`, and the `missing` keys where that is null. Where its material is
a crystal, the lowest pairs of n = 2, 3, 5, 6, 7, 9 … have `crystal`: `antinode_along_100_Hz`, `other_Hz`, `split_Hz`, `relative_split`.
"""

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np

from shell.constants import zero_Celsius
from shell.modes import solve_modes
from studies.cli.arguments import COUNT, FRACTION, MANY, WHOLE, AnyTheory, Card, Temperature, open_resonator
from studies.cli.mode_effects import MODE, Asked, describe_effects, effect_tables
from studies.cli.output import answers
from studies.errors import naming
from studies.instrument.card import Instrument
from studies.reports.digits import to_numerical_error
from studies.reports.mode_picture import THEORIES
from studies.reports.scenes import live_chapter, show_mode
from studies.resonator.law import law_of
from studies.results import Blocks, Column, Result, Sentence, Table, Where, row_of

if TYPE_CHECKING:
    from studies.results.page import Block

FAR = 0.1  # relative difference of the first order from all orders from which on a split is doubted
COLUMNS = (
    f"{MODE} | label: kind",
    Column(
        lambda m: to_numerical_error(m["frequency_Hz"], m["relative_error_estimate"] * m["frequency_Hz"], 4), "f", "Hz"
    ),
    "bryan_factor: Bryan factor .5f | relative_error_estimate: solver error, relative .0e | material_uncertainty_Hz:"
    " material uncertainty (Hz) .2g | frequency_per_thickness_Hz_per_um: df/dh (Hz/µm) +.3g",
)


@answers("hrg.modes/1")
def modes(
    card: Card,
    *,
    harmonic: Annotated[tuple[int, ...], MANY, WHOLE] = (2,),
    count: Annotated[int, COUNT] = 1,
    temperature: Temperature = None,
    theory: AnyTheory = "solid",
    tolerance: Annotated[float, FRACTION] = 1e-5,
    sensitivities: bool = False,
) -> Result:
    """Compute the lowest modes of a resonator: frequency, Bryan factor, energies, sensitivities.

    Args:
        harmonic: One or more circumferential harmonics n, for example --harmonic 0 1 2 3.
        count: Number of modes of each harmonic.
        tolerance: Largest relative discretization error of the frequency.
        sensitivities: Show the sensitivities of each frequency to E, ν, ρ, thickness and radius, and where its energy
            is.
    """
    instrument, T, resonator, elastic = open_resonator(card, temperature)
    detailed = theory != "rayleigh"
    with naming(instrument.path):
        found = [m for n in harmonic for m in solve_modes(resonator, elastic, n, count, theory, tolerance)]
        asked = Asked(instrument, T, tolerance)
        more = [describe_effects(m, asked) for m in found]
    share = float(law_of(instrument, T, T).uncertainty(np.array([T]))[0])
    mean = float(sum(h for _, h in resonator.thickness) / len(resonator.thickness))
    entries = []
    for m, effects in zip(found, more, strict=True):
        names = ("harmonic", "index", "label", "bryan_factor", "relative_error_estimate")
        entry = row_of(m, *names, frequency_Hz="frequency")
        if detailed:
            # of a wall that grows everywhere by the same part
            per_micrometre = float(m.frequency * m.sensitivities.thickness / mean * 1e-6)
            entry |= {
                "material_uncertainty_Hz": share * m.frequency if share else None,
                "frequency_per_thickness_Hz_per_um": per_micrometre,
                "modal_mass_kg": m.modal_mass,
                "sensitivities": asdict(m.sensitivities),
                "energy_fractions": asdict(m.energy_fractions),
            }
        entries.append(entry | effects)
    head = {"card": instrument.name, "temperature_degC": T - zero_Celsius, "theory": theory}
    name = f"{instrument.name} at {T - zero_Celsius:g} °C, {THEORIES[theory]}"
    return Result(
        {**head, "modes": entries},
        f"Modes of {instrument.name}",
        f"Natural frequencies and Bryan factors at {T - zero_Celsius:g} °C, {THEORIES[theory]}.",
        [
            Table(name, entries, COLUMNS, _note(theory, share)),
            *effect_tables(entries),
            *_all_orders(entries),
            *_detail_tables(entries if detailed else [], "everywhere" if sensitivities else "page"),
            Blocks(lambda: _view(instrument, sorted(set(harmonic)), T, theory)),
            live_chapter(instrument, harmonic[0], theory),
        ],
    )


def _view(instrument: Instrument, harmonics: list[int], T: float, theory: str) -> "Sequence[Block]":
    """The lowest modes, to be turned."""
    from studies.reports.mode_picture import view_blocks

    drawn: Literal["solid", "shell"] = "solid" if theory == "solid" else "shell"
    words = " Rayleigh's closed form gives the frequencies of the table, not these shapes."
    remark = words if theory == "rayleigh" else ""
    return view_blocks([show_mode(instrument, n, temperature=T, theory=drawn) for n in harmonics], remark)


def _note(theory: str, share: float) -> str:
    if theory == "rayleigh":
        return "Rayleigh's closed form ignores the free edge: on a hemisphere it lies about 10 % too high. Its error is not estimated more closely."
    known = "from the published values of the material, one standard deviation"
    spread = known if share else "not known: the card gives none"
    return f"Solver error: against the exact solution of the same theory. Material uncertainty: {spread}."


def _all_orders(modes: list[dict[str, Any]]) -> list[Sentence]:
    """Warn where imperfections are too large for the first order."""
    found = []
    for row in modes:
        one, every = (row.get("split", {}).get(key, 0.0) for key in ("split_Hz", "every_order_split_Hz"))
        if abs(one - every) > FAR * max(one, every):
            found.append(f"n = {row['harmonic']} ({one:.3g} and {every:.3g} Hz)")
    words = "to first order and of all orders the splits differ by more than 10 %"
    return [Sentence(f"The imperfections are large: {words} for {', '.join(found)}.", "warning")] if found else []


def _detail_tables(modes: list[dict[str, Any]], where: Where) -> list[Table]:
    names = {"E": "ln E", "nu": "ν", "rho": "ln ρ", "thickness": "ln h", "radius": "ln r"}
    slopes = [f"sensitivities.{key}: {name} +.4f" for key, name in names.items()]
    kinds = {"bending": "bending", "membrane": "membrane", "shear": "transverse shear", "root": "root", "stem": "stem"}
    shares = [f"energy_fractions.{key}: {name} ×100 .3f" for key, name in kinds.items()]
    mass = "modal_mass_kg: modal mass (g) ×1e3 .4f"
    note = "ν at constant E; ln r scales every length but the thickness. Modal mass: for a maximum displacement of 1."
    return [
        Table("Derivatives of ln f", modes, [MODE, *slopes, mass], note, where),
        Table("Strain energy (%)", modes, [MODE, *shares], "Root: the solid cap, fillet or corner.", where),
    ]
