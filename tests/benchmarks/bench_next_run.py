"""Is the suggested run worth its chamber hours? One 8 h run with a hidden effect, then one or two runs more.

    python tests/benchmarks/bench_next_run.py cases.jsonl --minutes 10 [--snr 0.25] [--noise walk,flicker] [--seed N]
    python tests/benchmarks/bench_next_run.py cases.jsonl --report report/next-run-benchmark.md

The further runs of the same gyro are those that the diagnosis suggests, repeats of the first one, random ones of the same
family with drives stepped at random, or all of the family. The SNR is that of the effect in the first run alone; effects
of a drive are hidden only where that drive steps. A suggestion of no run leaves the answer as it was.
"""

import argparse
import copy
import itertools
import json
import sys
import time
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.investigate import investigate
from studies.diagnosis.planning.programme import DRIVES, candidates
from studies.effects import find_effect
from tests.generator.designs import cycle, paper_step, ramps, schedule, stairs, up_stairs, wander
from tests.generator.device import add_run, build
from tests.generator.hidden import EFFECTS
from tests.generator.noises import FAMILIES
from tests.generator.thermal_twin import STEP
from thermal.profile import parse_profile

STARTS = (stairs, ramps, cycle, wander, up_stairs, lambda: paper_step(-10))
VOLTS = schedule([80, 80, 110, 80, 60, 100, 80, 120], 1.0)
AMPLITUDES = schedule([1.0, 1.3, 0.8, 1.2, 1.0, 0.7], 1.3)
ARMS = {"suggested": 2, "repeat": 1, "random": 1}
"""Further runs of each arm."""
EFFECTS_OF_A_DRIVE = {"electrostatic-softening": "volts", "amplitude-frequency": "drives", "self-heating": "drives"}


def first_run(rng):
    """Draw chamber programme and drives of the first run, and an effect that it can show."""
    plan = {
        "chambers": [STARTS[int(rng.integers(len(STARTS)))]()],
        "volts": [VOLTS if rng.random() < 0.5 else None],
        "drives": [AMPLITUDES if rng.random() < 0.5 else None],
        "angles": None,
        "gaps": [0.0],
    }
    possible = [
        name
        for name in EFFECTS
        if name != "axis-rotation" and (name not in EFFECTS_OF_A_DRIVE or plan[EFFECTS_OF_A_DRIVE[name]][0] is not None)
    ]
    return plan, possible[int(rng.integers(len(possible)))]


def answer(records):
    """Diagnose; return the strongest set, the verdict, and the suggestion."""
    campaign = load_campaign(records)
    verdict = investigate(campaign, score_held_out=False).verdict
    cause = verdict.causes[0] if verdict.causes else None
    said = [] if cause is None else [cause.effect, *cause.equivalent]
    return campaign, {"said": said, "verdict": verdict.verdict, "evidence": cause and cause.evidence}, verdict.next_run


def run_of(twin, profile, drives, rng, plan):
    """Record the run that a profile and stepped drives describe."""
    if profile.startswith("repeat"):
        return add_run(twin, plan["chambers"][0], rng, plan["volts"][0], plan["drives"][0])
    words = parse_profile(profile)
    grid = np.arange(0.0, words.end, STEP)
    chamber = words.at(grid) - 273.15

    def steps(column):
        if column not in drives:
            return None
        levels = np.array(drives[column].levels)
        return levels[np.minimum((grid / 60.0 / drives[column].hold_min).astype(int), levels.size - 1)]

    return add_run(twin, chamber, rng, steps("electrode_bias_V"), steps("drive_amplitude_V"))


def run_case(seed, snr, families=FAMILIES, with_all=True):
    """Build one case and continue it by every arm; return what was hidden and what was said."""
    rng = np.random.default_rng(seed)
    plan, name = first_run(rng)
    family = families[int(rng.integers(len(families)))]
    first, truth = build(plan, family, np.random.default_rng(seed + 1), (name,), "", snr)
    campaign, before, suggestion = answer(first)
    case = {"seed": seed, "snr": snr, "effect": name, "family": family, "before": before, "after": {}, "profiles": {}}
    for place, (arm, runs) in enumerate(ARMS.items()):
        records, twin = list(first), copy.copy(truth.twin)
        chance = np.random.default_rng(seed + 2)
        now, next_run, known = before, suggestion, campaign
        case["after"][arm], case["profiles"][arm] = [], []
        for number in range(runs):
            profile, drives = "repeat", {}
            if arm == "suggested":
                profile, drives = (next_run.profile, next_run.drives) if next_run else (None, {})
            elif arm == "random":
                pool = candidates(known, [drive for drive in DRIVES if chance.random() < 0.5])
                pick = pool[int(chance.integers(len(pool)))]
                profile, drives = pick.profile, pick.drives
            case["profiles"][arm].append(profile)
            if profile is not None:
                stream = np.random.default_rng([seed, number, place])
                records.append(run_of(twin, profile, drives, stream, plan))
                known, now, next_run = answer(records)
            case["after"][arm].append(now)
    if with_all:
        records, twin = list(first), copy.copy(truth.twin)
        for number, programme in enumerate(candidates(campaign, tuple(DRIVES))):
            stream = np.random.default_rng([seed, number, 99])
            records.append(run_of(twin, programme.profile, programme.drives, stream, plan))
        case["after"]["all"] = [answer(records)[1]]
        case["profiles"]["all"] = [len(records) - 1]
    return case


