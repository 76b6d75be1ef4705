"""`hrg fit ringdown`: frequencies, Q and axes from free decays."""

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from compensation.ringdown.laws import Law
from studies.cli.arguments import COUNT, POSITIVE, Files, Harmonic, open_given
from studies.cli.output import answers, keep_card, say
from studies.errors import InputError
from studies.fits.misread_decay import doubt_unit
from studies.fits.ringdown import Decay, read_decay, with_decay
from studies.progress import Told
from studies.record.decays import Decays, fit_laws, is_table, read_table, table_of, write_decays
from studies.reports import style
from studies.reports.digits import to_error
from studies.resonator.law import law_of
from studies.results import Chapter, Drawing, Figure, Part, Result, Sentence, Table, row_of

QUANTITIES = {
    "frequency_1_Hz": "frequency of the upper mode (Hz)",
    "frequency_2_Hz": "frequency of the lower mode (Hz)",
    "frequency_Hz": "mean frequency (Hz)",
    "split_Hz": "frequency split (Hz)",
    "frequency_axis_deg": "axis of the upper mode (°)",
    "q_1": "Q of the upper mode",
    "q_2": "Q of the lower mode",
    "inverse_q": "mean 1/Q",
    "decay_time_s": "decay time of the amplitude (s)",
    "decay_per_s": "decay rate of the amplitude (1/s)",
    "damping_split_per_s": "damping split Δ(1/τ) (1/s)",
    "damping_axis_deg": "axis of most damping (°)",
    "hardening_Hz": "frequency shift due to amplitude, at the start (Hz)",
    "thickening_per_s": "extra damping due to amplitude, at the start (1/s)",
}
ESTIMATE = "quantity | value ± sd: value | low … high ± sd: 90 % interval"
DECAY = "file | frequency_Hz: f (Hz) .9 | q: Q .6 | q_low … q_high: 90 % interval of Q .6 | window_s.0 … window_s.1: free decay (s) | widening: interval / Cramér–Rao bound .2"


@answers("hrg.fit-ringdown/3")
def fit_ringdown(
    *data: Files,
    card: str | None = None,
    frequency: Annotated[float | None, POSITIVE] = None,
    harmonic: Annotated[Harmonic, COUNT] = 2,
    save: str | None = None,
    out: str | None = None,
) -> Result:
    """Fit frequencies, Q and the axes of elasticity and damping to ring-downs, with 90 % intervals.

    A file holds one decay: time_s and pickoff_cos_V (and pickoff_sin_V) as raw samples; from a lock-in amplifier
    amplitude_cos_V with phase_cos_deg, or in_phase_cos_V with out_of_phase_cos_V (and the same with sin); or power_dB, power_dBm or power_W. A spectrum analyser's trace has
    frequency_Hz and a power: Lorentzian lines on a background give frequency and Q. The drive, the release transient and the noise floor are
    found and left out. The split is of stiffness and mass alone; damping about another axis pulls the two frequencies closer. Several files are several decays of one resonator: with comments such as '# pressure_Pa: 0.01',
    '# temperature_degC: 22.5' and '# start: 2026-03-01T10:00:00', frequency and 1/Q are fitted against pressure, temperature and
    time (ageing, or steps between sessions). A table of earlier results does the same: frequency_Hz or inverse_q beside
    time_s, housing_temperature_degC, pressure_Pa or vibration_amplitude_V; with a column decay, rows are readings within one decay.

    Args:
        data: The files.
        card: The resonator's card: an aliased frequency is recognised by it, and --save writes it with the values found.
        frequency: Carrier or reference frequency in Hz, in place of the file's comment '# reference_frequency_Hz: …'.
        save: Write the card with the split, its axis, 1/Q and the damping axis of the first decay.
        out: Write a record with a row for each decay (temperature, frequency, 1/Q), for hrg calibrate and hrg diagnose.
    """
    instrument = open_given(card, save)
    expected = None
    if instrument is not None and harmonic == 2:
        T = instrument.reference_temperature
        expected = float(law_of(instrument, T - 5, T + 5).frequency(T))
    tables = [path for path in data if is_table(path)]
    if tables and (len(data) > 1 or save is not None):
        raise InputError(f"{tables[0]}: a table of decays must be fitted alone, without --save; leave out the rest.")
    decays = []
    with Told("ring-downs") as told:
        for number, path in enumerate(data if not tables else ()):
            told(path, number / len(data))
            decays.append(read_decay(path, frequency=frequency, harmonic=harmonic, expected=expected))
            if instrument is not None and (doubt := doubt_unit(path, decays[-1], instrument)):
                if save is not None:
                    raise InputError(doubt)
                say(f"warning: {doubt}")
    table = read_table(tables[0]) if tables else table_of(decays)
    laws = fit_laws(table)
    if tables and not laws:
        raise InputError(f"{tables[0]}: no law can be fitted; a table of decays needs four readings or more of frequency_Hz or inverse_q that vary with a column beside them.")  # fmt: skip
    if save is not None and instrument is not None:
        keep_card(with_decay(instrument, decays[0], harmonic), save)
    if out is not None:
        write_decays(table, out)
        say(f"record: {out}")
    rows = [_row(decay) for decay in decays]
    return Result(
        {
            "decays": rows,
            "laws": {name: _law_row(name, law, table) for name, law in laws.items()},
            "saved": save,
        },
        "Ring-down",
        f"Free decay of {data[0]}." if len(data) == 1 and not tables else "Free decays of one resonator.",
        [
            *(Table(f"Ring-down {row['file']}", row["estimates"], ESTIMATE) for row in rows if len(rows) <= 3),
            Table("Decays", rows, DECAY),
            *(Sentence(f"{row['file']}: {' '.join(row['remarks'])}", "warning") for row in rows if row["remarks"]),
            save and f"Next: 'hrg trim {save}' plans the cuts against this split; 'hrg acceptance {save} {data[0]}' judges the run-down.",
            _law_chapter(laws, table),
            Chapter("Records and fits", [
                Figure(partial(_draw, one), f"{Path(one.path).name}: record, fitted decay (orange), residual.") for one in decays
            ]),
        ],
    )  # fmt: skip


