"""`hrg loop`: the control loops of a card: margins, bias and noise by source, start-up, and a run through them."""

from math import degrees, log10
from typing import Annotated, Any

import numpy as np

from compensation.applied_rate import AppliedRate
from compensation.controllers import Loops
from shell.constants import zero_Celsius
from studies.cli.arguments import POSITIVE, Card, Seed, Temperature, open_card
from studies.cli.output import answers, keep_record, say
from studies.errors import InputError
from studies.loss.damping_law import damping_law, settled_loss
from studies.record import Record
from studies.reports.loop import describe, loop_parts
from studies.resonator.law import law_of
from studies.results import Result, row_of
from studies.simulation.chamber import load_schedule
from studies.simulation.drive import MOST_ROWS, RATE
from studies.simulation.loop import columns_of, find_range_use, require_loop, require_range, run_loops, without_loop
from studies.simulation.loop_study import LoopStudy, study_loops
from studies.simulation.state_space import write_state_space
from studies.simulation.virtual_gyro import simulate_run


@answers("hrg.loop/1")
def loop(
    card: Card,
    *,
    temperature: Temperature = None,
    rate: float = 0.0,
    out: str | None = None,
    state_space: str | None = None,
    hours: Annotated[float | None, POSITIVE] = None,
    row: Annotated[float | None, POSITIVE] = None,
    profile: str | None = None,
    both_ways: bool = False,
    seed: Seed | None = None,
    noiseless: bool = False,
) -> Result:
    """Analyze the control loops of a card: stability margins, bias and noise by source, start-up; --out adds a simulated run.

    The card's table [loop] describes the readout; damping and its anisotropy come from [loss] and [bias]. A card with an
    unstable loop is rejected, with the margin. The run contains only what the loops do: bias offset, bias polynomial and
    [[effect]] tables are applied by hrg simulate, which treats the loops as settled. A row holds means from its time to the
    next, beside the pattern angle and the temperatures at its time.

    Args:
        rate: Applied rate in °/s, within the range of the actuators.
        out: Simulate a run and write it as a record.
        state_space: Write wave and closed loops as A, B, C, D, and each loop's transfer function: .json or .mat.
        hours: Length of the run; 1 unless --hours or --profile is given.
        row: Time between rows of the run in s; 1 unless given.
        profile: Chamber profile of the run, in words or as a file with time_s, chamber_temperature_degC and optionally
            rate_deg_per_s, which is applied between rows too; frequency and loss follow the temperature.
        both_ways: Reverse the self-precession halfway through the run (whole-angle cards only).
        noiseless: Run without noise.
    """
    instrument, T = open_card(card, temperature)
    keys = require_loop(instrument)
    if both_ways and (keys.mode != "whole-angle" or keys.self_precession_deg_per_s == 0):
        raise InputError(
            f"{instrument.path}: --both-ways reverses the self-precession of a whole-angle wave; the card's [loop] has mode"
            f' "{keys.mode}" and self_precession_deg_per_s = {keys.self_precession_deg_per_s:g}. Leave --both-ways out, or set both keys.'
        )
    given = {
        "hours": hours,
        "row": row,
        "profile": profile,
        "both-ways": both_ways,
        "seed": seed,
        "noiseless": noiseless,
    }
    _check_run([name for name, value in given.items() if value not in (None, False)], out, hours, row)
    reference = instrument.reference_temperature
    law = law_of(instrument, min(T, reference) - 5, max(T, reference) + 5)
    frequency = float(np.ravel(law.frequency(T))[0])
    inverse_q, instrument = settled_loss(instrument, T)
    study = study_loops(instrument, frequency, inverse_q, law.bryan_factor, np.radians(rate))
    if state_space is not None:
        write_state_space(study, state_space)
        say(f"state space: {state_space}")
    run = None
    if out is not None:
        drawn = None if noiseless else seed or 0
        run = _run(study, T, out, hours or 1.0, row or 1.0, rate, profile, both_ways, drawn)
    payload = {
        "card": instrument.name,
        "mode": keys.mode,
        "temperature_degC": T - zero_Celsius,
        "frequency_Hz": frequency,
        "quality_factor": 1 / inverse_q,
        "bryan_factor": law.bryan_factor,
        **_describe(study),
        "out": out,
        "rows": None if run is None else len(run),
    }
    return Result(payload, f"Loops of {instrument.name}", describe(payload), loop_parts(study, payload, run))


