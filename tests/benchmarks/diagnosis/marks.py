"""Marks of recorded answers, and two engines beside each other.

right        verdict among the true ones; each hidden cause within {effect} ∪ equivalent of a named one; nothing else named
first        the strongest named cause is a hidden one, whatever the verdict
calibration  probability of a named cause against how often its set holds a hidden cause; causes outside the library hold none
held-out     held-out rms of the model that is kept over that of the true noise; ideal: of a predictor that knows form and noise
"""

import gzip
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

REACH_SD = 4.24
"""Standard deviations from which on a detector that knows noise and form could name a cause: its log likelihood ratio is 9."""
Line = dict[str, Any]


@dataclass(frozen=True)
class Mark:
    """What an answer is worth; `stated`: probability of each named cause, and whether it is there."""

    line: Line
    right: bool
    first: bool
    every: bool
    stated: tuple[tuple[float, bool], ...]
    held_out: tuple[tuple[float, float], ...]

    @property
    def kind(self) -> str:
        return str(self.line["truth"]["kind"])

    @property
    def snr(self) -> float:
        return float(self.line["truth"]["snr"])


def band(hits: int, total: int) -> tuple[float, float]:
    """Return Wilson's 90 % band of a rate (Wilson, J. Am. Stat. Assoc. 22 (1927) 209)."""
    p, z = hits / total, 1.645
    centre = (p + z * z / (2 * total)) / (1 + z * z / total)
    half = z * np.sqrt(p * (1 - p) / total + z * z / (4 * total**2)) / (1 + z * z / total)
    return max(float(centre - half), 0.0), min(float(centre + half), 1.0)


def read_lines(path: Path) -> list[Line]:
    """Return recorded answers, packed or not."""
    text = gzip.decompress(path.read_bytes()).decode() if path.suffix == ".gz" else path.read_text()
    return [json.loads(line) for line in text.splitlines()]


def mark(line: Line) -> Mark:
    """Mark one answer by the contract alone."""
    truth, verdict = line["truth"], line["verdict"]
    causes = [c for c in line["causes"] if c.get("kind", "physics") != "value"]
    sets = [{c["effect"], *c.get("equivalent", [])} for c in causes]
    known = {name for names in truth["hidden"] for name in names} | set(truth.get("tolerated", ()))
    hits = [bool(own & known) for own in sets]
    every = all(any(own & set(names) for own in sets) for names in truth["hidden"])
    right = verdict in truth["verdicts"]
    if truth["kind"] == "null":
        right = right and not causes
    elif truth["kind"] != "alien" and verdict != "adequate":
        right = right and every and all(hits)
    held = []
    for name, response in line["responses"].items():
        rms = (response.get("extended") or response["baseline"]).get("held_out_rms")
        if rms and truth.get("floor", {}).get(name) and truth["kind"] != "alien":
            held.append((rms / truth["floor"][name], truth.get("ideal", {}).get(name, np.nan)))
    stated = tuple((c["probability"], hit) for c, hit in zip(causes, hits, strict=True))
    return Mark(line, right, bool(hits and hits[0]), every, stated, tuple(held))


def calibration_error(stated: Sequence[tuple[float, bool]]) -> float:
    """Return the expected calibration error over ten equal bins of the stated probability."""
    if not stated:
        return 0.0
    p, hit = np.array([s[0] for s in stated]), np.array([s[1] for s in stated], float)
    box = np.minimum((p * 10).astype(int), 9)
    return float(sum(abs(np.sum(hit[box == b] - p[box == b])) for b in range(10)) / len(p))


ROWS: tuple[tuple[str, Callable[[Mark], bool], Callable[[Mark], bool]], ...] = (
    ("one effect, SNR ≥ 2: right class", lambda m: m.kind == "effect" and m.snr >= 2, lambda m: m.right),
    ("    strongest name right", lambda m: m.kind == "effect" and m.snr >= 2, lambda m: m.first),
    ("    in some named set", lambda m: m.kind == "effect" and m.snr >= 2, lambda m: m.every),
    ("    nothing named that is not there", lambda m: m.kind == "effect" and m.snr >= 2, lambda m: all(h for _, h in m.stated)),
    ("one effect, SNR < 2: right class", lambda m: m.kind == "effect" and m.snr < 2, lambda m: m.right),
    ("    of those that an ideal detector could name", lambda m: m.kind == "effect" and m.snr < 2 and m.line["truth"].get("reach", 0) > REACH_SD, lambda m: m.right),
    ("known effects not called unexplained", lambda m: m.kind == "effect", lambda m: m.line["verdict"] != "unexplained"),
    ("nothing hidden: adequate, nothing named", lambda m: m.kind == "null", lambda m: m.right),
    ("outside the library: unexplained", lambda m: m.kind == "alien", lambda m: m.right),
    ("    no name at 0.5 or more", lambda m: m.kind == "alien", lambda m: not any(p >= 0.5 for p, _ in m.stated)),
    ("pairs: both named", lambda m: m.kind == "pair", lambda m: m.every),
    ("pairs: right class", lambda m: m.kind == "pair", lambda m: m.right),
    ("held-out of all responses within 10 % of the floor", lambda m: bool(m.held_out), lambda m: all(h <= 1.1 for h, _ in m.held_out)),
    ("commands that answered", lambda m: True, lambda m: m.line["verdict"] != "failed"),
)  # fmt: skip


