"""`hrg fit whole-angle`: splits, axes, gain ratio and phase error from a whole-angle run."""

from functools import partial
from math import degrees, isnan, pi
from typing import Annotated, Literal, get_args

import numpy as np

from compensation.ringdown.answer import Estimate
from compensation.wave_fit import MISALIGNED, WaveFit
from compensation.wave_fit import fit_whole_angle as fit
from studies.cli.arguments import FRACTION, Confidence, Run, open_given
from studies.cli.output import answers, keep_card, say
from studies.errors import InputError, naming, numbered
from studies.instrument.card import Instrument
from studies.instrument.tables.loop import Loop
from studies.record import Record, read_record
from studies.reports import style
from studies.reports.digits import plain, to_error
from studies.resonator.law import law_of
from studies.results import Drawing, Figure, Result, Sentence, Table

KEYS = {
    # estimate: key of the card, factor to its unit, name, unit
    "decay": ("loss.inverse_q", 0.0, "Mean loss 1/Q", ""),
    "damping_split": ("bias.damping_anisotropy", 0.0, "Damping split Δ(1/τ) over 1/τ", ""),
    "damping_axis": ("bias.damping_axis_deg", degrees(1), "Damping axis", "°"),
    "frequency_split": ("loop.frequency_split_mHz", 1e3 / (2 * pi), "Frequency split", "mHz"),
    "frequency_axis": ("loop.frequency_axis_deg", degrees(1), "Frequency axis", "°"),
    "gain_ratio": ("loop.pickoff_gain_ratio", 1.0, "Pick-off gain ratio", ""),
    "skew": ("loop.pickoff_skew_mrad", 1e3, "Pick-off skew", "mrad"),
    "phase_error": ("loop.pickoff_phase_deg", degrees(1), "Phase error", "°"),
    "rate": ("bias.offset_deg_per_h", degrees(3600), "Mean bias", "°/h"),
}
SPLIT_PER_S = "damping_split_per_s"  # where 1/τ is not known
NAMES = {key: (name, unit) for key, _, name, unit in KEYS.values()} | {SPLIT_PER_S: ("Damping split Δ(1/τ)", "1/s")}
COLUMNS = {
    # columns of the record by what the fit calls them
    "frequency": "frequency_Hz",
    "quadrature": "quadrature_V",
    "decay": "inverse_q",
    "rate": "bias_deg_per_h",
    "angle": "pattern_angle_deg",
}
AngleAt = Literal["start", "middle", "end"]
LATE: dict[str, float] = dict(zip(get_args(AngleAt), (0.0, 0.5, 1.0), strict=True))
RATE = "measured_rate_deg_per_s"
OWN = ("loops", "simulated")  # sources of records that hrg wrote, angles at the start
KEYS_OF_CARD = tuple(key for key, *_ in KEYS.values() if key != "bias.offset_deg_per_h")
ALONE = "The damping that the rate tells depends on the phase error: on that of the estimates, else on 0."
DOUBLED = "{} go around once in 180° of pattern_angle_deg, not in 90°: that may be 2 θ, the electrical angle. Give the physical azimuth."
WRAPPED = "pattern_angle_deg is wrapped at {:g}°; it counts unwrapped."
NO_SCALE = "note: quadrature_V is not used because its scale is unknown; give --quadrature-volts-per-hertz or a card with [loop]."