def _row(decay: Decay) -> dict[str, Any]:
    q, estimates = decay.inverse_q, decay.estimates
    return {
        "data": decay.path,
        "file": Path(decay.path).name,
        "q": q and 1 / q.value,
        "q_low": q and 1 / q.high,
        "q_high": 1 / q.low if q is not None and q.low > 0 else None,
        "estimates": [
            {"name": name, "quantity": QUANTITIES[name]} | row_of(estimates[name], "value", "sd", "low", "high")
            for name in QUANTITIES
            if name in estimates
        ],
        **row_of(
            decay, "noise", "widening", "remarks", frequency_Hz="frequency", interference_Hz="interference",
            window_s="window",
        ),
    }  # fmt: skip


def _draw(decay: Decay) -> Drawing:
    unit = "dB" if decay.window is None or "decay_per_s" in decay.estimates else "V"
    x, y = "frequency (Hz)" if decay.window is None else "time (s)", ("level (dB)", f"residual ({unit})")
    with style.figure(2, 1, height=4.6, sharex=True, x=x, y=y) as (drawn, (top, bottom)):
        for one, color, name in zip(decay.curves, (style.BLUE, style.VERMILION), ("cos", "sin"), strict=False):
            rows = style.few_rows(one.x.size)
            top.plot(one.x[rows], one.level[rows], ".", markersize=1.5, color=color)
            top.plot(one.x[rows], one.fitted[rows], color=style.ORANGE, linewidth=1)
            bottom.plot(one.x[rows], one.residual[rows], ".", markersize=1.5, color=color, label=f"pick-off {name}")
        if len(decay.curves) > 1:
            bottom.legend(markerscale=6, loc="upper right")
    return drawn


WORDS = {
    # term: (its name, its unit, the column it stands over)
    "temperature": ("temperature", "K", "housing_temperature_degC"),
    "temperature squared": ("temperature squared", "K²", ""),
    "pressure": ("pressure (free-molecular gas)", "Pa", "pressure_Pa"),
    "root pressure": ("root of pressure (viscous gas)", "√Pa", "pressure_Pa"),
    "energy": ("amplitude squared", "unit²", "vibration_amplitude_V"),
    "time": ("time (ageing)", "day", "time_s"),
    "time within sessions": ("time within each session", "day", "time_s"),
}
TITLES = {"frequency_Hz": "Frequency", "inverse_q": "1/Q"}
TERM = "words: depends on | shown ± shown_sd: value | shown_low … shown_high ± shown_sd: 90 % interval | shown_unit: unit"  # fmt: skip


