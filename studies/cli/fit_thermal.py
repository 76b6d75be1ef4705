"""`hrg fit thermal`: time constants of the resonator behind its housing, from records.

With --json one object, schema `hrg.fit-thermal/2`: `data`, `confidence`, `estimates` (by name: `value`, null where not
`determined`, `low`, `high`), `undetermined` (groups of constants that the records cannot separate),
`initial_departure_K` per run, `reference_temperature_degC` of the law, `residual_rms_Hz`, `left_over`, `notes`.
"""

from shell.constants import zero_Celsius
from studies.cli.arguments import Confidence, Records
from studies.cli.output import Told, answers, say
from studies.errors import InputError
from studies.fits.thermal import ThermalFit, fit_thermal_constants
from studies.instrument.card import load_card
from studies.record import read_record
from studies.reports import style
from studies.results import Drawing, Figure, Result, Sentence, Table, row_of

NAMES = {
    "time_constant_1": ("Time constant", "s"),
    "time_constant_2": ("Second time constant", "s"),
    "weight_2": ("Share of the second path", ""),
    "radiated_share": ("Radiated share of the heat exchange at 20 °C", ""),
    "offset": ("Frequency at the reference temperature", "Hz"),
    "slope": ("Slope of the frequency", "Hz/K"),
    "curvature": ("Second-order coefficient", "Hz/K²"),
}
OPEN = "The records cannot separate {}."
MISFIT = (
    "The residual has structure in {}: the heat path is not this chain of lags, or something else acts (hrg diagnose). The constants are"
    " effective values and may lie outside their intervals."
)


@answers("hrg.fit-thermal/2")
def fit_thermal(*data: Records, card: str | None = None, lags: int = 2, confidence: Confidence = 0.9) -> Result:
    """Find the time constants with which the resonator follows its housing, with intervals, and what the records do not determine.

    The records need time_s, frequency_Hz and housing_temperature_degC (or chamber_temperature_degC). The resonator follows its
    housing through one lag; a second heat path and radiation are taken where the records show them. The initial temperature
    of each run is fitted, and the noise may drift.

    Args:
        card: A card whose law gives the curvature of frequency over temperature; without it the curvature is fitted.
        lags: Largest number of lags, 1 or 2.
    """
    if not data:
        raise InputError("name at least one record (CSV) with a step, a ramp or a cycle of temperature.")
    records = [read_record(path) for path in data]
    with Told("heat path") as told:
        found = fit_thermal_constants(records, load_card(card) if card else None, lags, confidence, told)
    for note in found.inference.campaign.notes:
        say(f"note: {note}")
    if found.estimates["time_constant_1"].value is None:
        raise InputError(
            f"{data[0]}: the records determine no time constant. Record steps or ramps of 10 K or more that last"
            " at least five times the resonator's time constant."
        )
    left, reference = found.inference.left["frequency_Hz"], found.inference.card.reference_temperature - zero_Celsius
    estimates = {
        name: row_of(e, "value", "low", "high") | {"determined": e.value is not None}
        for name, e in found.estimates.items()
    }
    payload = {
        "data": data,
        **row_of(found, "confidence", "undetermined", initial_departure_K="departures"),
        "estimates": estimates,
        "reference_temperature_degC": reference,
        "residual_rms_Hz": found.residual_rms,
        "left_over": left.input if left.significant else None,
        "notes": found.inference.campaign.notes,
    }
    table = [
        e | dict(zip(("constant", "unit"), NAMES[name], strict=True)) | {"shown": "not determined" if e["value"] is None else e["value"]}
        for name, e in estimates.items()
    ]  # fmt: skip
    columns = f"Constant | shown in low … high: Value | low … high: {100 * confidence:g} % interval .0 | Unit"
    groups = (" and ".join(_lower(NAMES[name][0]) for name in group) for group in found.undetermined if len(group) > 1)
    return Result(
        payload,
        "Thermal time constants",
        f"Lag of the resonator behind its housing in {', '.join(data)}.",
        [
            Table(
                "Thermal constants",
                table,
                columns,
                f"Reference temperature {reference:.4g} °C; residual {found.residual_rms:.2g} Hz rms.",
            ),
            *(Sentence(OPEN.format(words), "warning") for words in groups),
            Sentence(MISFIT.format(left.input), "warning") if left.significant else None,
            Figure(lambda: _draw(found), "Residual of the frequency in each run."),
        ],
    )


def _lower(words: str) -> str:
    return words[:1].lower() + words[1:]


def _draw(found: ThermalFit) -> Drawing:
    rows = found.inference.rows["frequency_Hz"]
    with style.figure(height=2.8, x="time (h)", y="residual (mHz)") as (made, axes):
        for time, own in zip(rows.time, rows.residual, strict=True):
            axes.plot(time / 3600.0, 1e3 * own, ".", markersize=2)
        return made
