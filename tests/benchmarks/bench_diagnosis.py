"""Large campaign for the diagnosis: hide effects, aliens or nothing, and count what is said.

    python tests/benchmarks/bench_diagnosis.py cases.jsonl --minutes 5 [--kinds null,effect,alien,pair] [--seed N]
    python tests/benchmarks/bench_diagnosis.py cases.jsonl --report report/diagnosis-benchmark.md

Cases are appended to the file, so that several runs add up; the seed is drawn and printed unless given.
"""

import argparse
import itertools
import json
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.effects import library
from studies.diagnosis.investigate import investigate
from tests.generator.designs import DESIGNS
from tests.generator.device import build
from tests.generator.hidden import ALIENS, EFFECTS, possible
from tests.generator.noises import FAMILIES


def draw_case(kind, count, rng):
    """Draw design, noise, effects, alien and SNR of one case."""
    design = list(DESIGNS)[count % len(DESIGNS)]
    family = FAMILIES[(count // len(DESIGNS)) % len(FAMILIES)]
    names = [name for name in EFFECTS if possible(name, design)]
    if kind == "null":
        return design, family, (), "", 0.0
    if kind in ("effect", "without"):
        name = names[int(rng.integers(len(names)))]
        snr = float((3.0, 1.0, 0.3)[int(rng.integers(3))]) if kind == "effect" else 3.0
        return design, family, (name,), "", snr
    if kind == "alien":
        aliens = [name for name in ALIENS if possible(name, design)]
        return design, family, (), aliens[int(rng.integers(len(aliens)))], 3.0
    pair = ()
    while len({name.split("@")[0] for name in pair}) < 2:
        pair = tuple(rng.choice(names, 2, replace=False).tolist())
    return design, family, pair, "", 3.0


def run_case(kind, count, seed, held_out=True):
    """Build and diagnose one case; return what was hidden and what was said."""
    rng = np.random.default_rng(seed)
    design, family, effects, alien, snr = draw_case(kind, count, rng)
    records, truth = build(design, family, rng, effects, alien, snr)
    hidden = tuple(name.split("@")[0] for name in effects)
    chosen = [e for e in library().values() if kind != "without" or e.name not in hidden]
    begin = time.perf_counter()
    found = investigate(load_campaign(records), effects=chosen, held_out=held_out).verdict
    return {
        "kind": kind,
        "design": design,
        "family": family,
        "truth": hidden,
        "alien": alien,
        "snr": snr,
        "seed": seed,
        "count": count,
        "raw": effects,
        "channel": truth.channel,
        "seconds": time.perf_counter() - begin,
        "verdict": found.verdict,
        "causes": [[c.effect, list(c.equivalent), c.response, c.probability, c.evidence] for c in found.causes],
        "responses": {
            k: [r.verdict, r.noise, r.baseline, r.extended, r.left_over_input, r.left_over_evidence]
            for k, r in found.responses.items()
        },
        "noise": truth.noise,
        "size": {k: v.get("size") for k, v in truth.parameters.items()},
    }


def summarise(cases):
    """Return the report as text."""
    lines = [f"# Diagnosis on the independent generator: {len(cases)} cases", ""]

    def rate(hits, total):
        if not total:
            return "no cases"
        p, z = hits / total, 1.645
        centre = (p + z * z / (2 * total)) / (1 + z * z / total)
        half = z * np.sqrt(p * (1 - p) / total + z * z / (4 * total**2)) / (1 + z * z / total)
        return f"{100 * p:.1f} % ({hits}/{total}; 90 % band {100 * max(centre - half, 0):.1f}-{100 * min(centre + half, 1):.1f})"

    nulls = [c for c in cases if c["kind"] == "null"]
    lines += ["## False alarms (any verdict but adequate)", ""]
    for family in FAMILIES:
        mine = [c for c in nulls if c["family"] == family]
        lines.append(f"- {family}: {rate(sum(c['verdict'] != 'adequate' for c in mine), len(mine))}")
    lines += ["", "## Right class (truth in the strongest set) and exact answers", ""]
    singles = [c for c in cases if c["kind"] == "effect"]
    for snr in (3.0, 1.0, 0.3):
        mine = [c for c in singles if c["snr"] == snr]
        lines.append(
            f"- SNR {snr:g}: {rate(sum(first_right(c) for c in mine), len(mine))}; "
            f"nothing named {rate(sum(not c['causes'] for c in mine), len(mine))}; "
            f"unexplained {rate(sum(c['verdict'] == 'unexplained' for c in mine), len(mine))}; "
            f"more than one cause {rate(sum(len(c['causes']) > 1 for c in mine), len(mine))}"
        )
    lines += ["", "| effect | SNR 3 | 1 | 0.3 | mistaken for (SNR 1 and 3) |", "| --- | --- | --- | --- | --- |"]
    for name in sorted({c["truth"][0] for c in singles}):
        row = []
        for snr in (3.0, 1.0, 0.3):
            mine = [c for c in singles if c["truth"][0] == name and c["snr"] == snr]
            row.append(f"{sum(map(first_right, mine))}/{len(mine)}")
        wrong = {}
        for c in singles:
            if c["truth"][0] == name and c["snr"] >= 1 and not first_right(c):
                said = (
                    c["causes"][0][0]
                    if c["causes"]
                    else ("unexplained" if c["verdict"] == "unexplained" else "nothing")
                )
                wrong[said] = wrong.get(said, 0) + 1
        lines.append(f"| {name} | {' | '.join(row)} | {', '.join(f'{k} {v}' for k, v in sorted(wrong.items()))} |")
    lines += ["", "## Held-out residual over the noise (right name)", ""]
    for snr in (3.0, 1.0, 0.3):
        ratios = [r for c in singles if c["snr"] == snr and first_right(c) and (r := floor_ratio(c)) is not None]
        if ratios:
            lines.append(
                f"- SNR {snr:g}: median {np.median(ratios):.3f}, within 10 % {rate(int(sum(r < 1.1 for r in ratios)), len(ratios))}, "
                f"within 5 % {rate(int(sum(r < 1.05 for r in ratios)), len(ratios))}"
            )
    lines += ["", "## Aliens at SNR 3", ""]
    for kind in ("alien", "without"):
        mine = [c for c in cases if c["kind"] == kind]
        lines.append(
            f"- {kind}: unexplained {rate(sum(c['verdict'] == 'unexplained' for c in mine), len(mine))}; "
            f"wrong name alone {rate(sum(bool(c['causes']) and c['verdict'] != 'unexplained' for c in mine), len(mine))}"
        )
        for name in sorted({c["alien"] or c["truth"][0] for c in mine}):
            of = [c for c in mine if (c["alien"] or c["truth"][0]) == name]
            said = {}
            for c in of:
                word = (
                    "unexplained"
                    if c["verdict"] == "unexplained"
                    else (c["causes"][0][0] if c["causes"] else "nothing")
                )
                said[word] = said.get(word, 0) + 1
            lines.append(f"  - {name}: {', '.join(f'{k} {v}' for k, v in sorted(said.items()))}")
    pairs = [c for c in cases if c["kind"] == "pair"]
    lines += [
        "",
        "## Two effects at SNR 3",
        "",
        f"- exact set: {rate(sum(map(exact_set, pairs)), len(pairs))}; "
        f"both found: {rate(sum(all(any(t in [x[0], *x[1]] for x in c['causes']) for t in c['truth']) for c in pairs), len(pairs))}",
    ]
    lines += ["", "## Reliability of the stated probability", ""]
    claims = [
        (x[3], any(t in [x[0], *x[1]] for t in c["truth"]))
        for c in cases
        if c["kind"] in ("effect", "pair", "null", "alien")
        for x in c["causes"]
    ]
    error = 0.0
    for low, high in itertools.pairwise([0.0, 0.3, 0.6, 0.8, 0.9, 0.96, 1.001]):
        inside = [hit for p, hit in claims if low <= p < high]
        mean = np.mean([p for p, _ in claims if low <= p < high]) if inside else 0.0
        if inside:
            error += len(inside) / len(claims) * abs(mean - np.mean(inside))
            lines.append(
                f"- claimed {low:.2f}-{min(high, 1):.2f}: mean {mean:.3f}, right {rate(int(sum(inside)), len(inside))}"
            )
    lines += [
        f"- calibration error {error:.3f} on {len(claims)} claims",
        "",
        f"Median time {np.median([c['seconds'] for c in cases]):.2f} s, longest {max(c['seconds'] for c in cases):.2f} s.",
    ]
    return "\n".join(lines) + "\n"


def first_right(case):
    """The truth is in the strongest cause's set."""
    return bool(case["causes"]) and case["truth"][0] in [case["causes"][0][0], *case["causes"][0][1]]


def exact_set(case):
    """As many causes as hidden, each holding one of them."""
    left = list(case["truth"])
    for effect, equivalent, *_ in case["causes"]:
        hit = next((t for t in left if t in [effect, *equivalent]), None)
        if hit is None:
            return False
        left.remove(hit)
    return not left


def floor_ratio(case):
    """Held-out residual of the extended model over the true noise, in the channel of the effect."""
    result = case["responses"].get(case["channel"])
    if result is None or result[3] is None or result[3][1] is None:
        return None
    return result[3][1] / result[1]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", type=Path)
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--kinds", default="null,effect,effect,effect,alien,without,pair")
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--names-only", action="store_true", help="leave out the held-out residuals")
    parser.add_argument("--report", type=Path)
    arguments = parser.parse_args()
    if arguments.report is None:
        seed = int(np.random.SeedSequence().entropy % 2**31) if arguments.seed is None else arguments.seed
        print("seed", seed)
        end = time.time() + 60 * arguments.minutes
        kinds = arguments.kinds.split(",")
        with arguments.cases.open("a") as file:
            for count in itertools.count(seed % 1000):
                if time.time() > end:
                    break
                case = run_case(kinds[count % len(kinds)], count // len(kinds), seed + count, not arguments.names_only)
                file.write(json.dumps(case, default=float) + "\n")
                file.flush()
    cases = [json.loads(line) for line in arguments.cases.read_text().splitlines()]
    text = summarise(cases)
    if arguments.report:
        arguments.report.parent.mkdir(parents=True, exist_ok=True)
        arguments.report.write_text(text)
    print(text)


if __name__ == "__main__":
    main()
