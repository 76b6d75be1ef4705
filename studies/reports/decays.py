"""Laws of many decays as rows, tables and pictures."""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.reports import style
from studies.results import Chapter, Column, Drawing, Figure, Part, Table, row_of

if TYPE_CHECKING:
    from compensation.ringdown.laws import Law, Term
    from studies.decays import Decays

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
TERM = (
    Column("words", "depends on"),
    Column("shown", "value", error="shown_sd"),
    Column("shown_low", "90 % interval", interval=("shown_low", "shown_high"), error="shown_sd"),
    Column("shown_unit", "unit"),
)


def law_row(name: str, law: "Law") -> dict[str, Any]:
    """Return a law for --json: relative values of a frequency (1 = the frequency itself), plain ones of 1/Q."""
    level = float(np.exp(law.level.value)) if name == "frequency_Hz" else law.level.value
    return {
        "level": level,
        "level_sd": law.level.sd * (level if name == "frequency_Hz" else 1),
        "terms": [row_of(term, "value", "sd", "low", "high", term="name") for term in law.terms],
        **row_of(law, "scatter", sessions_s="sessions", left_out_rows="left_out"),
    }


def law_chapter(laws: "dict[str, Law]", decays: "Decays") -> Chapter:
    """Return tables, what the laws say in words, and pictures of them."""
    parts: list[Part] = []
    for name, law in laws.items():
        if name == "frequency_Hz":
            note = f"Level: {law_row(name, law)['level']:.10g} Hz. Scatter: {1e6 * law.scatter:.3g} ppm."
        else:
            level = f"{law.level.value:.4g} ± {law.level.sd:.2g}"
            note = f"1/Q without these: {level}. Scatter: {100 * law.scatter:.2g} %."
        rows, over = [_shown(name, term, law) for term in law.terms], f"{TITLES[name]} over many decays"
        parts.append(Table(over, rows, TERM, note + " ±: one standard deviation, from the scatter of the decays."))
        parts += [f"{TITLES[name]}: {words}" for words in _remarks(law)]
        caption = f"{TITLES[name]} of every decay and the law (orange crosses)."
        parts.append(Figure(partial(_draw, name, law, decays), caption) if law.terms else None)
    return Chapter("Over many decays", parts)


def _shown(name: str, term: "Term", law: "Law") -> dict[str, Any]:
    scale, unit = (1e6, "ppm") if name == "frequency_Hz" else (1.0, "1")
    if term.name.startswith("step"):
        day = law.sessions[int(term.name.split()[1]) - 1] / 86400
        words, per = f"step to the session that begins at {day:.4g} d", ""
    else:
        words, per, _ = WORDS[term.name]
    values = {"shown": term.value, "shown_sd": term.sd, "shown_low": term.low, "shown_high": term.high}
    shown_unit = f"{unit}/{per}" if per else unit.replace("1", "")
    return {"words": words, "shown_unit": shown_unit} | {key: scale * x for key, x in values.items()}


def _remarks(law: "Law") -> list[str]:
    said = []
    if law.left_out:
        said.append(
            f"the first {law.left_out} readings of every decay follow another law (launch or release) and are left out."
        )
    names = [term.name for term in law.terms]
    if "step 1" in names:
        said.append("sessions differ by steps that no common ageing explains: mounting, or what was done between them.")
    elif "time" in names:
        said.append(
            "it changes with time beyond what the conditions explain: ageing, or a condition that was not recorded."
        )
    return said


def _draw(name: str, law: "Law", decays: "Decays") -> Drawing:
    """Draw readings and law over each condition."""
    over = list(dict.fromkeys(WORDS[t.name][2] for t in law.terms if WORDS.get(t.name, ("", "", ""))[2]))
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
            if column == "pressure_Pa":
                axis.set_xscale("log")
    return made
