"""Ring-down files: decays as a laboratory records them, what one says of a gyro, and what many say together.

A file has `time_s` and, for one pick-off (cos) or two (cos along 0°, sin along 90°/n): raw samples `pickoff_cos_V`; a
lock-in's `amplitude_cos_V` and `phase_cos_deg`, or `in_phase_cos_V` and `out_of_phase_cos_V` (`#
reference_frequency_Hz: …`); or `power_dBm`, `power_dB`, `power_W`. A spectrum has `frequency_Hz` and a power. `#
pressure_Pa: …`, `# temperature_degC: …`, `# start: …` say where and when; a trace with `%` comments and a last one
`time [s], power [dBm]` is read as it is.
"""

import datetime
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from compensation.ringdown.analysis import analyse_decay
from compensation.ringdown.answer import Estimate, RingDown
from compensation.ringdown.envelope import alias_of, even_rows, from_lock_in, mix_down
from compensation.ringdown.spectrum import fit_spectrum
from compensation.ringdown.trace import analyse_trace
from studies.errors import InputError, naming
from studies.files.columns import Columns, read_columns, read_header
from studies.files.given import LARGEST
from studies.files.reading import read_bytes
from studies.fits.misread_decay import check_phase, doubt_exchange, doubt_time
from studies.instrument.card import Instrument
from studies.record import CARTESIAN, DECAYS, PARTS, POLAR, POWERS, RAW

KNOWN = ("time_s", "frequency_Hz", *DECAYS)
FAR = 0.75  # of half of the rows a second: a line so far from the reference may be one that folds there
# comments that hold a number, and the least that it may be
NOTES = {"reference_frequency_Hz": 1e-3, "pressure_Pa": 0.0, "temperature_degC": -273.15}
NOTE = re.compile(rf"^\W*({'|'.join(NOTES)})\s*:\s*(.*?)\s*$")
START = re.compile(r"^\W*(?:start|Date and time):\s*(\d{4}-\d\d-\d\d\S*(?: \d\d:\S+)?)\s*$")
FOREIGN = {
    "Frequency [Hz]": ("reference_frequency_Hz", 1.0, 0.0),
    "Temperature [K]": ("temperature_degC", 1.0, -273.15),
    "Pressure [mBar]": ("pressure_Pa", 100.0, 0.0),
}


@dataclass(frozen=True)
class Decay(RingDown):
    """One decay: what was read, and what it says."""

    path: str = ""
    notes: Mapping[str, float] = field(default_factory=dict)

    @property
    def frequency(self) -> float | None:
        """Mean frequency (Hz); a trace has that of its comments, amplitudes without a reference none."""
        if not {"inverse_q", "q_1"} & self.estimates.keys():
            return None
        names = ("frequency_Hz",) if "frequency_Hz" in self.estimates else ("frequency_1_Hz", "frequency_2_Hz")
        found = [self.estimates[name].value for name in names if name in self.estimates]
        return sum(found) / len(found) if found else self.notes["reference_frequency_Hz"]

    @property
    def inverse_q(self) -> Estimate | None:
        """1/Q; None where the frequency is not known."""
        return self.estimates.get("inverse_q")


def read_decay(
    path: str | Path, *, frequency: float | None = None, harmonic: int = 2, expected: float | None = None
) -> Decay:
    """Read one decay and analyse it; `frequency` (Hz) replaces the file's carrier or reference, an alias of `expected` (Hz) is refused."""
    table, notes = _read(path)
    if frequency is not None:
        notes = {**notes, "reference_frequency_Hz": frequency}
    columns = table.values
    powers = ((name, columns[name]) for name in POWERS if name in columns)
    power = next((values if name.endswith("W") else 10 ** (values / 10) for name, values in powers), None)
    if "time_s" not in columns:
        assert power is not None
        with naming(path):
            return _told(path, notes, fit_spectrum(columns["frequency_Hz"], power))
    time = columns["time_s"]
    table.check_order("time_s", "time_s does not increase; a decay is one record in order of time.")
    reference = notes.get("reference_frequency_Hz")
    doubts: tuple[str, ...] = ()
    with naming(path):
        if power is not None:
            found = analyse_trace(time, np.sqrt(np.maximum(power, 0.0)), reference)
            return _told(path, notes, found, doubt_time(path, found))
        raw = [columns[name] for name in RAW if name in columns]
        if raw:
            envelope, rate = mix_down(time, np.array(raw), reference), 1 / even_rows(time)[0]
            if expected is not None:
                _refuse_alias(path, envelope.carrier, rate, expected)
            if reference is not None and reference > rate / 2:
                doubts = (
                    f"Samples at {rate:.6g} Hz hold {reference:.6g} Hz as its alias at {alias_of(reference, rate):.6g} Hz: which it is of the"
                    " frequencies that fold there is as given, not measured.",
                )
        else:
            names, channels = _pairs(path, columns)
            envelope = from_lock_in(time, np.array(channels), reference or 0.0)
        if expected is not None and envelope.carrier:
            _refuse_other(path, envelope.carrier, expected)
        found = analyse_decay(envelope, harmonic=harmonic)
        if not raw:
            doubts = doubt_exchange(path, envelope, found, harmonic, names) + doubt_time(path, found)
        rate, line = 1 / even_rows(time)[0], found.estimates["frequency_Hz"].value
        if not raw and 2 * abs(line - envelope.carrier) > FAR * rate:
            other = line - np.copysign(rate, line - envelope.carrier)
            doubts += (
                f"The line is {abs(line - envelope.carrier):.3g} Hz from the reference, near half of the {rate:.3g} rows a second: it may be the alias"
                f" of one at {other:.8g} Hz. Set the reference nearer, or record more rows a second.",
            )
        return _told(path, notes, found, doubts)


