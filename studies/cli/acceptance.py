"""`hrg acceptance`: the tests of IEEE Std 1431 in its order, as far as records go, against limits."""

from typing import Any

import numpy as np

from studies.acceptance.judgement import Acceptance, JudgedQuantity, judge
from studies.acceptance.limits import ELSEWHERE, SCHEMA, Limits
from studies.acceptance.measure import CONFIDENCE
from studies.calibration.misreading import check_unit
from studies.cli.arguments import Card, Records
from studies.cli.output import answers, say
from studies.errors import InputError, nearest, numbered
from studies.fits.misread_decay import doubt_unit
from studies.fits.ringdown import is_decay, read_decay
from studies.instrument.card import load_card
from studies.instrument.units import unit_of
from studies.record import read_record
from studies.record.one_gyro import records_of_one_gyro
from studies.record.plausible import check_card_frequency
from studies.record.uses import OUTPUT
from studies.reports import style
from studies.reports.digits import plain
from studies.resonator.law import law_of
from studies.results import Chapter, Column, Drawing, Fact, Facts, Figure, Part, Result, Sentence, Table, row_of
from studies.schema.reader import read_file

VERDICTS = {"pass": "all limits met", "fail": "a limit is not met", "incomplete": "not all limits could be judged"}
MEASURED = "words: quantity | section | value in low … high: value | low … high: 90 % interval .0 | shown_unit: unit | shown_limit: limit | verdict"
RECORDS = (
    Column(lambda record: np.ptp(record["time_s"]) / 3600, "duration", "h", digits=3),
    Column(len, "rows"),
    Column(lambda record: record.sha256[:12], "SHA-256, first digits"),
)


@answers("hrg.acceptance/1")
def acceptance(card: Card, *runs: Records, limits: str | None = None, output: str = OUTPUT) -> Result:
    """Judge a gyro by its records: warm-up, temperature, scale factor, drift with Allan deviation, run-down, transfer function.

    Each record serves the test that its columns show: rest over temperature, rest for an hour or more, several applied rates, a swept
    rate, or a free decay: vibration_amplitude_V, or raw samples, lock-in pairs or a power as hrg fit ringdown reads them. A line '# test: warm-up' (or temperature, scale-factor, drift, run-down, transfer,
    angle-storage) above the header overrides this; warm-up and angle storage need it. Over temperature, that of the resonator counts, which lags its thermometer as the frequency shows. Every value has a 90 % interval; a limit is
    judged only if the whole interval lies on one side of it.

    Args:
        limits: Limits (TOML, schema hrg.limits/1): a table [limits] with keys such as bias_deg_per_h (hrg keys limits).
        output: Column with the zero-rate output to judge, such as compensated_bias_deg_per_h.
    """
    instrument = load_card(card)
    free = [path for path in runs if is_decay(path)]
    held = [read_record(path) for path in runs if path not in free]
    records = records_of_one_gyro(held, lambda doubt: say(f"warning: {doubt}"))
    for record in records:
        check_unit(instrument, record)
    if output != OUTPUT and not any(output in record for record in records):
        known = {name for record in records for name in record.columns}
        raise InputError(f"--output {output}: no record has this column{nearest(output, known)}")
    if unit_of(output) != unit_of(OUTPUT):
        raise InputError(f"--output {output}: the zero-rate output is a column in °/h, such as compensated_{OUTPUT}.")
    decays = [read_decay(path) for path in free]
    for doubt in filter(None, (doubt_unit(decay.path, decay, instrument) for decay in decays)):
        say(f"warning: {doubt}")
    allowed = None if limits is None else read_file(limits, Limits, SCHEMA)
    found = judge(records, allowed, output, decays)
    lines = [_line(line) for line in found.lines]
    law = None
    for record in records:
        if record.instrument and record.instrument != instrument.name:
            say(f"warning: {record.path} is a record of '{record.instrument}', not of '{instrument.name}'.")
        if "frequency_Hz" in record:  # its level alone: a card without a slope over temperature will do here
            f = record["frequency_Hz"][np.isfinite(record["frequency_Hz"])]
            try:
                law = law or law_of(instrument, instrument.reference_temperature, instrument.reference_temperature)
                check_card_frequency(instrument, np.median(f, keepdims=True) if f.size else f, record.path, law)
            except InputError as doubt:
                say(f"warning: {doubt}")
        if "no test: " in found.used[record.path] or ", not used: " in found.used[record.path]:
            say(f"warning: {record.path} is not used: {found.used[record.path].partition(': ')[2]}.")
    for line in lines:
        if line["limit"] is not None and line["needs"]:
            say(f"warning: {limits} limits {line['key']}, but no record gives it; it needs {line['needs']}.")
    elsewhere = [{"section": s, "test": test, "needs": needs} for s, test, needs in ELSEWHERE]
    payload = {
        "card": instrument.name,
        **row_of(found, "verdict", records="used", warm_up_band_deg_per_h="band"),
        "confidence": CONFIDENCE,
        "quantities": lines,
        "elsewhere": elsewhere,
        "report": None,
    }
    rows = [line | _shown(line, one) for line, one in zip(lines, found.lines, strict=True)]
    missing = [row for row in rows if row["needs"]]
    missing += [{**one, "words": one["test"], "limited": "no"} for one in elsewhere]
    missing.sort(key=lambda row: float(row["section"].split("–")[0].split(".")[1]))
    used = Column(lambda record: found.used[record.path], "test")
    note = "A limit is judged only if the whole interval lies on one side of it. An upper limit applies to the magnitude."  # fmt: skip
    if any(row["section"] == "12.9" and not row["needs"] for row in rows):
        note += " The scale factor is that of the straight line; its error is that of the noise while a rate is held and, where they scatter more, of rates held again: without such a record errors from hold to hold are not known."
    if found.several_drifts:
        note += (
            " Noise coefficients are the largest of the drift records that are at least half as long as the longest."
        )
    if found.band is not None:
        note += f" Warm-up ends when the output stays within ±{found.band:.3g} °/h of its final value."
    parts: list[Chapter | Part] = [
        Facts(_facts(found)),
        Table("Measured, in the order of IEEE Std 1431", [row for row in rows if not row["needs"]], MEASURED, note),
        Chapter("Drift (12.11)", _drift(found)),
        Chapter("Not judged", [Table("Missing quantities and tests", missing,
            "words: quantity | section | limited: has a limit | needs")]),
        Chapter("Records", [
            Table("Files read", records, ("path: file", used, *RECORDS), where="page"),
            Table("Free decays read", decays, "path: file | window.0 … window.1: free decay (s)", where="page"),
            *(Sentence(f"{decay.path}: {' '.join(decay.remarks)}", "warning") for decay in decays if decay.remarks),
        ]),
    ]  # fmt: skip
    lead = f"{numbered(len(runs), 'record')} of {instrument.name}, judged in the order of section 12 of IEEE Std 1431-2004. Intervals are 90 %; the zero-rate output is {output}."
    return Result(payload, f"Acceptance of {instrument.name}: {found.verdict}", lead, parts)


