"""`hrg simulate`: a virtual run in the record format."""

from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from compensation.arrays import Array
from studies.calibration.ahead import spread_of_prediction
from studies.calibration.start import begin, misread, unrecorded
from studies.cli.arguments import POSITIVE, PROFILE, Card, Out, Seed, Theory
from studies.cli.output import answers, keep_record, say
from studies.instrument.card import load_card
from studies.record import Record, read_record
from studies.results import Figure, Result, Sentence, Table, row_of
from studies.simulation.chamber import is_record, load_drive
from studies.simulation.virtual_gyro import simulate_run
from thermal.profile import parse_duration

DRIVES = (
    "Further columns of the file command the drives (drive_amplitude_V, electrode_bias_V, quadrature_V, pattern_angle_deg) or"
    " are applied (rate_deg_per_s), between rows too: a row has the mean to the next. Or a record: its housing temperature, or else its chamber temperature, is imposed at its rows."
)

UNCERTAINTY = "Uncertainty of the prediction (standard deviation, rms over the run)"
SPREAD = "0: column | 1: in all .3 | 2: by its start .3 | 3: by noise of the housing's readings .3 | 4: by holes of the record .3"
BEGUN = "How the run began: departures from having settled"
DEPARTURES = "0: part | 1: departure (K) .3 | 2: standard deviation (K) .3"


@answers("hrg.simulate/1")
def simulate(
    card: Card,
    profile: Annotated[str, Parameter(help=f"{PROFILE} {DRIVES}")],
    *,
    out: Out,
    row: Annotated[float, POSITIVE] = 1.0,
    seed: Seed = 0,
    noiseless: bool = False,
    theory: Theory = "solid",
    boundary: Literal["chamber", "housing"] | None = None,
    spread: bool = False,
    start: str | None = None,
) -> Result:
    """Run a virtual gyro through a chamber profile, or through the temperatures of a record, and write the record.

    With [loop] in mode whole-angle, the wave precesses with the applied rate, the self-precession, and the drift by damping and
    electronics; a column pattern_angle_deg of the record or profile prescribes its azimuth instead.

    The '# start' of a record or a profile's file places the run in time: a saved ageing goes on from its date (since), else it begins with the run.
    The gyro is described by the card's optional tables [thermal], [loss], [bias], [loop], [noise] and [[effect]]; all keys have
    defaults (hrg keys card).

    Args:
        row: Time between rows in s; a record keeps its rows.
        noiseless: Leave out noise, sensor lag and rounding.
        boundary: Column of a record that is imposed: chamber or housing.
        spread: Show the standard deviation of every column due to the uncertainties of the card, how the run of a record began, the noise of its temperatures, curves over its holes and, as a calibration found it, the level of a run, without noise of the column.
        start: Time of a record (30min, 2h) whose readings tell how its gyro began; else it begins settled at the first temperature.
    """
    instrument = load_card(card)
    given = read_record(profile) if is_record(profile) else profile
    drive, begun = load_drive(given, boundary, 1 / row), None
    if start or (spread and isinstance(given, Record)):
        drive, begun = begin(instrument, given, drive, parse_duration(start) if start else 0.0)
    run = simulate_run(instrument, drive, 1 / row, seed, not noiseless, theory)
    for warning in run.warnings:
        say(f"warning: {warning}")
    keep_record(run.record, out)
    widths: list[tuple[str | float, ...]] = []
    if spread:
        by_card = spread_of_prediction(instrument, run.prediction.drive, run.law)
        by_start = begun.spread(instrument, run.prediction.drive, run.law) if begun else {}
        by_readings = misread(instrument, run.prediction, run.law) if begun else {}
        by_holes = unrecorded(instrument, run.prediction, run.law)
        for name in [name for name in by_card if name in run.record]:
            alone, *parts = (_rms(own.get(name, 0.0)) for own in (by_card, by_start, by_readings, by_holes))
            widths.append((name, float(np.linalg.norm([alone, *parts])), *parts))
    summary = {
        "card": instrument.name,
        "out": out,
        "rows": len(run.record),
        "columns": list(run.record.columns),
        "rate_Hz": 1 / float(np.median(np.diff(run.record["time_s"]))),
        "boundary": run.prediction.drive.boundary,
        "seed": None if noiseless else seed,
        "frequency_Hz": {"first": f[0], "last": f[-1]}
        if (f := run.record.columns.get("frequency_Hz")) is not None
        else None,
        **row_of(run.law, solver_relative_error="solver_error", interpolation_relative_error="interpolation_error"),
        "start": begun and {part: {"departure_K": value, "sd_K": sd} for part, value, sd in begun.rows},
        "spread": {name: width for name, width, *_ in widths} if spread else None,
        "warnings": run.warnings,
    }
    solved = f"Frequency law: interpolation error {run.law.interpolation_error:.0e}, solver error {run.law.solver_error:.0e}, both relative."
    span = float(np.ptp(run.record["resonator_temperature_degC"]))
    length = run.record["time_s"][-1] - run.record["time_s"][0]
    return Result(
        summary,
        f"Virtual run of {instrument.name}",
        f"Run through {profile}; the {summary['boundary']} temperature is imposed.",
        [
            f"{out}: {len(run.record)} rows over {length:g} s; the resonator's temperature varies by {span:.2f} K.",
            solved if instrument.polynomial is None else None,
            *(Sentence(one, "warning", "page") for one in run.warnings),
            Table(UNCERTAINTY, widths, SPREAD),
            Table(BEGUN, begun.rows if begun else [], DEPARTURES),
            Figure(run.record.plot, "The columns of the record."),
        ],
    )


def _rms(values: Array | float) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
