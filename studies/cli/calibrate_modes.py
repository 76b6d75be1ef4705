"""`hrg calibrate CARD modes.csv`: elastic values, wall and stem from the frequencies of many modes.

The table has the columns `harmonic` (empty: n is not known), `frequency_Hz` and, if wanted, `index` (0 for the lowest of its n), `sd_Hz`,
`temperature_degC`.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from studies.cli.output import keep_card
from studies.instrument.card import Instrument
from studies.instrument.display import display_name
from studies.inversion.invert import ModeCalibration, decided, invert
from studies.inversion.readings import read_modes
from studies.progress import Told
from studies.reports.calibration import KEY, VALUE, VALUES, WIDTHS, best_known_first
from studies.results import Column, Result, Sentence, Table, row_of

STAGES = {"assignment 1": 0.2, "the mode to measure next": 0.9}
MODES = (
    "line | harmonic: n | index | frequency_Hz: measured (Hz) .9 | predicted_Hz: calibrated (Hz) .9"
    " | residual_ppm: residual (ppm) +.2g | sd_ppm: noise (ppm) .2g | chance: probability (%) ×100 .3g | others: or n, index (%)"
)
NEXT = (
    Column("parameter", "quantity", spell=display_name),
    "harmonic: n | index | frequency_Hz: near (Hz) .6 | sd: now ± .2g | sd_then: then ± .2g",
)
UNTOUCHED = 0.9995
READ = (
    "Noise: of the reading and of the solver. Probability: that the reading is of this mode. The modes are those of the bare"
    " resonator (of a pair, the mean), without electrodes, films or mount."
)
TIED = "Only a combination is determined: {}. Weigh the resonator, or measure one of these directly."
MEASURE = "For each value, the unmeasured mode that would reduce its variance most, read with the same noise; ± one standard deviation."


def calibrate_modes(instrument: Instrument, path: str, save: str | None, exact: Sequence[str]) -> Result:
    """Calibrate a card by a table of modes, and save it."""
    with Told("calibration", STAGES) as told:
        found = invert(instrument, read_modes(path), exact, told)
    saved = keep_card(found.instrument, save, unsaved(found))
    payload = _payload(found, saved)
    values = [one for one in best_known_first(payload) if one["width"] < UNTOUCHED]
    modes = [
        {**one, "others": ", ".join(f"{r['harmonic']}, {r['index']} ({100 * r['chance']:.0f})" for r in one["rivals"])}
        for one in payload["modes"]
    ]
    return Result(
        payload,
        f"Calibration of {instrument.name} by its modes",
        f"Elastic values and dimensions of {instrument.name} from {len(modes)} frequencies in {path}.",
        [
            *(Sentence(one, "warning") for one in payload["warnings"]),
            Table("Values, best known first", values, (*VALUES, KEY), WIDTHS),
            *(TIED.format(", ".join(map(display_name, group))) for group in found.groups),
            Table("Modes", modes, MODES, READ),
            Table("Measure next", payload["next_modes"], NEXT, MEASURE),
        ],
        2 * (saved != save),
    )


def unsaved(found: ModeCalibration) -> str:
    """Why no card is saved; empty where it is."""
    if not found.fit.converged:
        return "the fit did not converge"
    if not decided(found):
        return "the assignment of a reading is not decided. Give its harmonic, or measure more modes"
    return found.excluded


def _payload(found: ModeCalibration, save: str | None) -> dict[str, Any]:
    readings, fit = found.readings, found.fit
    judged = (fit.residual, fit.noise, found.chance, found.rivals)
    rows = zip(readings.lines, fit.modes, readings.frequency, *judged, strict=True)
    undecided = [line for line, chance in zip(readings.lines, found.chance, strict=True) if chance < 0.95]
    said = [f"{readings.path}, line {line}: the readings do not determine which mode this is." for line in undecided]
    return {
        "schema": "hrg.mode-calibration/1",
        "card": found.card.name,
        "table": readings.path,
        "values": [row_of(one, *VALUE) for one in found.estimates],
        "modes": [
            row_of(mode, "harmonic", "index")
            | {
                "line": line,
                "frequency_Hz": float(f),
                "predicted_Hz": float(f * np.exp(-left)),
                "residual_ppm": 1e6 * float(left),
                "sd_ppm": 1e6 * float(noise),
                "chance": chance,
                "rivals": [{"harmonic": n, "index": k, "chance": p} for n, k, p in rivals],
            }
            for line, mode, f, left, noise, chance, rivals in rows
        ],
        "decided": decided(found),
        **row_of(found, "misfit", "next_modes", inseparable="groups"),
        "warnings": [*found.warnings, *said],
        "calibrated_card": save,
    }
