"""`hrg loop`: the loops of a card: margins, bias and noise by source, start-up, and a run through them.

With --json one object, schema `hrg.loop/1`: `card`, `mode`, `temperature_degC`, `frequency_Hz`, `quality_factor`,
`bryan_factor`; `settled` (columns of a record, at rest); `bias` (list of `source`, `deg_per_h`, `sd_deg_per_h`; the last is
"all"); `noise` (list of `source`, `deg_per_h_over_1s`, `deg_per_rt_h`); `margins` (list of `loop`, `paper`, `crossover_Hz`,
`phase_margin_deg`, `gain_margin_dB`, `reversal_Hz`); `start` (`locked_s`, `ready_s`); `range` (parts of the actuators' ranges in
use: `rate`, `quadrature`, `drive`, `across`: rate and quadrature together where quadrature is a force); `out` and `rows` of the run, or null.
"""

from typing import TYPE_CHECKING, Any

from studies.cli.arguments import Seed
from studies.cli.output import answers
from studies.results import Result

if TYPE_CHECKING:
    from studies.record import Record
    from studies.simulation.loop_study import LoopStudy


@answers("hrg.loop/1")
def loop(
    card: str,
    *,
    temperature: float | None = None,
    out: str | None = None,
    hours: float = 1.0,
    row: float = 1.0,
    rate: float = 0.0,
    profile: str | None = None,
    both_ways: bool = False,
    seed: Seed = 0,
    noiseless: bool = False,
) -> Result:
    """Study the loops of a card: stability margins, bias and noise by source, start-up; with --out also a run through them.

    The card's table [loop] says how the gyro is read; loss, damping anisotropy and azimuth come from [loss] and [bias]. A
    loop that is unstable is refused with its margin. A run has what the loops make of the wave; offset, polynomial and
    effects of the card are those of hrg simulate, where a card's loops count as settled.

    Parameters
    ----------
    card : str
        Path of a card, or the name of one that ships (hrg cards).
    temperature : float
        In °C; the card's reference temperature unless given.
    out : str
        Write a record of a run through the loops.
    hours : float
        Its length, when no profile is given.
    row : float
        Time between its rows in s.
    rate : float
        Applied rate in °/s; one beyond the range of the force is refused.
    profile : str
        Chamber profile, as for hrg simulate: frequency and loss follow the temperature.
    both_ways : bool
        Whole-angle cards only: reverse the self-precession halfway through the run.
    seed : int
        Seed of the noise.
    noiseless : bool
        Leave out noise.
    """
    import numpy as np

    from shell.constants import zero_Celsius
    from studies.cli.output import say
    from studies.errors import InputError
    from studies.instrument.card import load_card
    from studies.law import law_of
    from studies.loss.damping_law import settled_loss
    from studies.reports.loop import loop_lead, loop_parts
    from studies.simulation.drive import MOST_ROWS
    from studies.simulation.loop import require_loop
    from studies.simulation.loop_study import study_loops

    instrument = load_card(card)
    keys = require_loop(instrument)
    T = instrument.reference_temperature if temperature is None else temperature + zero_Celsius
    if not (0 < row < np.inf and 0 < hours < np.inf and np.isfinite(rate)):
        raise InputError("--row and --hours must be positive, and --rate finite.")
    if hours * 3600 / row > MOST_ROWS:
        raise InputError(f"--hours {hours:g} in rows of {row:g} s are more than {MOST_ROWS} rows; take longer rows.")
    if both_ways and (keys.mode != "whole-angle" or keys.self_precession_deg_per_s == 0):
        raise InputError(
            f"{instrument.path}: --both-ways reverses the self-precession of a whole-angle wave; the card's [loop] has mode"
            f' "{keys.mode}" and self_precession_deg_per_s = {keys.self_precession_deg_per_s:g}. Leave --both-ways out, or set both keys.'
        )
    law = law_of(instrument, min(T, instrument.reference_temperature) - 5, max(T, instrument.reference_temperature) + 5)
    frequency = float(np.ravel(law.frequency(T))[0])
    inverse_q, instrument = settled_loss(instrument, T)
    study = study_loops(instrument, frequency, inverse_q, law.bryan_factor, np.radians(rate))
    run = None
    if out is not None:
        run = _run(
            instrument,
            T,
            law.bryan_factor,
            frequency,
            inverse_q,
            out,
            hours,
            row,
            rate,
            profile,
            both_ways,
            None if noiseless else seed,
        )
        say(f"record: {out}, {len(run)} rows")
    head = {
        "schema": "hrg.loop/1",
        "card": instrument.name,
        "mode": keys.mode,
        "temperature_degC": T - zero_Celsius,
        "frequency_Hz": frequency,
        "quality_factor": 1 / inverse_q,
        "bryan_factor": law.bryan_factor,
    }
    payload = {**head, **_payload(study), "out": out, "rows": None if run is None else len(run)}
    lead, parts = loop_lead(study, T - zero_Celsius), loop_parts(study, payload, run)
    return Result(payload, f"Loops of {instrument.name}", lead, parts)


