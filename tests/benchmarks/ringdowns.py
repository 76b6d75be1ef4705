"""`hrg fit ringdown` on decays of an independent generator: coverage, efficiency, and intervals that miss in silence.

    python tests/benchmarks/ringdowns.py OUT.jsonl --kinds SPOILT --count 1000 --seed 1     # resumable: a line for each decay
    python tests/benchmarks/ringdowns.py OUT.jsonl                                          # the tables

An interval misses when the truth is outside; by far, when the truth is outside an interval of twice the width (of an exact 90 %
interval 1 in 1 000). It misses in silence when the answer has no remark. Where the frequency drifts, any value that it took is true;
where it depends on amplitude, that of small amplitude.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import tempfile
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from tests.benchmarks.hands.decays import SPOILT, WELL, Decay, make

PAIRS = {"frequency_1_Hz": "f2_Hz", "frequency_2_Hz": "f1_Hz", "frequency_Hz": "mean_Hz", "split_Hz": "split_Hz",
         "frequency_axis_deg": "stiff_axis_deg", "q_1": "q2", "q_2": "q1", "inverse_q": "inverse_q",
         "damping_axis_deg": "lossy_axis_deg"}  # fmt: skip
AXIS = 90.0  # an azimuth of an n = 2 axis repeats


def ask(decay: Decay, folder: Path) -> dict[str, object]:
    from studies.cli import main

    path, out = decay.write(folder / "decay.csv"), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()) as said:
        try:
            status = main(["fit", "ringdown", str(path), "--json"])
        except SystemExit as end:
            status = end.code
    assert status in (0, 2), said.getvalue()  # a fault is no refusal
    return json.loads(out.getvalue())["decays"][0] if not status else {"refused": said.getvalue()}


def row(decay: Decay, answer: dict, took: float) -> dict[str, object]:
    """Error, half width and bound of every stated interval, in half widths."""
    judged = {}
    for e in answer.get("estimates", []):
        if e["name"] not in PAIRS or e["low"] is None:
            continue
        truth, sd = decay.truth[PAIRS[e["name"]]], decay.bound.get(PAIRS[e["name"]])
        low, high, value = (e[k] - truth for k in ("low", "high", "value"))
        if e["name"].endswith("_deg"):
            low, high, value = (x - AXIS * round(value / AXIS) for x in (low, high, value))
        if e["name"].startswith("frequency") and e["name"].endswith("_Hz") and decay.kind == "drift":
            inside = np.clip(value, decay.story["wander_low"], decay.story["wander_high"])
            low, high, value = low - inside, high - inside, value - inside
        judged[e["name"]] = {"low": low, "high": high, "error": value, "bound": sd}
    return {"judged": judged, "remarks": answer.get("remarks", []), "refused": answer.get("refused"), "seconds": took,
            "story": {k: v if isinstance(v, str) else float(v) for k, v in decay.story.items()}}  # fmt: skip


def misses(e: dict, times: float) -> bool:
    middle, half = (e["low"] + e["high"]) / 2, times * (e["high"] - e["low"]) / 2
    return abs(middle) > half


def percent(hits: Iterable[bool]) -> str:
    every = list(hits)
    return f"{100 * sum(every) / max(len(every), 1):7.1f}%"


def tables(rows: list[dict]) -> Iterator[str]:
    yield f"{'':10} {'':4} {'':>8} {'':>8} | of the intervals {'':14} | of the decays, in silence"
    yield (
        f"{'kind':10} {'n':>4} {'refused':>8} {'remark':>8} |{'miss':>8} {'silent':>8} {'by far':>8} {'silent':>8} |"
        f" {'one':>8} {'by far':>8} |  s"
    )
    groups = {k: [r for r in rows if r["kind"] == k] for k in (*WELL, *SPOILT)}
    for kind, some in (groups | {"spoilt": [r for r in rows if r["kind"] in SPOILT]}).items():
        near, far = ([[misses(e, times) for e in r["judged"].values()] for r in some] for times in (1, 2))
        mute = [not r["remarks"] for r in some]
        cells = [percent(bool(r[key]) for r in some) for key in ("refused", "remarks")]
        inside = [percent(m and (q or not silent) for ms, q in zip(kind_, mute, strict=True) for m in ms)
                  for kind_ in (near, far) for silent in (False, True)]  # fmt: skip
        whole = [percent(q and any(ms) for ms, q in zip(kind_, mute, strict=True)) for kind_ in (near, far)]
        if some:
            seconds = np.median([r["seconds"] for r in some])
            yield f"{kind:10} {len(some):4d} {' '.join(cells)} |{' '.join(inside)} |{' '.join(whole)} | {seconds:.2f}"
    for kind in WELL:
        some = groups[kind]
        if some:
            yield f"\n{kind}: coverage (%), rms error over the Cramér–Rao bound, largest error; axes where they are said to be determined"
        for name in PAIRS if some else ():
            known = [
                e
                for r in some
                if (e := r["judged"].get(name)) and (e["high"] - e["low"] < 0.98 * AXIS or "_deg" not in name)
            ]
            ratio = np.array([e["error"] / e["bound"] for e in known])
            yield (
                f"  {name:20} n {len(known):4d}  {100 * np.mean([not misses(e, 1) for e in known]):5.1f}  "
                f"{np.sqrt(np.mean(ratio**2)):6.3f} (median |.| x 1.483: {1.483 * np.median(abs(ratio)):.3f})  {max(abs(e['error']) for e in known):.3g}"
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--kinds", nargs="*", default=list(SPOILT), help="kinds of decay, WELL or SPOILT")
    parser.add_argument("--count", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    kinds = [k for name in given.kinds for k in {"WELL": WELL, "SPOILT": SPOILT}.get(name, (name,))]
    rows = [json.loads(line) for line in given.out.read_text().splitlines()] if given.out.exists() else []
    done = {(r["kind"], r["seed"], r["index"]) for r in rows}
    with tempfile.TemporaryDirectory() as folder, given.out.open("a") as store:
        for number in range(given.count):
            key = kinds[number % len(kinds)], given.seed, number // len(kinds)
            if key in done:
                continue
            decay, start = make(*key), time.monotonic()
            answer = ask(decay, Path(folder))
            rows.append(
                {"kind": key[0], "seed": key[1], "index": key[2], **row(decay, answer, time.monotonic() - start)}
            )
            print(json.dumps(rows[-1]), file=store, flush=True)
    print("\n".join(tables(rows)))


if __name__ == "__main__":
    main()