def _told(path: str | Path, notes: Mapping[str, float], found: RingDown, doubts: tuple[str, ...] = ()) -> Decay:
    decay = Decay(**vars(replace(found, remarks=(*doubts, *found.remarks))), path=str(path), notes=notes)
    if decay.frequency is not None:
        return decay
    lacking = "No reference frequency is given: frequencies are relative to it, and Q is unknown; add --frequency."
    return replace(decay, remarks=(*decay.remarks, lacking))


def is_decay(path: str | Path) -> bool:
    """Return whether a file is a decay or a spectrum by its columns, and not a record."""
    header = header_of(path)
    return not header or bool(header & (set(KNOWN) - {"time_s", "frequency_Hz"}))


def header_of(path: str | Path) -> set[str]:
    """Return the columns of a file; a trace with % comments has no header."""
    return set() if read_bytes(path, first=1) == b"%" else set(read_header(path))


def _read(path: str | Path) -> tuple[Columns, dict[str, float]]:
    """Return the table and the numbers of its comments; traces with % comments have two columns and no header."""
    if not (header := header_of(path)):
        return _read_trace(path)
    spectrum = "frequency_Hz" in header and bool(header & set(POWERS))
    table = read_columns(path, KNOWN, ["frequency_Hz" if spectrum else "time_s"])
    if spectrum:
        order = "frequency_Hz does not increase; a spectrum is one trace in order of frequency, without time_s."
        table.check_order("frequency_Hz", order)
    if len(table.values) < 2:
        needs = f"{RAW[0]}, {POLAR[0][0]} with {POLAR[0][1]}, or {POWERS[0]} beside it"
        raise InputError(f"{path}: only time_s; a decay needs {needs}.")
    if empty := [name for name, x in table.values.items() if np.isnan(x).all()]:
        raise InputError(f"{path}: the column '{empty[0]}' has no value; take it out, or record it.")
    notes = _read_start(path, table.comments)
    for comment in table.comments:
        if match := NOTE.match(comment):
            notes[match[1]] = _number(path, comment, match[1], match[2])
    return table, notes


def _number(path: str | Path, comment: str, key: str, text: str, factor: float = 1.0, shift: float = 0.0) -> float:
    try:
        value = factor * float(text) + shift
    except ValueError:
        raise InputError(f"{path}: the comment '{comment}' holds no number.") from None
    if not NOTES[key] <= value < LARGEST:
        raise InputError(f"{path}: the comment '{comment}': {key} must be a number from {NOTES[key]:g} up.")
    return value


def _read_start(path: str | Path, comments: Iterable[str]) -> dict[str, float]:
    """Return the moment of a comment `start: 2026-03-01T10:00:00` as seconds since 1970."""
    for comment in comments:
        if match := START.match(comment):
            try:
                moment = datetime.datetime.fromisoformat(match[1])
            except ValueError:
                wrong = "holds no date and time such as 2026-03-01T10:00:00"
                raise InputError(f"{path}: the comment '{comment}' {wrong}.") from None
            return {"start_s": (moment if moment.tzinfo else moment.replace(tzinfo=datetime.UTC)).timestamp()}
    return {}