@answers("hrg.fit-whole-angle/1")
def fit_whole_angle(
    run: Run,
    *,
    card: str | None = None,
    bryan_factor: Annotated[float | None, FRACTION] = None,
    quadrature_volts_per_hertz: float | None = None,
    angle_at: AngleAt | None = None,
    confidence: Confidence = 0.9,
    save: str | None = None,
) -> Result:
    """Find damping and frequency splits with their axes, gain ratio and phase error in a whole-angle run, with intervals.

    The record needs time_s, pattern_angle_deg and measured_rate_deg_per_s (the indicated rate less the commanded
    precession) or bias_deg_per_h (that less the applied rate too). It may have inverse_q (drive effort), frequency_Hz, quadrature_V, and rate_deg_per_s if a
    rate was applied. A positive rate turns the angle positively, by the Bryan factor times the rate; where azimuth and rate are
    counted by the same hand the wave lags behind the shell, so change the sign of one. Each row holds means over its duration. Precess the wave in both directions: one direction does not determine
    the gain ratio. The phase error is that of the whole path; the gain ratio of the drives is taken from the card. Columns are
    also fitted alone: where they contradict each other, what they share is not estimated, and no card is saved.

    Args:
        card: Its card: gives the Bryan factor, the scale of quadrature_V and the gains of the drives.
        bryan_factor: Bryan factor, used instead of the card's.
        quadrature_volts_per_hertz: Scale of quadrature_V; without it and without a card, that column is not used.
        angle_at: When in its row the pattern angle is read: at the start (default, as hrg loop and hrg simulate write it), in the middle
            (such as its mean, like the other columns), or at the end.
        save: Write the card with the estimates and their uncertainties.
    """
    instrument = open_given(card, save)
    record, loop = read_record(run), instrument.loop if instrument is not None else None
    if bryan_factor is None:
        if instrument is None:
            raise InputError("the Bryan factor is not known: name the card with --card, or give --bryan-factor.")
        T = instrument.reference_temperature
        bryan_factor = law_of(instrument, T - 5, T + 5).bryan_factor
    if quadrature_volts_per_hertz is None and loop is not None:
        quadrature_volts_per_hertz = loop.quadrature_V_per_Hz
    if "quadrature_V" in record and quadrature_volts_per_hertz is None:
        say(NO_SCALE)
    fit_at = partial(_fit_record, record, bryan_factor, quadrature_volts_per_hertz, instrument, confidence)
    found = fit_at(LATE[angle_at or "start"])
    estimates = _in_card_units(found.estimates, found, record)
    names = COLUMNS | ({"rate": RATE} if RATE in record else {})
    wrong = bool(found.doubled) or any(not one.widened for one in found.conflicts)
    against = "its columns contradict each other" if wrong else ""
    saved = None if instrument is None else _keep(instrument, estimates, save, against)
    alone = {names[name]: _in_card_units(one, found, record) for name, one in found.alone.items()}
    left_out = {names[name]: record["time_s"][rows].tolist() for name, rows in found.spikes.items()}
    said = _contradictions(found, names)
    if found.doubled:
        said.append(DOUBLED.format(", ".join(names[name] for name in found.doubled)))
    payload: dict[str, object] = {"data": run, "confidence": confidence, "saved": saved, "estimates": estimates}
    payload |= {"undetermined": found.undetermined, "alone": alone, "contradictions": said, "left_out_s": left_out}
    payload["uneven_s"] = record["time_s"][found.uneven].tolist()
    rows = [_row(key, e) for key, e in estimates.items()]
    by_column = [_row(key, e) | {"column": name} for name, of in alone.items() for key, e in of.items()]
    columns = f"Quantity | value ± sd: Value | low … high ± sd: {100 * confidence:g} % interval | Unit"
    moved = ""
    if not angle_at and not record.source.startswith(OWN):
        middle = fit_at(LATE["middle"])
        moved = _moved_by_the_middle(estimates, _in_card_units(middle.estimates, middle, record))
    return Result(
        payload,
        "Errors of a whole-angle gyro",
        f"Damping, splits, gains and phase error found in {run}.",
        [
            *(Sentence(sentence, "warning") for sentence in said),
            Table("Estimates", rows, f"{columns} | key: Key of the card", "±: one standard deviation."),
            *(Sentence(f"Not determined: {sentence}.", "warning") for sentence in found.undetermined),
            *(Sentence(_left_out(name, times), "warning") for name, times in left_out.items()),
            Sentence(_uneven(record, found), "warning") if found.uneven.size else None,
            moved and Sentence(moved, "warning"),
            Sentence(WRAPPED.format(degrees(found.wrapped))) if found.wrapped else None,
            Table("Each column alone", by_column, f"column | {columns}", ALONE, "everywhere" if wrong else "page"),
            Figure(
                lambda: _draw(record, names),
                "Each column less its mean, the rate less the applied one, over the azimuth: splits go around once in 90°.",
            ),
        ],
        status=2 * (saved != save),
    )


