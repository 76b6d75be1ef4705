"""`python -m tests.stranger.score FOLDER [--jobs 1] [--card]`: ask `hrg diagnose --json` about every campaign, and mark.

Judged by the contract of the answer alone. Answers are kept beside the campaign (`answer.json`); `--again` asks anew.

right        verdict among the true ones; each hidden cause within {effect} ∪ equivalent of a named one; nothing else named
first        the strongest named cause is a hidden one, whatever the verdict
false alarm  a null that is not `adequate`, or for which a cause is named
calibration  probability of a named cause against how often its set holds a hidden cause; aliens hold none
held-out     held-out rms of the model that is kept over the rms of the true noise, once with offset and initial state of each run taken out of it,
             once with what the contract refits in that response: bias and 1/Q have no initial state
ideal        the latter of a predictor that knows the form of what is hidden and the noise's covariance (`ideal.py`)
"""

import argparse
import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

BANDS = ((0.0, 0.65), (0.65, 2.0), (2.0, 4.5), (4.5, 9.0), (9.0, 99.0))
REACH_SD = 4.24
"""Standard deviations from which on an ideal detector, which knows noise and form, could name a cause: a log likelihood ratio
of d²/2 = 9, for a prior of one name of some thirty in fifty and a margin."""
ASK = "import sys; from studies.cli import main; sys.exit(main(sys.argv[1:]))"


@dataclass(frozen=True)
class Mark:
    name: str
    kind: str
    effects: str
    snr: float
    runs: int
    verdict: str
    right: bool
    first: bool
    every: bool  # every hidden cause is in some named set
    stray: int  # named causes that are not there
    stated: tuple[tuple[float, bool], ...]
    held_out: tuple[tuple[float, float, float], ...]
    reach: float  # of the least visible hidden cause, in standard deviations of noise along it


def ask(folder: Path, card: bool, again: bool) -> dict:
    kept = folder / ("answer-card.json" if card else "answer.json")
    if again or not kept.exists():
        files = json.loads((folder / "truth.json").read_text())["files"]
        words = [
            "diagnose",
            *(str(folder / f) for f in files),
            "--json",
            *(["--card", str(folder / "card.toml")] if card else []),
        ]
        done = subprocess.run([sys.executable, "-c", ASK, *words], capture_output=True, text=True, check=False)
        answer = {"exit": done.returncode, "error": done.stderr[-2000:]}
        if done.returncode == 0:
            answer = json.loads(done.stdout)
        kept.write_text(json.dumps(answer))
    return json.loads(kept.read_text())


def mark(folder: Path, answer: dict) -> Mark:
    truth = json.loads((folder / "truth.json").read_text())
    ideal = json.loads(kept.read_text()) if (kept := folder / "ideal.json").exists() else {}
    kind, hidden = truth["kind"], truth["hidden"]
    causes = [c for c in answer.get("causes", []) if c.get("kind", "physics") != "value"]
    sets = [{c["effect"], *c.get("equivalent", [])} for c in causes]
    right_names = [set() if kind == "alien" else set(h["right_names"]) for h in hidden]
    known = set().union(*right_names, truth["tolerated"])
    every = all(any(names & s for s in sets) for names in right_names) if kind in ("effect", "pair") else True
    hits = [bool(s & known) for s in sets]
    verdict = answer.get("verdict", "failed")
    right = verdict in truth["verdicts"]
    if kind == "null":
        right = right and not causes
    elif kind != "alien" and verdict != "adequate":
        right = right and every and all(hits)
    held = []
    for name, response in answer.get("responses", {}).items():
        model = response.get("extended") or response["baseline"]
        if model.get("held_out_rms") and name in truth["floor"] and kind != "alien":
            rms = model["held_out_rms"]
            held.append((rms / truth["floor"][name], rms / truth["own_floor"][name], ideal.get(name, np.nan)))
    return Mark(
        folder.name, kind, "+".join(h["effect"] for h in hidden) or "-", min((h["snr"] for h in hidden), default=0.0),
        len(truth["files"]), verdict, right, bool(hits and hits[0]), every, len(hits) - sum(hits),
        tuple((c["probability"], hit) for c, hit in zip(causes, hits, strict=True)), tuple(held),
        min((h["detectability"] for h in hidden), default=0.0),
    )  # fmt: skip


def wilson(hits: int, count: int, z: float = 1.645) -> tuple[float, float]:
    """90 % interval of a share."""
    if not count:
        return 0.0, 1.0
    p, w = hits / count, 1 + z * z / count
    half = z * np.sqrt(p * (1 - p) / count + z * z / (4 * count**2)) / w
    return max(0.0, (p + z * z / (2 * count)) / w - half), min(1.0, (p + z * z / (2 * count)) / w + half)


