"""`hrg acceptance`: the tests of IEEE Std 1431 in its order, as far as records go, against limits.

With --json one object, schema `hrg.acceptance/1`: `card`, `verdict` ("pass", "fail", "incomplete": a limit undecided or
without a record), `confidence`, `quantities` (list in the order of the standard: `key`, `section`, `unit`, `value`, `low`,
`high`, `limit`, `bound` ("most" or "least"), `verdict`, `records`, `needs` where it is missing), `elsewhere` (tests that ask
for more than records), `records` (path: the test that it served), `warm_up_band_deg_per_h`, `report`.
"""

from typing import TYPE_CHECKING, Any

from studies.cli.output import answers
from studies.reports.digits import plain, to_interval
from studies.results import Chapter, Column, Facts, Figure, Part, Result, Sentence, Table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure as Drawing

    from compensation.stability import AllanDeviation
    from studies.acceptance.judgement import Acceptance, JudgedQuantity
    from studies.record import Record

WORDS = {"pass": "every limit is met", "fail": "a limit is not met", "incomplete": "not all limits could be judged"}


@answers("hrg.acceptance/1")
def acceptance(
    card: str,
    *runs: str,
    limits: str | None = None,
    output: str = "bias_deg_per_h",
) -> Result:
    """Judge a gyro by its records: warm-up, temperature, scale factor, drift with Allan deviation, run-down, transfer function.

    Each record serves the test that it shows: at rest over temperature, at rest for an hour, several applied rates, a swept rate,
    a free decay of vibration_amplitude_V. A line '# test: warm-up' (or temperature, scale-factor, drift, run-down, transfer,
    angle-storage) above its header decides otherwise; warm-up and angle storage are taken only from records so marked. Every value has a 95 %
    interval; it is judged only if the whole interval lies on one side of its limit.

    Parameters
    ----------
    card : str
        Path of a card, or the name of one that ships: the gyro that the records are of.
    runs : str
        The records (CSV).
    limits : str
        Limits (TOML, schema hrg.limits/1): a table [limits] with the names of the quantities.
    output : str
        Column that is judged as zero-rate output, such as compensated_bias_deg_per_h.
    """
    from studies.acceptance.judgement import judge
    from studies.acceptance.limits import Limits, read_limits
    from studies.cli.output import say
    from studies.errors import InputError
    from studies.instrument.card import load_card
    from studies.record import read_record

    instrument = load_card(card)
    if not runs:
        raise InputError("name at least one record (CSV) of the gyro.")
    records = [read_record(path) for path in runs]
    for record in records:
        if record.instrument and record.instrument != instrument.name:
            say(f"warning: {record.path} is of '{record.instrument}', the card of '{instrument.name}'.")
    allowed = read_limits(limits) if limits is not None else Limits()
    found = judge(records, allowed, output)
    for line in found.lines:
        if line.limit is not None and line.measured is None:
            say(f"warning: {allowed.path} limits {line.quantity.key}, which no record gives: {line.quantity.needs}.")
    for path, use in found.used.items():
        if use.startswith("no test"):
            say(f"warning: {path} serves {use}.")
    return Result(
        _payload(found, instrument.name),
        f"Acceptance of {instrument.name}: {found.verdict}",
        f"{len(records)} record{'s' * (len(records) != 1)} of {instrument.name}, judged in the order of IEEE Std 1431-2004"
        f" (section 12); intervals of 95 %; zero-rate output: {output}.",
        _parts(found, records),
    )


def _parts(found: "Acceptance", records: "Sequence[Record]") -> "list[Chapter]":
    """What people read: the verdict, quantities beside limits, the drift, what is missing, the records."""
    note = (
        "A limit is met, or not met, only if the whole interval lies on one side of it; an upper limit applies to the magnitude of"
        " the value."
    )
    if found.band is not None:
        note += f" Warm-up: into ±{found.band:.3g} °/h about the final output."
    named = {"section": "section", "words": "quantity"}
    measured = [*named.items(), ("value", "value"), ("interval", "95 % interval"), ("unit", "unit")]
    measured += [("limit", "limit"), ("verdict", "verdict")]
    missing = [
        {"section": one.quantity.section, "words": one.quantity.words, "limit": "yes" if one.limit is not None else "no",
         "needs": one.quantity.needs}
        for one in found.lines
        if one.measured is None
    ]  # fmt: skip
    missing += [{"section": at, "words": test, "limit": "no", "needs": needs} for at, test, needs in found.elsewhere]
    missing.sort(key=lambda row: float(row["section"].split("–")[0].split(".")[1]))
    files = [
        {"path": one.path, "test": found.used[one.path], "hours": float(one["time_s"][-1] - one["time_s"][0]) / 3600,
         "rows": len(one), "sha256": one.sha256[:12]}
        for one in records
    ]  # fmt: skip
    drift: list[Part] = []
    if found.allan is not None:
        drift = [
            Figure(lambda: _allan_figure(found), "Overlapping Allan deviation of the longest drift record."),
            Sentence(_drift(found), where="page"),
        ]
    return [
        Chapter("In short", [Facts(_facts(found))]),
        Chapter("Quantities", [Table(
            "Measured, in the order of IEEE Std 1431",
            [_line(one) for one in found.lines if one.measured is not None],
            [Column(key, heading) for key, heading in measured],
            note,
        )]),
        Chapter("Drift (12.11)", drift),
        Chapter("What is missing", [Table("Not judged", missing, [
            *(Column(key, heading) for key, heading in named.items()), Column("limit", "has a limit"), Column("needs", "needs"),
        ])]),
        Chapter("Records", [Table("Records", files, [
            Column("path", "file"), Column("test", "test"), Column("hours", "length", "h", digits=3), Column("rows", "rows"),
            Column("sha256", "SHA-256 (first digits)"),
        ], where="page")]),
    ]  # fmt: skip


