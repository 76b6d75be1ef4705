"""`hrg fit thermal`: time constants of the resonator behind its housing, from records."""

from shell.constants import zero_Celsius
from studies.cli.arguments import Confidence, Records, open_given
from studies.cli.output import answers, say
from studies.errors import InputError
from studies.fits.thermal import ThermalFit, fit_thermal_constants
from studies.progress import Told
from studies.record import read_record
from studies.reports import style
from studies.results import Drawing, Figure, Result, Sentence, Table, row_of

NAMES = {
    **{f"time_constant_{k}": (f"Time constant {k}", "s") for k in (1, 2, 3)},
    "radiated_share": ("Radiated share of the heat exchange at 20 °C", ""),
    "direct_share": ("Part of that between housing and resonator", ""),
    "base_radiated_share": ("Radiated share between housing and base", ""),
    "capacity_ratio": ("Heat capacity of the resonator over that of the base", ""),
    "capacity_slope_per_K": ("Relative slope of the resonator's heat capacity", "1/K"),
    "base_capacity_slope_per_K": ("Relative slope of the heat capacity between", "1/K"),
    "sensor_time_constant": ("Time constant of the housing's sensor", "s"),
    "delay": ("Delay of the frequency behind the sensor, besides", "s"),
    "offset": ("Frequency at the reference temperature", "Hz"),
    "slope": ("Slope of the frequency", "Hz/K"),
    "curvature": ("Second-order coefficient", "Hz/K²"),
    "third_order": ("Third-order coefficient", "Hz/K³"),
}
DRIFTS = 5.0  # slow noise over that of a row, above which the chain of lags is in doubt
OPEN = "The records cannot separate {}."
NEGATIVE = (
    "{} comes out below zero, which none is: the gyro is not a chain of lags with radiation, or its frequency bends over temperature"
    " otherwise than a cubic. The constants are effective values and may lie outside their intervals."
)
MISFIT = (
    "The residual wanders {:.1f} times as far as single rows scatter. Either the noise of the frequency drifts, or the gyro is no chain of this many"
    " lags: then the constants describe these records only, and the true ones may lie outside the intervals."
)

BY_THERMOMETER = (
    "The residual wanders {:.1f} times as far as single rows scatter. The noise of the housing's readings alone makes {:.2g} Hz of it behind the lag:"
    " average them, or take a quieter thermometer, for closer intervals."
)
MADE = 0.5  # part of the residual from which on the thermometer's noise is its cause


@answers("hrg.fit-thermal/2")
def fit_thermal(
    *data: Records, card: str | None = None, lags: int | None = None, confidence: Confidence = 0.9
) -> Result:
    """Find the time constants with which the resonator follows its housing, with intervals, and what the records do not determine.

    The records need time_s, frequency_Hz and housing_temperature_degC (or chamber_temperature_degC). The model is a series of
    lags with heat exchange by conduction and radiation; where these leave slow noise, of lumps that may also radiate past one another, behind a sensor that may be late, or a delay of seconds. The initial temperatures of each run are fitted, and the noise may
    drift. The frequency is a cubic in temperature. The intervals hold only for a gyro that fits this model; slow noise well above that of a row shows a misfit.

    Args:
        card: A card whose law gives second and third order of the frequency over temperature; without it both are fitted.
        lags: Number of lags, 1 to 3; by default as many as the records support.
    """
    records = [read_record(path) for path in data]
    stages = {"one lag": 0.05, "a heat path with 1": 0.15, "a heat path with 2": 0.25, "a heat path with 3": 0.8}
    with Told("heat path", stages) as told:
        found = fit_thermal_constants(records, open_given(card), lags, confidence, told)
    for note in found.notes:
        say(f"note: {note}")
    if found.estimates["time_constant_1"].value is None:
        raise InputError(f"{data[0]}: the records determine no time constant. Record steps or ramps of 10 K or more that last at least five times the resonator's time constant.")  # fmt: skip
    reference = found.path.card.reference_temperature - zero_Celsius
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
        "notes": found.notes,
    }
    table = [
        (e if e["determined"] or name in found.negative else {}) | dict(zip(("constant", "unit"), NAMES[name], strict=True))
        | {"shown": e["value"] if e["determined"] else "below zero" if name in found.negative else "not determined"}
        for name, e in estimates.items()
    ]  # fmt: skip
    columns = f"Constant | shown in low … high: Value | low … high: {100 * confidence:g} % interval .0 | Unit"
    note = f"Reference temperature {reference:.4g} °C; residual {found.residual_rms:.2g} Hz rms."
    tied = [[NAMES[name][0] for name in group] for group in found.undetermined if len(group) > 1]
    groups = (" and ".join(words[0].lower() + words[1:] for words in group) for group in tied)
    return Result(
        payload,
        "Thermal time constants",
        f"Lag of the resonator behind its housing in {', '.join(data)}.",
        [
            Table("Thermal constants", table, columns, note),
            *(Sentence(OPEN.format(words), "warning") for words in groups),
            *(Sentence(NEGATIVE.format(NAMES[name][0]), "warning") for name in found.negative),
            Sentence(_wanders(found), "warning") if found.slow > DRIFTS else None,
            Figure(lambda: _draw(found), "Residual of the frequency in each run."),
        ],
    )


def _wanders(found: ThermalFit) -> str:
    if found.by_thermometer > MADE * found.residual_rms:
        return BY_THERMOMETER.format(found.slow, found.by_thermometer)
    return MISFIT.format(found.slow)


def _draw(found: ThermalFit) -> Drawing:
    with style.figure(height=2.8, x="time (h)", y="residual (mHz)") as (made, axes):
        for time, rest in found.left:
            axes.plot(time / 3600.0, 1e3 * rest, ".", markersize=2)
        return made