def _paper(name: str) -> str:
    from compensation.controllers import Loops

    return Loops.PAPER[name]


def _payload(study: "LoopStudy") -> dict[str, Any]:
    from math import degrees, log10

    return {
        "settled": study.settled,
        "bias": [{"source": s.name, "deg_per_h": s.bias, "sd_deg_per_h": s.sd} for s in study.sources],
        "noise": [
            {"source": name, "deg_per_h_over_1s": one, "deg_per_rt_h": walk}
            for name, (one, walk) in study.noise.items()
        ],
        "margins": [
            {
                "loop": m.loop,
                "paper": _paper(m.loop),
                "crossover_Hz": m.crossover,
                "phase_margin_deg": degrees(m.phase),
                "gain_margin_dB": 20 * log10(m.gain),
                "reversal_Hz": m.reversal,
            }
            for m in study.margins
        ],
        "start": {"locked_s": study.start.locked, "ready_s": study.start.ready},
        "range": {name: float(getattr(study.use, name).max()) for name in ("rate", "quadrature", "drive", "across")},
    }


def _run(
    instrument: Any,
    temperature: float,
    bryan_factor: float,
    frequency: float,
    inverse_q: float,
    out: str,
    hours: float,
    row: float,
    rate: float,
    profile: str | None,
    both_ways: bool,
    seed: int | None,
) -> "Record":
    import numpy as np

    from shell.constants import zero_Celsius
    from studies.cli.output import say
    from studies.loss.damping_law import damping_law
    from studies.record import Record, write_record
    from studies.simulation.chamber import load_profile
    from studies.simulation.loop import columns_of, run_loops, without_loop
    from studies.simulation.virtual_gyro import simulate_run

    columns: dict[str, Any] = {}
    damping = None
    f, loss = np.array(frequency), np.array(inverse_q)
    if profile is not None:
        thermal = simulate_run(without_loop(instrument), load_profile(profile), 1 / row, noise=False).record
        time = thermal["time_s"]
        f, loss = thermal["frequency_Hz"], thermal["inverse_q"]
        names = ("chamber_temperature_degC", "housing_temperature_degC", "resonator_temperature_degC")
        columns = {name: thermal[name] for name in names if name in thermal}
        warmed = thermal["resonator_temperature_degC"] + zero_Celsius
        law = damping_law(instrument, float(warmed.min()), float(warmed.max()))
        damping = law.wave(warmed) if law is not None and law.wave is not None else None
    else:
        time = np.asarray(row * np.arange(int(hours * 3600 / row * (1 + 1e-12)) + 1), dtype=float)
        columns = {"chamber_temperature_degC": np.full(len(time), temperature - zero_Celsius)}
    generator = None if seed is None else np.random.default_rng(seed)
    run = run_loops(
        instrument,
        time,
        f,
        loss,
        bryan_factor,
        rate=np.radians(rate),
        both_ways=both_ways,
        damping=damping,
        generator=generator,
    )
    found = columns_of(instrument.loop, run)
    columns = {"time_s": time, **columns, **found}
    if rate:
        columns["rate_deg_per_s"] = np.full(len(time), rate)
        columns["measured_rate_deg_per_s"] = columns.pop("bias_deg_per_h") / 3600
    source = f"loops, {instrument.loop.mode}, " + ("without noise" if seed is None else f"seed {seed}")
    if run.limited:
        say(f"warning: an actuator was at its limit in {run.limited} of {len(time)} rows.")
    record = Record(columns, instrument=instrument.name, source=source, path=out)
    write_record(record, out)
    return record
