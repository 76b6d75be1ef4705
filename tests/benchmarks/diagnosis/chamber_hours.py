"""Chamber hours after which runs that are chosen live tell a hidden cause from its best rival as surely as a fixed set of four runs of 8 h.

`python -m tests.benchmarks.diagnosis.chamber_hours OUT.jsonl --seed 1 --count 20` asks, one line a campaign, and prints the table. Both begin with the
same run; then the live campaign takes what the diagnosis of its records so far proposes, until its evidence (twice the log odds between the
hidden cause and what else is likeliest, or nothing) is that of the fixed set, at most `DECIDED`, or its hours are.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from studies.effects import library
from studies.errors import InputError
from studies.inference import diagnosis
from studies.instrument.card import load_card
from studies.planning.chamber import Chamber, limited
from studies.planning.programme import words_of
from studies.simulation.drive import drive_by_profile, rows_of
from studies.workbench import diagnose_records
from tests.benchmarks.diagnosis.card_cases import CARDS, RATE, hide, run
from thermal.profile import parse_profile

LOW, HIGH, HOURS, CHAMBER = -10.0, 45.0, 8.0, Chamber()
FIXED = [
    limited(words_of(LOW, HIGH, 3600.0 * HOURS)[kind], CHAMBER.rate)
    for kind in ("steps and soaks", "staircase up", "slow cycle", "fast cycles")
]
MEANS, OF_RUN = 240, (60, 120)
"""Block averages of a campaign and of a run: fewer than usual, for many diagnoses."""
SNRS = (0.2, 0.4)
DECIDED = 40.0
"""Evidence from which on no more chamber time is needed."""


def drives(words):
    """Return the drives of runs, one after the other."""
    out, start = [], 0.0
    for one in words:
        profile = parse_profile(one)
        out.append(replace(drive_by_profile(profile, rows_of(profile, RATE)), start=start))
        start += profile.end - profile.start
    return out


def draw(seed):
    """Return a card, the device that hides an effect of the library that no command drives, and its name and response."""
    rng = np.random.default_rng([seed, 8])
    acting = [
        (name, r)
        for name, effect in library().items()
        for r in effect.sizes
        if not effect.needs and not effect.event and not {"run", "moment"} & {p.name for p in effect.shape}
    ]
    card, hidden = load_card(CARDS[int(rng.integers(3))]), acting[int(rng.integers(len(acting)))]
    snr = SNRS[int(rng.integers(2))]
    return card, hide(card, (*hidden, snr), drives(FIXED), seed, rng)[0], *hidden


def evidence(found, name, response):
    """Return by how much, in twice the log odds, a cause is likelier than any other that differs from it, or none; 0 where it is not seen."""
    same, best = {name, *library()[name].equivalents.get(response, ())}, 0.0
    for k, term in enumerate(found.final.terms):
        scores = {h.terms[-1].effect.name: h.score for h in reversed(found.outcome.rivals[k])}
        if term.response == response and name in scores:
            others = [score for other, score in scores.items() if other not in same]
            best = max(best, 2.0 * (scores[name] - max([*others, found.outcome.without[k].score])))
    return best


def campaign(seed):
    """Return the line of one campaign."""
    card, device, name, response = draw(seed)
    fixed = run(device, drives(FIXED), seed)
    for count in (1, 2, 3, 4):
        wanted = round(min(evidence(diagnose_records(fixed[:count], card), name, response), DECIDED), 1)
        if wanted == DECIDED:
            break
    words, steps = FIXED[:1], []
    while wanted > 0.0:
        found = diagnose_records(run(device, drives(words), seed), card, CHAMBER)
        hours = float(sum(drive.time[-1] - drive.time[0] for drive in drives(words))) / 3600.0
        steps.append([round(hours, 2), round(evidence(found, name, response), 1)])
        if steps[-1][1] >= wanted or hours >= len(FIXED) * HOURS - 0.01:
            break
        proposed = found.advice[1]
        if proposed is None:  # nothing is gained, it says: what the fixed set would do
            words = [*words, FIXED[len(words) % len(FIXED)]]
        elif proposed.profile.startswith("repeat of run"):
            words = [*words, words[int(proposed.profile.removeprefix("repeat of run").removesuffix(".csv"))]]
        else:
            words = [*words, proposed.profile]
    hidden = {"seed": seed, "effect": name, "response": response}
    return {**hidden, "fixed": [count * HOURS, wanted], "steps": steps, "runs": words}


def main():
    """Ask what is not asked yet; print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=20)
    given = parser.parse_args()
    diagnosis.BLOCKS, diagnosis.BLOCKS_OF_RUN = MEANS, OF_RUN
    lines = [json.loads(text) for text in given.out.read_text().splitlines()] if given.out.exists() else []
    for seed in range(given.seed, given.seed + given.count):
        if seed not in {line["seed"] for line in lines}:
            try:
                lines.append(campaign(seed))
            except InputError as error:
                lines.append({"seed": seed, "skipped": str(error)})
            with given.out.open("a") as out:
                out.write(json.dumps(lines[-1]) + "\n")
            print(lines[-1], flush=True)
    seen = [line for line in lines if "fixed" in line and line["fixed"][1] > 0.0 and line["fixed"][0] > HOURS]
    parts = [
        line["steps"][-1][0] / line["fixed"][0] if line["steps"][-1][1] >= line["fixed"][1] else np.inf for line in seen
    ]
    print(
        f"{len(lines)} campaigns, {len(seen)} whose cause the fixed set tells after more than its first run; hours of the live choice over those"
        f" of the fixed set: median {np.median(parts):.2f}, at most 0.6 in {sum(part <= 0.6 for part in parts)}, never in {sum(np.isinf(part) for part in parts)}"
    )


if __name__ == "__main__":
    main()