def right(case, said):
    """The hidden effect is in the strongest set."""
    return case["effect"].split("@")[0] in said["said"]


def alone(case, said):
    """The strongest set is the hidden effect and what no record can separate from it."""
    name = case["effect"].split("@")[0]
    exact = {name, *itertools.chain.from_iterable((find_effect(name).equivalents or {}).values())}
    return right(case, said) and set(said["said"]) <= exact


def paired(cases, arm, holds):
    """How many cases only the suggestion answers, and how many only the other arm, after one run each."""
    pairs = [(holds(c, c["after"]["suggested"][0]), holds(c, c["after"][arm][0])) for c in cases]
    return sum(a and not b for a, b in pairs), sum(b and not a for a, b in pairs)


def rate(hits, total):
    """Percentage with a 90 % band (Wilson)."""
    if not total:
        return "no cases"
    p, z = hits / total, 1.645
    centre = (p + z * z / (2 * total)) / (1 + z * z / total)
    half = z * np.sqrt(p * (1 - p) / total + z * z / (4 * total**2)) / (1 + z * z / total)
    return f"{100 * p:.0f} % ({hits}/{total}; {100 * max(centre - half, 0):.0f}-{100 * min(centre + half, 1):.0f})"


def summarise(cases):
    """Return the report as text."""
    lines = ["# The suggested next run on the independent generator", ""]
    for snr in sorted({c["snr"] for c in cases}, reverse=True):
        mine = [c for c in cases if c["snr"] == snr]
        lines += [
            f"## SNR {snr:g} in the first run, {len(mine)} cases (90 % bands)",
            "",
            "| further runs | right class | nothing else in the set | unexplained | nothing named |",
            "| --- | --- | --- | --- | --- |",
        ]
        columns = [("none", lambda c: c["before"])]
        for arm, runs in ARMS.items():
            columns += [(f"{k + 1} {arm}", lambda c, arm=arm, k=k: c["after"][arm][k]) for k in range(runs)]
        columns.append(("all of the family", lambda c: c["after"].get("all", [None])[0]))
        for title, pick in columns:
            said = [(c, pick(c)) for c in mine if pick(c) is not None]
            lines.append(
                f"| {title} | {rate(sum(right(c, s) for c, s in said), len(said))} "
                f"| {rate(sum(alone(c, s) for c, s in said), len(said))} "
                f"| {sum(s['verdict'] == 'unexplained' for _, s in said)} "
                f"| {sum(not s['said'] for _, s in said)} |"
            )
        lines.append("")
        for arm in ("repeat", "random"):
            for word, holds in (("right", right), ("right with nothing else in the set", alone)):
                better, worse = paired(mine, arm, holds)
                chance = binomtest(better, better + worse).pvalue if better + worse else 1.0
                lines.append(
                    f"- One suggested run against one {arm}: {word} only after the suggestion {better}, only after the "
                    f"{arm} {worse} times (sign test p = {chance:.2g})."
                )
        asked = [p for c in mine for p in c["profiles"]["suggested"]]
        lines += ["", f"No run suggested: {asked.count(None)} of {len(asked)} times.", ""]
        lines += ["| effect | none | 1 suggested | 2 suggested | 1 repeat | 1 random | all |", "| --- " * 7 + "|"]
        for name in sorted({c["effect"] for c in mine}):
            of = [c for c in mine if c["effect"] == name]
            row = [sum(right(c, c["before"]) for c in of)]
            for arm, k in (("suggested", 0), ("suggested", -1), ("repeat", 0), ("random", 0), ("all", 0)):
                row.append(sum(right(c, c["after"][arm][k]) for c in of if arm in c["after"]))
            lines.append(f"| {name} ({len(of)}) | {' | '.join(map(str, row))} |")
        lines.append("")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", type=Path)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--snr", type=float, default=0.25)
    parser.add_argument("--noise", default=",".join(FAMILIES), help="families of noise that are drawn")
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--report", type=Path)
    parser.add_argument("--all-every", type=int, default=4, help="run the whole family in one case of so many")
    arguments = parser.parse_args()
    if arguments.report is None:
        seed = int(np.random.SeedSequence().entropy % 2**31) if arguments.seed is None else arguments.seed
        print("seed", seed)
        end = time.time() + 60 * arguments.minutes
        with arguments.cases.open("a") as file:
            for count in itertools.count():
                if time.time() > end:
                    break
                case = run_case(
                    seed + 10 * count, arguments.snr, arguments.noise.split(","), count % arguments.all_every == 0
                )
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