def _draw(record: Record, names: dict[str, str]) -> Drawing:
    shown = [name for key, name in names.items() if name in record and key != "angle"]
    height, x = 0.6 + 2.0 * len(shown), "azimuth, modulo 90° (°)"
    with style.figure(len(shown), height=height, x=x, y=shown, sharex=True, squeeze=False) as (made, axes):
        for axis, name in zip(axes[:, 0], shown, strict=True):
            shown_values = record[name] - (record.columns.get("rate_deg_per_s", 0.0) if name == RATE else 0.0)
            axis.plot(record["pattern_angle_deg"] % 90.0, shown_values - shown_values.mean(), ".", markersize=2)
        return made


def _row(key: str, estimate: dict[str, float]) -> dict[str, str | float]:
    return {"quantity": NAMES[key][0], "unit": NAMES[key][1], "key": key} | estimate


def _left_out(name: str, times: list[float]) -> str:
    some = ", ".join(f"{time:g}" for time in times[:3]) + ", …" * (len(times) > 3)
    rows = f"{numbered(len(times), 'row')} of {name}"
    return f"{rows}, at {some} s: left out, contradicted by the rows beside."


def _uneven(record: Record, found: WaveFit) -> str:
    first = record["time_s"][found.uneven[0]]
    return f"{numbered(found.uneven.size, 'row')} of {len(record)}, the first at {first:g} s: left out, because the wave turned unevenly within them, or so far that their means tell nothing. Shorter rows tell more."


def _contradictions(found: WaveFit, names: dict[str, str]) -> list[str]:
    """Say which columns contradict each other, and which sign or scale of one mends it; of both splits by their signs, the angle's."""
    signs = [one for one in found.conflicts if not one.widened and abs(one.factor + 1) < 0.2]
    said = []
    for one in found.conflicts:
        first, second = (names[name] for name in one.columns)
        if one.widened:
            said.append(f"{first} and {second} differ by more than their errors about the {one.split} split; its intervals are {one.widened:.2g} times as wide for that.")  # fmt: skip
            continue
        mend = f"They would agree: multiply {second} by {one.factor:.4g}, or {first} by {1 / one.factor:.4g}."
        if isnan(one.factor):
            mend = "No sign or scale of one of them makes them agree: check both, and pattern_angle_deg."
        elif one in signs:
            mend = f"They would agree: reverse the sign of {names['angle'] if len(signs) > 1 else second}."
        elif first == "frequency_Hz":
            mend = f"They would agree: multiply {second} by {one.factor:.4g}, or divide --quadrature-volts-per-hertz by it."
        what = f"{first} and {second} contradict each other about the {one.split} split"
        said.append(f"{what}, which is not estimated. {mend}")
    return said


def _moved_by_the_middle(estimates: dict[str, dict[str, float]], other: dict[str, dict[str, float]]) -> str:
    """Say what would move by more than its error if the angles were those of the middle of the rows: the `other` estimates."""
    moved = [(0.0, "")]
    for key in estimates.keys() & other.keys():
        off = other[key]["value"] - estimates[key]["value"]
        off = (off + 45) % 90 - 45 if key.endswith("axis_deg") else off
        moved.append((abs(off) / estimates[key]["sd"], key))
    times, key = max(moved)
    if times < 1:
        return ""
    name, unit = NAMES[key]
    here, there = (to_error(one[key]["value"], estimates[key]["sd"])[0] for one in (estimates, other))
    return f"Pattern angles count as read at the start of their rows. If they are of the middle, as means are, give --angle-at middle: {name} is then {f'{there} {unit}'.strip()}, not {here} ({plain(times, 2)} standard deviations away)."