def calibration_error(stated: list[tuple[float, bool]]) -> float:
    """Expected calibration error over ten equal bins of the stated probability."""
    if not stated:
        return 0.0
    p, hit = np.array([s[0] for s in stated]), np.array([s[1] for s in stated], float)
    box = np.minimum((p * 10).astype(int), 9)
    return float(sum(abs(np.sum(hit[box == b] - p[box == b])) for b in range(10)) / len(p))


def table(marks: list[Mark]) -> str:
    lines: list[str] = []

    def row(label: str, values: list[bool]) -> None:
        low, high = wilson(sum(values), len(values))
        share = (
            f"{100 * sum(values) / len(values):5.1f} %  [{100 * low:5.1f}, {100 * high:5.1f}]" if values else "    –"
        )
        lines.append(f"{label:52} {sum(values):4d} / {len(values):4d}  {share}")

    known = [m for m in marks if m.kind == "effect"]
    pairs = [m for m in marks if m.kind == "pair"]
    aliens = [m for m in marks if m.kind == "alien"]
    for low, high in BANDS:
        band = [m for m in known if low <= m.snr < high]
        row(f"one effect, SNR {low:g}–{high:g}: right class", [m.right for m in band])
        row("    strongest name right", [m.first for m in band])
        row("    called unexplained", [m.verdict == "unexplained" for m in band])
        seen = [m for m in band if m.reach > REACH_SD]
        if len(seen) < len(band):
            row(f"    of {len(seen)} that an ideal detector could name: right", [m.right for m in seen])
    row("one effect, SNR ≥ 2: right class", [m.right for m in known if m.snr >= 2])
    row("    strongest name right", [m.first for m in known if m.snr >= 2])
    row("    in some named set", [m.every for m in known if m.snr >= 2])
    row("    something named that is not there", [m.stray > 0 for m in known if m.snr >= 2])
    for label, counts in (("1", (1,)), ("2", (2,)), ("3 to 6", (3, 4, 5, 6))):
        row(f"    of {label} runs: right class", [m.right for m in known if m.snr >= 2 and m.runs in counts])
    row("known effects called unexplained, any SNR", [m.verdict == "unexplained" for m in known])
    row("false alarms in nulls", [not m.right for m in marks if m.kind == "null"])
    row("aliens called unexplained", [m.right for m in aliens])
    row("aliens with a name at 0.5 or more", [any(p >= 0.5 for p, _ in m.stated) for m in aliens])
    row("pairs: both named", [m.every for m in pairs])
    row("pairs: right class", [m.right for m in pairs])
    held, own, ideal = ([h[k] for m in marks for h in m.held_out] for k in (0, 1, 2))
    row("held-out within 10 % of the floor", [h <= 1.1 for h in held])
    row("    of the floor of what each response refits", [h <= 1.1 for h in own])
    row("    an ideal predictor, of the same", [h <= 1.1 for h in ideal if np.isfinite(h)])
    row(
        "    of those where an ideal predictor is",
        [h <= 1.1 for h, best in zip(own, ideal, strict=True) if best <= 1.1],
    )
    row("commands that failed", [m.verdict == "failed" for m in marks])
    stated = [s for m in marks for s in m.stated]
    lines.append(
        f"expected calibration error                   {calibration_error(stated):.3f} of {len(stated)} stated probabilities"
    )
    lines += [
        f"    stated {b / 10:.1f}–{(b + 1) / 10:.1f}: {np.mean([p for p, _ in own]):.2f} stated, {np.mean([h for _, h in own]):.2f} right, of {len(own)}"
        for b in range(10)
        if (own := [s for s in stated if min(int(s[0] * 10), 9) == b])
    ]
    if held:
        lines.append(
            f"held-out over floor                          median {np.median(held):.3f}, 90th percentile {np.quantile(held, 0.9):.3f}"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--card", action="store_true", help="give the card to the diagnosis")
    parser.add_argument("--again", action="store_true", help="ask again where an answer is kept")
    parser.add_argument("--list", action="store_true", help="one line per campaign before the table")
    given = parser.parse_args()
    folders = sorted(p.parent for p in given.folder.glob("*/truth.json"))
    with ThreadPoolExecutor(given.jobs) as pool:
        marks = list(pool.map(lambda f: mark(f, ask(f, given.card, given.again)), folders))
    if given.list:
        for m in marks:
            named = "right" if m.right else "WRONG"
            print(
                f"{m.name} {m.kind:6} {m.effects:40} SNR {m.snr:5.2f}, {m.runs} runs: {m.verdict:16} {named} {m.stray} stray"
            )
    print(table(marks))


if __name__ == "__main__":
    main()