def _read_trace(path: str | Path) -> tuple[Columns, dict[str, float]]:
    lines = Path(path).read_text(encoding="utf-8", errors="replace").splitlines()
    comments = [line.lstrip("% ").strip() for line in lines if line.startswith("%")]
    if not comments or comments[-1] != "time [s], power [dBm]":
        raise InputError(f"{path}: comments with % are read of traces whose last comment is 'time [s], power [dBm]' only; give the file a header line.")  # fmt: skip
    notes = _read_start(path, comments)
    for comment in comments:
        name, _, text = comment.partition(":")
        if name in FOREIGN:
            key, factor, shift = FOREIGN[name]
            notes[key] = _number(path, comment, key, text, factor, shift)
    try:
        written = (line.split(",") for line in lines if line and not line.startswith("%"))
        rows = np.array([[float(cell) for cell in cells] for cells in written])
    except ValueError as error:
        raise InputError(f"{path}: {error}; every row needs a time and a power.") from None
    if rows.ndim != 2 or rows.shape[1] != 2:
        raise InputError(f"{path}: every row needs a time and a power.")
    return Columns(str(path), {"time_s": rows[:, 0], "power_dBm": rows[:, 1]}, comments=tuple(comments)), notes


def _pairs(
    path: str | Path, columns: Mapping[str, Array]
) -> tuple[list[tuple[str, str]], list[NDArray[np.complex128]]]:
    names: list[tuple[str, str]] = []
    found: list[NDArray[np.complex128]] = []
    for first, second in (*POLAR, *CARTESIAN):
        if (first in columns) != (second in columns):
            raise InputError(f"{path}: {first} and {second} belong together; one of them is missing.")
        if first in columns:
            names.append((first, second))
        if first in columns and (first, second) in POLAR:
            check_phase(path, second, columns[first], columns[second])
            found.append(np.asarray(columns[first] * np.exp(1j * np.radians(columns[second]))))
        elif first in columns:
            found.append(np.asarray(columns[first] + 1j * columns[second]))
    if len(found) > len(PARTS):
        raise InputError(f"{path}: a channel is given twice, as amplitude and phase and in two components; keep one.")
    return names, found


def _refuse_alias(path: str | Path, found: float, rate: float, expected: float) -> None:
    """Refuse samples in which the expected frequency appears folded about half of the sampling rate."""
    if expected > rate / 2 and abs(found - alias_of(expected, rate)) < 0.02 * rate:
        raise InputError(
            f"{path}: the card's {expected:.6g} Hz cannot be in samples at {rate:.6g} Hz; the line at {found:.6g} Hz is its alias. "
            f"Sample above {2 * expected:.4g} Hz, or give --frequency {expected:.6g}."
        )


def _refuse_other(path: str | Path, found: float, expected: float) -> None:
    if not 0.8 < found / expected < 1.25:
        raise InputError(
            f"{path}: the decay is at {found:.6g} Hz, the card predicts {expected:.6g} Hz, {expected / found:.4g} times as much. Correct the sampling rate"
            " (time_s) or the reference, or leave out --card for another mode."
        )


def with_decay(instrument: Instrument, decay: Decay, harmonic: int = 2) -> Instrument:
    """Return the card with what a decay of two channels says: split and slow axis, 1/Q, damping split and axis."""
    if "frequency_axis_deg" not in decay.estimates:
        raise InputError(f"{decay.path}: a card takes a split with its axis; this decay shows none: record both pick-offs, with both modes excited, for longer.")  # fmt: skip
    e = decay.estimates
    split, axis = e["split_Hz"], e["frequency_axis_deg"]
    imperfection = dict(instrument.content.get("imperfection", {}))
    imperfection["split"] = {
        "harmonic": harmonic,
        "split_Hz": split.value,
        "slow_axis_deg": (axis.value + 90 / harmonic) % (180 / harmonic),
        "split_error_Hz": max(split.sd, split.value * 2 * harmonic * float(np.radians(axis.sd))),
    }
    instrument = instrument.with_table("imperfection", imperfection)
    tau = e["decay_time_s"].value
    sizes = {
        "bias.damping_anisotropy": ("damping_split_per_s", tau),
        "bias.damping_axis_deg": ("damping_axis_deg", 1.0),
        "loss.inverse_q": ("inverse_q", 1.0),
    }
    return instrument.with_values({
        key: {"value": scale * e[name].value, "sd": scale * e[name].sd} for key, (name, scale) in sizes.items() if name in e
    })  # fmt: skip