def _line(one: "JudgedQuantity") -> dict[str, str]:
    """A quantity with its interval, where it has one, beside its limit."""
    assert one.measured is not None
    value, low, high = one.measured.value, one.measured.low, one.measured.high
    written = [plain(value, 4)] if low is None or high is None else to_interval(value, low, high)
    return {
        "section": one.quantity.section,
        "words": one.quantity.words,
        "value": written[0],
        "interval": " … ".join(written[1:]),
        "unit": one.quantity.unit.replace("deg", "°"),
        "limit": "" if one.limit is None else f"{'≤' if one.quantity.upper else '≥'} {one.limit:g}",
        "verdict": one.verdict,
    }


def _facts(found: "Acceptance") -> list[tuple[str, str, str]]:
    judged = [line for line in found.lines if line.limit is not None]
    counts = {kind: sum(line.verdict == kind for line in judged) for kind in ("pass", "fail", "undecided", "missing")}
    failed = ", ".join(line.quantity.words for line in judged if line.verdict == "fail")
    left = ", ".join(line.quantity.words for line in judged if line.verdict in ("undecided", "missing"))
    if not judged:
        measured = sum(line.measured is not None for line in found.lines)
        return [
            ("Verdict", found.verdict, "no limit was given: --limits FILE.toml"),
            ("Measured", f"{measured} of {len(found.lines)}", "quantities"),
        ]
    return [
        ("Verdict", found.verdict, WORDS[found.verdict]),
        ("Limits met", f"{counts['pass']} of {len(judged)}", ""),
        ("Not met", str(counts["fail"]), failed),
        ("Undecided", str(counts["undecided"] + counts["missing"]), left),
    ]


def _drift(found: "Acceptance") -> str:
    assert found.allan is not None
    assert found.noise is not None
    noise = found.noise
    return (
        f"Angle random walk {noise.N / 60:.3g} °/√h, bias instability {found.allan.bias_instability[0]:.3g} °/h (lowest"
        f" point over 0.664), rate random walk {noise.K * 60:.3g} °/h/√h. Misfit {noise.misfit:.2g}: about 1 where these"
        f" three kinds of noise explain the curve{_from(found.allan)}."
    )


def _allan_figure(found: "Acceptance") -> "Drawing":
    import numpy as np

    from studies.reports import style

    allan, noise = found.allan, found.noise
    assert allan is not None
    assert noise is not None
    with style.figure(height=3.6) as (made, axes):
        axes.fill_between(allan.tau, allan.low, allan.high, color=style.SKY, alpha=0.3, label="95 % interval")
        axes.loglog(
            allan.tau, allan.deviation, "o-", color=style.BLUE, markersize=3, label="overlapping Allan deviation"
        )
        tau = np.geomspace(allan.tau[_first(allan)], allan.tau[-1], 100)
        axes.loglog(tau, noise.deviation(tau), "--", color=style.VERMILION, label="fit N, B, K")
        axes.set_xlabel("averaging time τ (s)")
        axes.set_ylabel("Allan deviation (°/h)")
        axes.legend()
        return made


def _first(allan: "AllanDeviation") -> int:
    """Return the first averaging time at which noise of the angle does not rule: from there on N, B and K are fitted."""
    return next((k for k, kind in enumerate(allan.noise) if kind != "phase"), 0)


def _from(allan: "AllanDeviation") -> str:
    first = _first(allan)
    return f" from {plain(float(allan.tau[first]))} s on; below, noise of the angle rules" if first else ""


def _payload(found: "Acceptance", name: str) -> dict[str, Any]:
    from studies.acceptance.measure import CONFIDENCE

    quantities = []
    for line in found.lines:
        q, m = line.quantity, line.measured
        entry = {
            "key": q.key,
            "section": q.section,
            "unit": q.unit,
            "value": m.value if m else None,
            "low": m.low if m else None,
            "high": m.high if m else None,
            "limit": line.limit,
            "bound": "most" if q.upper else "least",
            "verdict": line.verdict,
            "records": list(m.sources) if m else [],
            "needs": None if m else q.needs,
        }
        quantities.append(entry)
    return {
        "schema": "hrg.acceptance/1",
        "card": name,
        "verdict": found.verdict,
        "confidence": CONFIDENCE,
        "quantities": quantities,
        "elsewhere": [{"section": s, "test": test, "needs": needs} for s, test, needs in found.elsewhere],
        "records": found.used,
        "warm_up_band_deg_per_h": found.band,
        "report": None,
    }
