"""`hrg temperature`: the resonator's temperature from its own frequency."""

import numpy as np

from compensation.arrays import Array
from studies.cli.output import answers, keep_record
from studies.errors import InputError, naming
from studies.models import read_model
from studies.models.kinds.frequency import find_temperature, temperature_error
from studies.record import Record, read_record
from studies.reports import style
from studies.results import Drawing, Facts, Figure, Result, Sentence

SOURCES = ("Wang X. et al., Sensors 2012, 12, 6434 (the HRG paper), eqs. (16)–(18), Table 2, figure 5.",)
FAR = 3.0  # uncertainties of the curve from which on a known temperature contradicts it
NOTE = "The curve was fitted to settled readings. The frequency shows the resonator's own temperature, weighted by the mode; the housing leads it while the temperature changes."


@answers("hrg.temperature/1")
def temperature(model: str, run: str, /, *, out: str | None = None) -> Result:
    """Turn the frequency of a record into the resonator's temperature (HRG paper, equation 18, Table 2 and Figure 5).

    No thermometer is needed: the resonator serves as one. The record is written again with a column
    resonator_temperature_degC, over which 'hrg fit bias --over temperature' can compensate other outputs.

    Args:
        model: A frequency model (TOML) that 'hrg fit frequency --save' wrote.
        run: A record (CSV) with frequency_Hz.
        out: Write the record with the temperature.
    """
    loaded = read_model(model)
    if loaded.kind != "frequency":
        raise InputError(f"{model}: of kind '{loaded.kind}'; one of kind 'frequency' is needed (hrg fit frequency).")
    record = read_record(run)
    with naming(run):
        found = find_temperature(loaded, record["frequency_Hz"], run)
    known = np.isfinite(found)
    sd = max(temperature_error(loaded, float(T)) for T in np.percentile(found[known], [0, 50, 100]))
    low, high, empty = float(found[known].min()), float(found[known].max()), int(np.count_nonzero(~known))
    facts = {"rows": len(record), "rows_without_frequency": empty, "lowest_degC": low, "highest_degC": high}
    facts["curve_uncertainty_K"] = sd
    differs, doubt = "", None
    if (true := record.columns.get("resonator_temperature_degC")) is not None:
        off = facts["rms_difference_from_simulated_K"] = float(np.sqrt(np.nanmean((found - true) ** 2)))
        differs = f"The record's own, simulated temperature differs by {off:.2g} K rms."
        words = f"That is {off / sd:.0f} times the uncertainty of the curve: is the model of this gyro?"
        doubt = Sentence(words, "warning") if off > FAR * sd else None
    if out is not None:
        keep_record(record.with_columns({"resonator_temperature_degC": found}), out)
    return Result(
        {"model": model, "run": run, "out": out, **facts},
        "Resonator temperature from its frequency",
        f"The resonator's temperature in {run}, read from its frequency with {model}.",
        [
            Facts([
                ("Lowest", f"{low:.3f} °C", ""),
                ("Highest", f"{high:.3f} °C", ""),
                ("Uncertainty of the curve", f"± {sd:.2g} K", "one standard deviation of the fitted f(T)"),
            ]),
            differs,
            f"Rows without a frequency, left empty: {empty}." if empty else "",
            doubt,
            Figure(lambda: _figure(record, found), "Temperature of the resonator over time."),
            Sentence(NOTE, "note", "page"),
        ],
        sources=SOURCES,
    )  # fmt: skip


def _figure(record: Record, found: Array) -> Drawing:
    rows = style.few_rows(len(record))
    hours = record["time_s"][rows] / 3600
    with style.figure(height=3.6, x="time (h)", y="temperature (°C)") as (made, axes):
        for label, colour in (("housing", style.ORANGE), ("chamber", style.GREEN)):
            if f"{label}_temperature_degC" in record:
                axes.plot(hours, record[f"{label}_temperature_degC"][rows], color=colour, linewidth=0.9, label=label)
        axes.plot(hours, found[rows], color=style.BLUE, label="resonator, from its frequency")
        return made