def _check_run(given: list[str], out: str | None, hours: float | None, row: float | None) -> None:
    """Refuse options of a run where none is written, and a run without an end."""
    if given and out is None:
        named = ", ".join(f"--{name}" for name in given)
        raise InputError(f"{named}: only for a simulated run; add --out RUN.csv to write one, or leave it out.")
    if "hours" in given and "profile" in given:
        raise InputError("--hours: the profile sets the length of the run; leave out --hours or --profile.")
    hours, row = hours or 1.0, row or 1.0
    if hours * 3600 / row > MOST_ROWS:
        raise InputError(f"--hours {hours:g} --row {row:g}: more than {MOST_ROWS} rows; increase --row.")


def _describe(study: LoopStudy) -> dict[str, Any]:
    return {
        "settled": study.settled,
        "bias": [row_of(s, source="name", deg_per_h="bias", sd_deg_per_h="sd") for s in study.sources],
        "noise": [
            {"source": name, "deg_per_h_over_1s": one, "deg_per_rt_h": walk, "angle_arcsec": angle}
            for name, (one, walk, angle) in study.noise.items()
        ],
        "margins": [
            row_of(m, "loop", crossover_Hz="crossover", phase_margin_deg=("phase", degrees(1)), reversal_Hz="reversal")
            | {"paper": Loops.PAPER[m.loop], "gain_margin_dB": 20 * log10(m.gain)}
            for m in study.margins
        ],
        "start": row_of(study.start, locked_s="locked", ready_s="ready"),
        "range": {name: float(getattr(study.use, name).max()) for name in ("rate", "quadrature", "drive", "across")},
    }


def _run(
    study: LoopStudy, temperature: float, out: str, hours: float, row: float, rate: float, profile: str | None,
    both_ways: bool, seed: int | None,
) -> Record:  # fmt: skip
    instrument, damping, applied = study.instrument, None, None
    f, loss = np.array(study.frequency), np.array(study.inverse_q)
    if profile is not None:
        chamber, commands = load_schedule(profile)
        if others := [name for name in commands if name != RATE]:
            raise InputError(f"{profile}: hrg loop applies no {', '.join(others)}; remove it, or use hrg simulate.")
        if commands and rate:
            raise InputError(f"--rate: the column {RATE} of {profile} is applied; leave out one of them.")
        thermal = simulate_run(without_loop(instrument), chamber, 1 / row, noise=False).record
        time, f, loss = thermal["time_s"], thermal["frequency_Hz"], thermal["inverse_q"]
        names = ("chamber_temperature_degC", "housing_temperature_degC", "resonator_temperature_degC")
        columns = {name: thermal[name] for name in names if name in thermal}
        T = thermal["resonator_temperature_degC"] + zero_Celsius
        law = damping_law(instrument, float(T.min()), float(T.max()))
        damping = law.wave(T) if law is not None and law.wave is not None else None
        if commands:
            applied = AppliedRate(chamber.time, np.radians(commands[RATE]))
            use = find_range_use(instrument, study.wave, applied.value)
            require_range(instrument, use, applied.value, study.wave.coupling, profile)
    else:
        time = np.asarray(row * np.arange(int(hours * 3600 / row * (1 + 1e-12)) + 1), dtype=float)
        columns = {"chamber_temperature_degC": np.full(len(time), temperature - zero_Celsius)}
    if applied is None and rate:
        applied = AppliedRate.of(np.radians(rate), time)
    generator = None if seed is None else np.random.default_rng(seed)
    run = run_loops(
        instrument, time, f, loss, study.bryan_factor, rate=applied or 0.0, both_ways=both_ways, damping=damping, generator=generator
    )  # fmt: skip
    keys = require_loop(instrument)
    columns = {"time_s": time, **columns, **columns_of(keys, run)}
    if applied is not None:
        columns[RATE] = np.degrees(applied.means(time))  # over the row, as the output is
        columns["measured_rate_deg_per_s"] = columns.pop("bias_deg_per_h") / 3600
    if run.limited:
        say(f"warning: an actuator saturated in {run.limited} of {len(time)} rows.")
    source = f"loops, {keys.mode}, " + ("without noise" if seed is None else f"seed {seed}")
    record = Record(columns, instrument=instrument.name, source=source, path=out)
    keep_record(record, out)
    return record
