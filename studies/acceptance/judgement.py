"""The acceptance test: what the records give against limits, and what they do not give."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from compensation.stability import AllanDeviation, NoiseCoefficients
from studies.acceptance import measure
from studies.acceptance.limits import QUANTITIES, Limits, TestedQuantity
from studies.acceptance.measure import Found, Measured
from studies.acceptance.runs import Test, length_of, sort_records
from studies.acceptance.service import measure_life, measure_storage, measure_transfer
from studies.fits.ringdown import Decay
from studies.record import Record

RATE, APPLIED = "measured_rate_deg_per_s", "rate_deg_per_s"
FIRST: dict[Test, Callable[[Record], Found]] = {
    # tests that take the first record that serves them
    "scale-factor": measure.measure_scale,
    "run-down": measure.measure_run_down,
    "transfer": measure_transfer,
    "angle-storage": measure_storage,
}
Verdict = Literal["pass", "fail", "undecided", "no limit", "missing"]


@dataclass(frozen=True)
class JudgedQuantity:
    """One quantity: what was measured (None: no record gives it), its limit, and the verdict."""

    quantity: TestedQuantity
    measured: Measured | None
    limit: float | None

    @property
    def verdict(self) -> Verdict:
        """Pass or fail where all sizes of the value within its interval do."""
        if self.measured is None:
            return "missing"
        if self.limit is None:
            return "no limit"
        value, *ends = self.measured.value, self.measured.low, self.measured.high
        low, high = (value if end is None else end for end in ends)
        least, most = 0.0 if low <= 0 <= high else min(abs(low), abs(high)), max(abs(low), abs(high))
        if self.quantity.upper:
            return "pass" if most <= self.limit else "fail" if least > self.limit else "undecided"
        return "pass" if least >= self.limit else "fail" if most < self.limit else "undecided"


@dataclass(frozen=True)
class Acceptance:
    """All lines in the order of the standard, and what was done with every record."""

    lines: tuple[JudgedQuantity, ...]
    used: dict[str, str]
    band: float | None
    allan: AllanDeviation | None
    noise: NoiseCoefficients | None
    noisiest: str  # drift record that these two are of

    @property
    def several_drifts(self) -> bool:
        """Whether more than one record tells the drift."""
        return sum(test == "drift" for test in self.used.values()) > 1

    @property
    def verdict(self) -> Literal["pass", "fail", "incomplete"]:
        """Fail where one limit is not met; incomplete where one is undecided or without a record; else pass."""
        kinds = {line.verdict for line in self.lines if line.limit is not None}
        if "fail" in kinds:
            return "fail"
        return "incomplete" if kinds & {"undecided", "missing"} or not kinds else "pass"


def judge(
    records: Sequence[Record],
    limits: Limits | None = None,
    output: str = "bias_deg_per_h",
    decays: Sequence[Decay] = (),
) -> Acceptance:
    """Measure what the records and the free decays give and set it against the limits."""
    sorted_runs, left = sort_records(records, output)
    found: Found = measure.measure_seal(records)
    allan = noise = band = None
    noisiest = ""
    if "warm-up" in sorted_runs:
        asked = None if limits is None else limits.warm_up.band_deg_per_h
        more, band = measure.measure_warm_up(sorted_runs["warm-up"][0], output, asked)
        found |= more
    if "temperature" in sorted_runs:
        found |= measure.measure_temperature(sorted_runs["temperature"], output)
    if "drift" in sorted_runs:
        more, noisiest, allan, noise = measure.measure_drift(sorted_runs["drift"], output)
        found |= more
    for test, read in FIRST.items():
        for record in sorted_runs.get(test, [])[:1]:
            found |= read(record)
    found |= measure.measure_decays(decays)
    found |= measure_life(sorted_runs.get("drift", []), output)
    lines = tuple(JudgedQuantity(q, found.get(q.key), None if limits is None else limits.of(q.key)) for q in QUANTITIES)
    used: dict[str, str] = {record.path: test for test, group in sorted_runs.items() for record in group}
    for test in ("warm-up", *FIRST):
        for record in sorted_runs.get(test, [])[1:]:
            used[record.path] = f"{test}, not used: only the first record of this test counts"
    used |= {decay.path: "run-down" for decay in decays}
    grown = found["inverse_q_trend_per_year"].sources if "inverse_q_trend_per_year" in found else ()
    for record in left:
        short = f"the output at rest is of {length_of(record):.4g} s, less than an hour"
        none = short if output in record and APPLIED not in record else "its columns fit none of the tests"
        if RATE in record and not {output, APPLIED} & set(record.columns):
            none = f"at rest the tests need {output}, 3600 times {RATE}"
        used[record.path] = "growth of 1/Q" if record.path in grown else f"no test: {none}"
    return Acceptance(lines, used, band, allan, noise, noisiest)
