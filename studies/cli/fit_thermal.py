"""`hrg fit thermal`: time constants of the resonator behind its housing, from records.

With --json one object, schema `hrg.fit-thermal/1`: `data`, `confidence`, `estimates` (by name: `value`, null where not
`determined`, `low`, `high`), `undetermined` (combinations of relative changes that the records leave open),
`initial_departure_K` per run, `residual_rms_Hz`, `row_step_s` of the averaged rows, `warnings`.
"""

from studies.calibration.lags.identification import Identification
from studies.calibration.lags.records import fit_thermal_constants
from studies.cli.arguments import Confidence, Records
from studies.cli.output import answers, say
from studies.errors import InputError
from studies.instrument.card import load_card
from studies.progress import Told
from studies.record import read_record
from studies.reports import style
from studies.results import Drawing, Figure, Result, Sentence, Table, row_of

NAMES = {
    "radiated_share": ("Radiated share of the heat exchange at 20 °C", ""),
    "offset": ("Frequency at the middle temperature", "Hz"),
    "slope": ("Slope of the frequency", "Hz/K"),
    "curvature": ("Second-order coefficient", "Hz/K²"),
    "cubic": ("Third-order coefficient", "Hz/K³"),
}
COLOURED = 3.0  # residual over its white part, above which the chain of lags is in doubt


@answers("hrg.fit-thermal/1")
def fit_thermal(
    *data: Records, card: str | None = None, lags: int | None = None, confidence: Confidence = 0.9
) -> Result:
    """Find the time constants with which the resonator follows its housing, with intervals, and what the records do not determine.

    The records need time_s, frequency_Hz and housing_temperature_degC (or chamber_temperature_degC). The model is a series of
    lags with heat exchange by conduction and radiation. The initial temperatures of each run are fitted, and the noise may
    drift. The intervals hold only for a gyro that fits this model; a residual well above the white noise shows a misfit.

    Args:
        card: A card whose law gives the curvature of frequency over temperature; without it the curvature is fitted.
        lags: Number of lags; by default as many as the records support.
    """
    if not data:
        raise InputError("name at least one record (CSV) with a step, a ramp or a cycle of temperature.")
    records = [read_record(path) for path in data]
    with Told("lags") as told:
        found = fit_thermal_constants(records, load_card(card) if card else None, lags, confidence, told)
    for warning in found.warnings:
        say(f"warning: {warning}")
    if all(e.value is None for e in found.estimates.values()):
        raise InputError(
            f"{data[0]}: the records determine none of the thermal constants. Record steps or ramps of 10 K or more that last"
            " at least five times the resonator's time constant."
        )
    rms, white = float(found.residual.std()), found.noise.innovation
    estimates = {
        name: row_of(e, "value", "low", "high") | {"determined": e.value is not None}
        for name, e in found.estimates.items()
    }
    payload = {
        "data": data,
        **row_of(found, "confidence", "warnings", row_step_s="row_step", initial_departure_K="departures"),
        "estimates": estimates,
        "undetermined": [direction.parts for direction in found.undetermined],
        "residual_rms_Hz": rms,
    }
    rows = [
        e | dict(zip(("constant", "unit"), _name(name), strict=True)) | {"shown": "not determined" if e["value"] is None else e["value"]}
        for name, e in sorted(estimates.items(), key=lambda one: [*NAMES].index(one[0]) if one[0] in NAMES else -1)
    ]  # fmt: skip
    combined = [
        [f"{share:+.2f} × {(word := _name(key)[0])[:1].lower()}{word[1:]}" for key, share in one.parts.items()]
        for one in found.undetermined
    ]
    note = f"Fitted to averages over {found.row_step:g} s; rms residual {rms:.2g} Hz."
    return Result(
        payload,
        "Thermal time constants",
        f"Lag of the resonator behind its housing in {', '.join(data)}.",
        [
            Table(
                "Thermal constants",
                rows,
                f"Constant | shown in low … high: Value | low … high: {100 * confidence:g} % interval .0 | Unit",
                note,
            ),
            *(Sentence(OPEN.format(" ".join(words)), "warning") for words in combined),
            Sentence(MISFIT.format(rms / white), "warning") if rms > COLOURED * white else None,
            Figure(lambda: _draw(found), "Residual of the frequency, all runs in order."),
        ],
    )


OPEN = "The records do not determine this combination of relative changes: {}."
MISFIT = (
    "The residual is {:.1f} times its white part. Either the noise drifts or the gyro is not a chain of this many lags; in the"
    " second case the constants are effective values and may lie outside their intervals."
)


def _name(key: str) -> tuple[str, str]:
    return NAMES.get(key) or (key.replace("_", " ").capitalize(), "s" if key.startswith("time_constant") else "")


def _draw(found: Identification) -> Drawing:
    with style.figure(height=2.8, x=f"row ({found.row_step:g} s each)", y="residual (mHz)") as (made, axes):
        axes.plot(1e3 * found.residual, ".", markersize=2, color=style.BLUE)
        return made