def _law_row(name: str, law: Law, decays: Decays) -> dict[str, Any]:
    """Return a law for --json: relative values of a frequency (1 = the frequency itself), plain ones of 1/Q; the level at the mean temperature."""
    level = float(np.exp(law.level.value)) if name == "frequency_Hz" else law.level.value
    used = np.isfinite(law.fitted)
    at = float(np.mean(decays.columns[WORDS["temperature"][2]][used])) if "temperature" in law.terms else None
    return {
        "level": level,
        "level_sd": law.level.sd * (level if name == "frequency_Hz" else 1),
        "level_temperature_degC": at,
        "terms": [{"term": term} | row_of(one, "value", "sd", "low", "high") for term, one in law.terms.items()],
        **row_of(law, "scatter", sessions_s="sessions", left_out_rows="left_out"),
    }


def _law_chapter(laws: dict[str, Law], decays: Decays) -> Chapter:
    parts: list[Part] = []
    for name, law in laws.items():
        row = _law_row(name, law, decays)
        at = f" at {row['level_temperature_degC']:.4g} °C" if "temperature" in law.terms else ""
        if name == "frequency_Hz":
            note = f"Level{at}: {row['level']:.10g} Hz. Scatter: {1e6 * law.scatter:.3g} ppm."
        else:
            level = " ± ".join(to_error(law.level.value, law.level.sd))
            note = f"1/Q without these{at and ',' + at}: {level}. Scatter: {100 * law.scatter:.2g} %."
        rows, over = [_shown(name, term, law) for term in law.terms], f"{TITLES[name]} over many decays"
        if not rows:
            parts.append(f"{over}: no condition explains it, nor does time. {note}")
        parts.append(Table(over, rows, TERM, note + " ±: one standard deviation, from the scatter of the decays."))
        parts += [f"{TITLES[name]}: {words}" for words in _remarks(law)]
        caption = f"{TITLES[name]} of every decay and the law (orange crosses)."
        parts.append(Figure(partial(_draw_law, name, law, decays), caption) if law.terms else None)
    return Chapter("Over many decays", parts)


def _shown(name: str, term: str, law: Law) -> dict[str, Any]:
    scale, unit = (1e6, "ppm") if name == "frequency_Hz" else (1.0, "1")
    if term.startswith("step"):
        day = law.sessions[int(term.split()[1]) - 1] / 86400
        words, per = f"step to the session that begins at {day:.4g} d", ""
    else:
        words, per, _ = WORDS[term]
    values = row_of(law.terms[term], shown="value", shown_sd="sd", shown_low="low", shown_high="high")
    shown_unit = f"{unit}/{per}" if per else unit.replace("1", "")
    return {"words": words, "shown_unit": shown_unit} | {key: scale * x for key, x in values.items()}


def _remarks(law: Law) -> list[str]:
    said = []
    if law.left_out:
        said.append(f"the first {law.left_out} readings of every decay follow another law (release) and are left out.")
    if "step 1" in law.terms:
        said.append("sessions differ by steps that no common ageing explains: mounting, or what was done between them.")
    elif "time" in law.terms:
        said.append("it changes with time beyond the conditions: ageing, or a condition that was not recorded.")
    return said


def _draw_law(name: str, law: Law, decays: Decays) -> Drawing:
    over = list(dict.fromkeys(WORDS[t][2] for t in law.terms if t in WORDS and WORDS[t][2]))
    over = over or ["time_s"]
    labels = {"housing_temperature_degC": "temperature (°C)", "pressure_Pa": "pressure (Pa)", "vibration_amplitude_V": "amplitude", "time_s": "time (d)"}  # fmt: skip
    y, fitted = decays.columns[name], law.fitted
    y_label = "f (Hz)" if name == "frequency_Hz" else "1/Q"
    with style.figure(1, len(over), height=2.8, sharey=True, y=y_label) as (made, axes):
        for axis, column in zip(np.atleast_1d(axes), over, strict=True):
            x = decays.columns[column] / (86400 if column == "time_s" else 1)
            rows = np.argsort(x)[style.few_rows(len(x))]
            axis.plot(x[rows], y[rows], "o", color=style.BLUE, markersize=4)
            axis.plot(x[rows], fitted[rows], "x", color=style.ORANGE, markersize=4)
            axis.set_xlabel(labels[column])
            axis.ticklabel_format(axis="y", useOffset=False)
            if column == "pressure_Pa":
                axis.set_xscale("log")
    return made