def _line(line: JudgedQuantity) -> dict[str, Any]:
    q, m = line.quantity, line.measured
    said = {"bound": "most" if q.upper else "least", "records": m.sources if m else (), "needs": None if m else q.needs}
    judged = row_of(m, "value", "low", "high") | row_of(line, "limit", "verdict")
    return row_of(q, "key", "section", "unit") | judged | said


def _shown(line: dict[str, Any], one: JudgedQuantity) -> dict[str, Any]:
    """A line as people read it; a value of 0 at the end of its interval was not detected."""
    q, shown = one.quantity, {}
    if line["value"] == 0 and line["high"]:
        shown = {"value": f"not detected (< {plain(line['high'], 2)})", "low": None, "high": None}
    limit = "" if one.limit is None else f"{'≤' if q.upper else '≥'} {plain(one.limit, 6)}"
    unit = q.unit.replace("deg", "°")
    return shown | {"words": q.words, "shown_unit": unit, "shown_limit": limit, "limited": "yes" if limit else "no"}


def _facts(found: Acceptance) -> list[Fact]:
    judged = {kind: [one.quantity.words for one in found.lines if one.limit is not None and one.verdict == kind]
              for kind in ("pass", "fail", "undecided", "missing")}  # fmt: skip
    limited = sum(map(len, judged.values()))
    if not limited:
        measured = sum(one.measured is not None for one in found.lines)
        return [
            ("Verdict", found.verdict, "no limits were given; add --limits FILE.toml"),
            ("Measured", f"{measured} of {len(found.lines)} quantities", ""),
        ]
    undecided = judged["undecided"] + judged["missing"]
    return [
        ("Verdict", found.verdict, VERDICTS[found.verdict]),
        ("Limits met", f"{len(judged['pass'])} of {limited}", ""),
        ("Not met", str(len(judged["fail"])), "; ".join(judged["fail"])),
        ("Undecided or missing", str(len(undecided)), "; ".join(undecided)),
    ]


def _drift(found: Acceptance) -> list[Figure | Sentence]:
    allan, noise = found.allan, found.noise
    if allan is None or noise is None:
        return []
    first = next((k for k, kind in enumerate(allan.noise) if kind != "phase"), 0)
    reach = f" from {plain(float(allan.tau[first]))} s on (angle noise dominates below)" if first else ""
    words = (
        f"Misfit {noise.misfit:.2g}{reach}; a value near 1 means that angle random walk, bias instability (minimum of the Allan"
        " deviation divided by 0.664) and rate random walk explain the curve."
    )

    def draw() -> Drawing:
        with style.figure(height=3.6, x="averaging time τ (s)", y="Allan deviation (°/h)") as (made, axes):
            style.draw_allan(axes, allan, style.BLUE, label, noise)
            return made

    label = "overlapping Allan deviation, 90 % interval; dashed: N, B, K"
    caption = f"Allan deviation of {found.noisiest}{', the drift record with the largest bias instability' if found.several_drifts else ''}."
    return [Figure(draw, caption, "Allan deviation over averaging time, both logarithmic."), Sentence(words)]
