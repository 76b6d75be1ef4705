"""The page of an acceptance test: the verdict, every quantity against its limit, the drift, and what is missing."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from studies.reports import style
from studies.reports.digits import plain, to_interval
from studies.reports.page import Block, Chapter, Facts, Picture, Table, Text, draw, render_page

if TYPE_CHECKING:
    from compensation.stability import AllanDeviation
    from studies.acceptance.judgement import Acceptance, JudgedQuantity
    from studies.record import Record

WORDS = {"pass": "every limit is met", "fail": "a limit is not met", "incomplete": "not all limits could be judged"}


def acceptance_page(found: "Acceptance", name: str, records: "Sequence[Record]", output: str) -> str:
    """Return the page."""
    lead = (
        f"{len(records)} record{'s' * (len(records) != 1)} of {name}, judged in the order of IEEE Std 1431-2004 (section 12)"
        f" as far as records go; intervals of 95 %; zero-rate output: {output}."
    )
    chapters = [
        Chapter("In short", [_facts(found)]),
        Chapter("Quantities", [quantities_table(found)]),
        *([Chapter("Drift (12.11)", _drift(found))] if found.allan is not None else []),
        Chapter("What is missing", [_missing(found)]),
        Chapter("Records", [_records(found, records)]),
    ]
    return render_page(f"Acceptance of {name}: {found.verdict}", lead, chapters)


def quantities_table(found: "Acceptance") -> Table:
    """Return what was measured beside its limit."""
    rows = [
        [
            line.quantity.section,
            line.quantity.words,
            *_to_digits(line),
            line.quantity.unit.replace("deg", "°"),
            "" if line.limit is None else f"{'≤' if line.quantity.upper else '≥'} {line.limit:g}",
            line.verdict,
        ]
        for line in found.lines
        if line.measured is not None
    ]
    note = "A limit is met, or not met, if the whole interval is; an upper limit applies to the magnitude of the value."
    if found.band is not None:
        note += f" Warm-up: into ±{found.band:.3g} °/h about the final output."
    return Table(
        "Measured, in the order of IEEE Std 1431",
        ["Section", "Quantity", "Value", "95 % interval", "Unit", "Limit", "Verdict"],
        rows,
        note,
    )


def _to_digits(line: "JudgedQuantity") -> list[str]:
    """Return the value and its interval, where it has one."""
    assert line.measured is not None
    value, low, high = line.measured.value, line.measured.low, line.measured.high
    if low is None or high is None:
        return [plain(value, 4), ""]
    value_words, low_words, high_words = to_interval(value, low, high)
    return [value_words, f"{low_words} … {high_words}"]


def _facts(found: "Acceptance") -> Facts:
    judged = [line for line in found.lines if line.limit is not None]
    counts = {kind: sum(line.verdict == kind for line in judged) for kind in ("pass", "fail", "undecided", "missing")}
    failed = ", ".join(line.quantity.words for line in judged if line.verdict == "fail")
    open_ = ", ".join(line.quantity.words for line in judged if line.verdict in ("undecided", "missing"))
    if not judged:
        none = "give them with `--limits FILE.toml`"
        measured = sum(line.measured is not None for line in found.lines)
        return Facts(
            [
                ("Verdict", found.verdict, "no limit was given"),
                ("Limits", "none", none),
                ("Measured", f"{measured} of {len(found.lines)}", "quantities; what the others need stands below"),
            ]
        )
    return Facts(
        [
            ("Verdict", found.verdict, WORDS[found.verdict]),
            ("Limits met", f"{counts['pass']} of {len(judged)}", ""),
            ("Not met", str(counts["fail"]), failed),
            ("Open", str(counts["undecided"] + counts["missing"]), open_),
        ]
    )


def _drift(found: "Acceptance") -> list[Block]:
    assert found.allan is not None
    assert found.noise is not None
    noise = found.noise
    text = (
        f"Angle random walk {noise.N / 60:.3g} °/√h, bias instability {found.allan.bias_instability[0]:.3g} °/h (lowest"
        f" point over 0.664), rate random walk {noise.K * 60:.3g} °/h/√h. Misfit {noise.misfit:.2g}: about 1 where these"
        f" three kinds of noise explain the curve{_from(found.allan)}."
    )
    return [_allan_figure(found), Text(text)]


def _allan_figure(found: "Acceptance") -> Picture:
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
    return draw(
        made, "Allan deviation of the longest drift record.", "Allan deviation over averaging time, both logarithmic."
    )


def _first(allan: "AllanDeviation") -> int:
    """Return the first averaging time at which noise of the angle does not rule: from there on N, B and K are fitted."""
    return next((k for k, kind in enumerate(allan.noise) if kind != "phase"), 0)


def _from(allan: "AllanDeviation") -> str:
    first = _first(allan)
    return f" from {plain(float(allan.tau[first]))} s on; below, noise of the angle rules" if first else ""


def _missing(found: "Acceptance") -> Table:
    rows = [
        [line.quantity.section, line.quantity.words, "yes" if line.limit is not None else "no", line.quantity.needs]
        for line in found.lines
        if line.measured is None
    ]
    rows += [[section, test, "no", needs] for section, test, needs in found.elsewhere]
    rows.sort(key=lambda row: float(row[0].split("–")[0].split(".")[1]))
    return Table("Not judged", ["Section", "Quantity or test", "Has a limit", "What it needs"], rows)


def _records(found: "Acceptance", records: "Sequence[Record]") -> Table:
    rows = [
        [
            record.path,
            found.used[record.path],
            f"{(record['time_s'][-1] - record['time_s'][0]) / 3600:.3g}",
            str(len(record)),
            record.sha256[:12],
        ]
        for record in records
    ]
    return Table("Records", ["File", "Test", "Hours", "Rows", "SHA-256 (first digits)"], rows)
