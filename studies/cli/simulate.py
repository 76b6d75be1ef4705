"""`hrg simulate`: a virtual run in the record format."""

from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from studies.calibration.ahead import spread_of_prediction
from studies.cli.arguments import POSITIVE, PROFILE, Card, Out, Seed, Theory
from studies.cli.output import answers, keep_record, say
from studies.instrument.card import load_card
from studies.results import Figure, Result, Sentence, Table, row_of
from studies.simulation.chamber import load_drive
from studies.simulation.virtual_gyro import simulate_run

DRIVES = (
    "Further columns of the file command the drives (drive_amplitude_V, electrode_bias_V, quadrature_V, pattern_angle_deg) or"
    " are applied (rate_deg_per_s). Or a record: its housing temperature, or else its chamber temperature, is imposed at its rows."
)

UNCERTAINTY = "Uncertainty of the prediction (standard deviation, rms over the run)"
SPREAD = "0: column | 1: standard deviation .3"


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
        spread: Show the standard deviation of every column due to the uncertainties of the card and, as a calibration found it, the level of a run, without noise.
    """
    instrument = load_card(card)
    run = simulate_run(instrument, load_drive(profile, boundary, 1 / row), 1 / row, seed, not noiseless, theory)
    for warning in run.warnings:
        say(f"warning: {warning}")
    keep_record(run.record, out)
    known: dict[str, float] | None = None
    if spread:
        found = spread_of_prediction(instrument, run.prediction.drive, run.law)
        known = {name: float(np.sqrt(np.mean(values**2))) for name, values in found.items() if name in run.record}
    summary = {
        "card": instrument.name,
        "out": out,
        "rows": len(run.record),
        "columns": list(run.record.columns),
        "rate_Hz": 1 / float(np.median(np.diff(run.record["time_s"]))),
        "boundary": run.prediction.drive.boundary,
        "seed": None if noiseless else seed,
        "frequency_Hz": {"first": run.record["frequency_Hz"][0], "last": run.record["frequency_Hz"][-1]},
        **row_of(run.law, solver_relative_error="solver_error", interpolation_relative_error="interpolation_error"),
        "spread": known,
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
            Table(UNCERTAINTY, list((known or {}).items()), SPREAD),
            Figure(run.record.plot, "The columns of the record."),
        ],
    )