def compare(old: list[Line], new: list[Line], changed: bool = False) -> str:
    """Return the table of the campaigns that both have answered."""
    pairs = _pairs(old, new)
    marks = [(mark(a), mark(b)) for a, b in pairs if a["truth"]["kind"] != "measured"]
    commits = [" ".join(sorted({line["commit"] for line in side})) for side in (old, new)]
    lines = [f"{len(pairs)} campaigns of both, old {commits[0]}, new {commits[1]}"]
    sources = ["", *sorted({a.line["case"].split(":")[0] + (" with card" * a.line["card"]) for a, _ in marks})]
    for source in sources:
        mine = [(a, b) for a, b in marks if not source or a.line["case"].split(":")[0] + " with card" * a.line["card"] == source]  # fmt: skip
        lines += ["", f"{source or 'all'}: {len(mine)}"]
        for label, chosen, holds in ROWS:
            own = [(holds(a), holds(b)) for a, b in mine if chosen(a)]
            if own:
                lines.append(_row(label, own))
        for k, word in enumerate(("old", "new")):
            stated = [s for pair in mine for s in pair[k].stated]
            held = [h for pair in mine for h, _ in pair[k].held_out]
            spent = [(pair[k].line["seconds"], pair[k].line["MB"]) for pair in mine]
            lines.append(
                f"  {word}: calibration error {calibration_error(stated):.3f} of {len(stated)}; held-out over floor median"
                f" {np.median(held or [np.nan]):.3f}; {np.median([s for s, _ in spent]):.1f} s, {np.median([m for _, m in spent]):.0f} MB"
            )
    lines += ["", *_posteriors(pairs), *_measured(pairs)]
    if changed:
        lines += [f"{a.line['case']:24} {a.line['truth']['effects']:30} {'right' if a.right else 'wrong'} {said(a.line)} → {'right' if b.right else 'wrong'} {said(b.line)}"
                  for a, b in marks if said(a.line) != said(b.line)]  # fmt: skip
    return "\n".join(lines)


def _pairs(old: list[Line], new: list[Line]) -> list[tuple[Line, Line]]:
    found = {line["case"]: line for line in new if "skipped" not in line}
    return [(line, found[line["case"]]) for line in old if line["case"] in found and "skipped" not in line]


def said(line: Line) -> str:
    """One phrase of an answer."""
    return " ".join([line["verdict"], *(f"{c['effect']}({c['probability']:.2f})" for c in line["causes"])])


def _row(label: str, own: list[tuple[bool, bool]]) -> str:
    cells = []
    for side in zip(*own, strict=True):
        low, high = band(sum(side), len(side))
        cells.append(f"{sum(side):3d}/{len(side):<3d} {100 * sum(side) / len(side):3.0f} % [{100 * low:3.0f}, {100 * high:3.0f}]")  # fmt: skip
    lost, won = sum(a and not b for a, b in own), sum(b and not a for a, b in own)
    worse = lost > won and binomtest(lost, lost + won, alternative="greater").pvalue < 0.05
    return f"  {label:52} {cells[0]}   {cells[1]}   lost {lost} won {won}{'   WORSE' if worse else ''}"


def _posteriors(pairs: list[tuple[Line, Line]]) -> list[str]:
    """Compare the posteriors of `hrg calibrate` in their standard deviations, and its residual with the diagnosis' noise."""
    lines = []
    for a, b in pairs:
        if a.get("posterior") and b.get("posterior"):
            own, other = a["posterior"], b["posterior"]
            moved = {k: abs(own[k][0] - other[k][0]) / max(own[k][1], 1e-300) for k in own if k in other}
            wide = [other[k][1] / own[k][1] for k in own if k in other and own[k][1] > 0]
            worst = max(moved, key=lambda k: moved[k])
            ends = ", ".join(
                f"{r} {response['baseline']['residual_rms'] / b['calibrated'][r][0]:.2f}"
                for r, response in b["responses"].items()
                if r in b["calibrated"]
            )
            lines.append(
                f"{a['case']}: posterior moved at most {moved[worst]:.2f} sd ({worst}), median {np.median(list(moved.values())):.3f}; widths"
                f" {min(wide):.2f} to {max(wide):.2f}; diagnosis' residual over calibration's: {ends}"
            )
    return lines


def _measured(pairs: list[tuple[Line, Line]]) -> list[str]:
    return [f"{a['case']}: {said(a)} → {said(b)}" for a, b in pairs if a["truth"]["kind"] == "measured"]