def _fit_record(
    record: Record, bryan_factor: float, volts_per_hertz: float | None, card: Instrument | None, confidence: float, late: float,
) -> WaveFit:  # fmt: skip
    for name in ("pattern_angle_deg", RATE, "bias_deg_per_h", "frequency_Hz", "inverse_q", "quadrature_V"):
        if name in record and not record.has_values(name):
            raise InputError(
                f"{record.path}: {name} has no values; leave the column out, or give a record that has them."
            )
    loop = Loop() if card is None or card.loop is None else card.loop
    applied = record.columns.get("rate_deg_per_s", 0.0)
    rate = record[RATE] if RATE in record else applied + record["bias_deg_per_h"] / 3600
    stated = {} if card is None else {value.name: value.sd for value in card.uncertain}
    frequency = record.columns.get("frequency_Hz")
    quadrature = decay = None
    if "quadrature_V" in record and volts_per_hertz is not None:
        quadrature = np.pi * record["quadrature_V"] / volts_per_hertz
    if "inverse_q" in record:
        if frequency is None:
            raise InputError(f"{record.path}: inverse_q gives the decay rate only with frequency_Hz beside it; add that column.")  # fmt: skip
        decay = np.pi * float(np.median(frequency)) * record["inverse_q"]
    with naming(record.path):
        return fit(
            record["time_s"],
            np.radians(record["pattern_angle_deg"]),
            np.radians(rate),
            coupling=2 * bryan_factor,
            applied=np.radians(applied),
            decay=decay,
            frequency=None if frequency is None else 2 * np.pi * frequency,
            quadrature=quadrature,
            drive_gain_ratio=loop.drive_gain_ratio,
            drive_skew=1e-3 * loop.drive_skew_mrad,
            pickoff_gain_ratio=loop.pickoff_gain_ratio,
            pickoff_skew=1e-3 * loop.pickoff_skew_mrad,
            misalignment=(1e-3 * loop.misalignment_mrad, 1e-3 * stated.get("loop.misalignment_mrad", 1e3 * MISALIGNED)),
            stiff=loop.quadrature_control == "stiffness",
            late=late,
            confidence=confidence,
        )


def _with_estimates(instrument: Instrument, estimates: dict[str, dict[str, float]]) -> Instrument:
    """Return the card with the estimates and their uncertainties; an anisotropy below 0 is left out."""
    values = {
        key: {"value": e["value"], "sd": e["sd"]}
        for key, e in estimates.items()
        if key in KEYS_OF_CARD and not (key == "bias.damping_anisotropy" and e["value"] < 0)
    }
    if "loop" not in instrument.content:
        instrument = instrument.with_table("loop", {"mode": "whole-angle"})
    return instrument.with_values(values)


def _keep(instrument: Instrument, estimates: dict[str, dict[str, float]], save: str | None, against: str) -> str | None:
    """Save the card with the estimates, unless the fit or a bound of a value speaks against it; return where it is."""
    if save and not against:
        try:
            instrument = _with_estimates(instrument, estimates)
        except InputError as why:
            against = f"an estimate can be none of a card ({why})"
    return keep_card(instrument, save, against)


def _in_card_units(part: dict[str, Estimate], found: WaveFit, record: Record) -> dict[str, dict[str, float]]:
    """Return estimates by the keys of a card; anisotropy over 1/τ, and 1/Q, where drive effort and frequency are known."""
    estimates = {}
    for name, (key, factor, *_) in KEYS.items():
        if name not in part:
            continue
        e = part[name]
        if name == "decay":
            factor = 1 / (pi * float(np.median(record["frequency_Hz"])))
        elif name == "damping_split":
            decay = found.estimates.get("decay")
            key, factor = (key, 1 / decay.value) if decay else (SPLIT_PER_S, 1.0)
        estimates[key] = {end: getattr(e, end) * factor for end in ("value", "sd", "low", "high")}
    return estimates
