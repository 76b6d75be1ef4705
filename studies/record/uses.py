"""What records can be used for: by command the line to type, or what its own readers say is missing."""

import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from compensation.errors import CompensationError
from studies.acceptance.limits import QUANTITIES
from studies.acceptance.runs import sort_records
from studies.errors import InputError
from studies.fits.bias import check_lengths, find_output, find_state
from studies.inference.records import make_ready
from studies.models.kinds.bias import OUTPUTS
from studies.models.kinds.scale import RAW
from studies.record import Record
from studies.record.rest import TEMPERATURES, choose_column, gather_rest
from studies.record.settled import advise_hold, find_soaks, settled_table

GIVEN = {"frequency_Hz": "--frequency HZ", "inverse_q": "--quality Q"}
"""What `fit cross-damping` takes where no record has it."""
OUTPUT = "bias_deg_per_h"  # that an acceptance test judges unless another is named
LEAST_SPAN = 1.0  # K, of a temperature that changes
STEP_SPAN = 10.0  # K, of a step or ramp that shows a time constant


@dataclass(frozen=True)
class Use:
    """One command: what it gives, the line to type, and what is missing ("" where nothing is)."""

    command: str
    gives: str
    line: str
    missing: str

    @property
    def ready(self) -> str:
        """Whether the records suffice."""
        return "no" if self.missing else "yes"


def find_uses(records: Sequence[Record]) -> tuple[Use, ...]:
    """Return what can be done with these records of one gyro, and what the others lack."""
    runs = " ".join(shlex.quote(record.path or "RUN.csv") for record in records)
    given = "".join(f" {words}" for name, words in GIVEN.items() if not any(name in record for record in records))
    missing = {check: _missing(check, records) for check in dict.fromkeys(check for *_, check in USES)}
    return tuple(
        Use(command, gives, f"hrg {command} " + words.replace("{runs}", runs).replace("{given}", given), missing[check])
        for command, gives, words, check in USES
    )


def _missing(check: Callable[[Sequence[Record]], object], records: Sequence[Record]) -> str:
    try:
        check(records)
    except (InputError, CompensationError) as error:
        return str(error)
    return ""


def _frequency(records: Sequence[Record]) -> None:
    soaks = find_soaks(records)
    settled_table(soaks, records[0].path, advise_hold(records, 3000.0, 0.05) if len(soaks) < 2 else "")


def _bias(records: Sequence[Record]) -> None:
    find_output(records)
    find_state(records)
    check_lengths(records)
    _check_span(records, LEAST_SPAN, "a bias over temperature")


def _thermal(records: Sequence[Record]) -> None:
    _require(records, "a fit of time constants", ("frequency_Hz",), TEMPERATURES[::2])
    _check_span(records, STEP_SPAN, "a fit of time constants")


def _cross_damping(records: Sequence[Record]) -> None:
    gather_rest(records, dict.fromkeys(OUTPUTS, 1.0))
    _check_span(records, LEAST_SPAN, "a cross-damping over temperature")


def _scale(records: Sequence[Record]) -> None:
    _require(records, "a fit of the scale", RAW, TEMPERATURES, ("rate_deg_per_s",))
    if "scale-factor" not in sort_records(records, OUTPUT)[0]:
        raise InputError(f"{records[0].path}: no record has several constant rates; run a rate table.")


def _whole_angle(records: Sequence[Record]) -> None:
    _require(records, "a fit of a whole-angle gyro", ("pattern_angle_deg",), tuple(OUTPUTS))
    if len(records) > 1:
        raise InputError("one run at a time; show a single record for its line.")


def _acceptance(records: Sequence[Record]) -> None:
    served, left = sort_records(records, OUTPUT)
    if not served:
        needs = "; ".join(dict.fromkeys(quantity.needs for quantity in QUANTITIES))
        raise InputError(f"{left[0].path}: fits none of the tests, which need {needs}.")


def _require(records: Sequence[Record], purpose: str, *columns: Sequence[str]) -> None:
    for candidates in columns:
        choose_column(records, candidates, purpose)


def _check_span(records: Sequence[Record], least: float, purpose: str) -> None:
    column = choose_column(records, TEMPERATURES, purpose) if any(T in r for r in records for T in TEMPERATURES) else ""
    known = [record[column][np.isfinite(record[column])] for record in records] if column else []
    span = max((float(np.ptp(T)) for T in known if T.size), default=np.inf)
    if span < least:
        raise InputError(f"{records[0].path}: {column} changes by {span:.2g} K only; {purpose} needs {least:g} K or more: ramp or step the chamber.")  # fmt: skip


USES: tuple[tuple[str, str, str, Callable[[Sequence[Record]], object]], ...] = (
    ("fit frequency", "f(T) and its inverse", "{runs} --save frequency.toml", _frequency),
    ("fit bias", "bias over frequency or temperature and their rates", "{runs} --save bias.toml", _bias),
    ("fit thermal", "thermal time constants", "{runs}", _thermal),
    (
        "fit cross-damping",
        "cross-damping bias over temperature",
        "{runs}{given} --save cross-damping.toml",
        _cross_damping,
    ),
    ("fit scale", "bias and scale factor over rate and temperature", "{runs} --save scale.toml", _scale),
    ("fit whole-angle", "splits, axes and gains", "{runs} --card CARD.toml", _whole_angle),
    ("calibrate", "values of a card", "CARD.toml {runs} --save CALIBRATED.toml", make_ready),
    ("diagnose", "effects beyond the usual model", "{runs}", make_ready),
    ("acceptance", "values against limits (IEEE 1431)", "CARD.toml {runs}", _acceptance),
)
