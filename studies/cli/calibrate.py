"""`hrg calibrate`: the card's uncertain values from records, with intervals and shifts."""

from typing import Any

from studies import workbench
from studies.calibration.calibrate import Calibration
from studies.calibration.observed import UNITS
from studies.cli.arguments import Card, Files
from studies.cli.calibrate_modes import calibrate_modes
from studies.cli.output import answers, keep_card, say
from studies.errors import InputError
from studies.instrument.card import load_card
from studies.inversion.readings import is_mode_table
from studies.progress import Told
from studies.record import is_table
from studies.reports import calibration as parts
from studies.results import Result, row_of

STAGES = {"step 1:": 0.05, "held-out run": 0.2, "computing the intervals": 0.55}


@answers("hrg.calibration/1; hrg.mode-calibration/1 for a table of modes")
def calibrate(
    card: Card, *data: Files, save: str | None = None, hold_out: int = 0, exact: tuple[str, ...] = ()
) -> Result:
    """Find the most probable values of a card, given its uncertainties and records of the device.

    Every uncertain value of the card may change within its prior: { value = …, relative_sd = … } in the card, or the documented
    uncertainty of its key (hrg cards CARD lists them). The noise of every response, the initial temperatures and the offsets of the
    runs are estimated together with them. The measured housing temperature drives frequency, bias and 1/Q; without it the chamber
    does. With both, the housing temperature is fitted too.

    Args:
        data: Records (CSV) of one device, and steady-state tables (temperature_degC,frequency_Hz); or one table of
            modes (harmonic,frequency_Hz, and if known index, sd_Hz, temperature_degC; harmonic may be empty), which
            calibrates elastic values and dimensions.
        save: Write the calibrated card: most probable values with their posterior widths. Not saved, with exit status
            2, if the rows of a table follow no law of temperature, or the fit did not converge, determined no value, or
            moved one by more than 6 of the card's standard deviations.
        hold_out: Number of the record, from 1, that a second calibration predicts; 0: the last of several.
        exact: A value to keep fixed, such as thermal.film_emissivity; may be given more than once.
    """
    instrument = load_card(card)
    if tables := [path for path in data if is_mode_table(path)]:
        if len(data) > 1 or hold_out:
            raise InputError(f"{tables[0]}: a table of modes is calibrated alone and without --hold-out; save that card, then calibrate it with the records.")  # fmt: skip
        return calibrate_modes(instrument, tables[0], save, exact)
    records = sum(not is_table(path) for path in data)
    if not 0 <= hold_out <= records:
        there = "is 1 record" if records == 1 else f"are {records} records"
        raise InputError(f"--hold-out {hold_out}: there {there}, numbered from 1.")
    with Told("calibration", STAGES) as told:
        found = workbench.calibrate_records(instrument, data, hold_out or None, exact, told)
    for warning in found.warnings:
        say(f"warning: {warning}")
    saved = keep_card(found.instrument, save, found.unsaved)
    payload = _payload(found, list(data), saved)
    title, lead = f"Calibration of {found.card.name}", parts.lead(found, data)
    return Result(payload, title, lead, parts.calibration_parts(found, payload), 2 * (saved != save))


def _payload(found: Calibration, data: list[str], save: str | None) -> dict[str, Any]:
    held = found.held_out

    def pair(values: tuple[float, float] | None) -> dict[str, float] | None:
        return None if values is None else {"as_shipped": values[0], "calibrated": values[1]}

    responses = {
        name: row_of(rung, "as_shipped", "calibrated", "noise", run_offset="offset")
        | {"unit": UNITS[name], "outliers": found.fit.outliers[name]}
        for name, rung in found.ladder.items()
    }
    predicted = None if held is None else {
        name: {
            "chamber": pair(held.chamber.get(name)),
            "housing": pair(held.housing.get(name)),
            "stated": held.stated.get(name),
            "noise": held.noise[name],
        }
        for name in held.noise
    }  # fmt: skip
    return {
        "card": found.card.name,
        "records": data,
        "values": [row_of(one, *parts.VALUE) for one in found.estimates],
        "inseparable": found.groups,
        "responses": responses,
        "held_out": None if held is None else {"record": held.path, "responses": predicted},
        "settled": [{"table": one.path} | one.as_dict() for one in found.settled],
        "converged": found.fit.converged,
        "warnings": found.warnings,
        "calibrated_card": save,
    }
