"""Is the confusion that `--plan` predicts the one that is measured?

The plan sees the temperatures and drives of a design, through the record of one gyro that hides nothing. Its slow noise has
a random kind and strength, and its hidden effects have the library's own forms. The cases have other gyros, the generator's
forms, and its five families of noise in turn: to the white one belongs the plan's prediction for white noise, to walk, flicker
and correlated that for slow noise. Gross outliers count in the noise of a case but are left out by the diagnosis: these cases
are planned with white noise at the SNR that the other rows have.

Cells hold few cases, so they are pooled: by effect and SNR, by design and SNR, by design and effect. To each case belongs
the prediction for its own design, effect and SNR. If the prediction is right, the count of an answer in a pool is a sum of
unequal coins; its 90 % band is simulated, the prediction's own finite draws included. What the differences hold beyond
chance is the rms error of the prediction: the mean square less the variance that chance gives.
"""

import json
from collections import defaultdict
from typing import NamedTuple

import numpy as np
from scipy.stats import spearmanr

from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.planning.plan import predict
from studies.diagnosis.planning.rehearsal import NOTHING
from tests.benchmarks.diagnosis.cases import current_commit, read_cases
from tests.benchmarks.diagnosis.scoring import UNEXPLAINED, of_kind, said
from tests.generator.device import build

FEWEST = 12
WITHIN, CERTAIN = 0.10, 0.05
DRAWS = 2000
OUTLIERS = float(np.sqrt(1.0 + 0.004 * 25.0**2))
"""rms of the noise with the generator's outliers, 0.4 % of the rows with 25 times the spread, over that of the other rows."""
NAMED, WRONG = "named", "wrong"
OUTCOMES = (NAMED, NOTHING, UNEXPLAINED, WRONG)
POOLS = {
    "effect": lambda c: c["raw"][0],
    "effect and SNR": lambda c: f"{c['raw'][0]}, SNR {c['snr']:g}",
    "design and SNR": lambda c: f"{c['design']}, SNR {c['snr']:g}",
    "design and effect": lambda c: f"{c['design']}, {c['raw'][0]}",
}


class Entry(NamedTuple):
    """One answer in one pool: predicted and measured share, cases, 90 % band and spread of the share if predicted right."""

    pool: str
    said: str
    predicted: float
    measured: float
    cases: int
    low: float
    high: float
    spread: float

    @property
    def near(self):
        """Within ten points."""
        return abs(self.predicted - self.measured) <= WITHIN

    @property
    def beyond(self):
        """Outside of what chance allows in nine of ten counts."""
        return not self.low <= self.measured <= self.high


def predictions_file(path):
    """Where the predictions for a file of cases are kept."""
    return path.with_suffix(".plan.json")


def check_plan(path, draws):
    """Predict every design and SNR of the cases in a file; keep the predictions beside it; return the comparison."""
    cases = planned_cases(read_cases(path))
    out = {"commit": current_commit(), "draws": draws, "plans": {}}
    for design in sorted({c["design"] for c in cases}):
        records, _ = build(design, "white", np.random.default_rng(20))
        campaign = load_campaign(records)
        snrs = sorted({effective_snr(c) for c in cases if c["design"] == design})
        for plan in predict(campaign, snrs, draws, np.random.default_rng(21)).plans:
            out["plans"][f"{design} {plan.snr:g}"] = plan.as_dict()
    predictions_file(path).write_text(json.dumps(out, indent=1))
    return compare_in_words(cases, out["plans"])


def read_predictions(path):
    """Return the predictions kept beside a file of cases, or None."""
    target = predictions_file(path)
    return json.loads(target.read_text()) if target.exists() else None


def planned_cases(cases):
    """The cases that a plan speaks of: one effect, no alien."""
    return of_kind(cases, "effect") + of_kind(cases, "faint")


def plan_key(raw, channel):
    """The name that a plan gives an effect of the generator."""
    name, _, elsewhere = raw.partition("@")
    return f"{name} ({channel})" if elsewhere else name


def plan_of(case):
    """Which plan speaks of a case."""
    return f"{case['design']} {effective_snr(case):g}"


def effective_snr(case):
    """SNR against the noise of the rows that are no gross outliers."""
    return case["snr"] * (OUTLIERS if case["family"] == "outliers" else 1.0)


def expected(case, plans):
    """Return said -> probability for one case; said is the truth where the answer holds it."""
    key = plan_key(case["raw"][0], case["channel"])
    noise = "white" if case["family"] in ("white", "outliers") else "slow"
    return plans[plan_of(case)]["by_noise"][noise].get(key, {NOTHING: 1.0})


def outcome(truth, word):
    """Return which of the four outcomes an answer is."""
    return NAMED if word == truth else word if word in (NOTHING, UNEXPLAINED) else WRONG


def compare(cases, plans, pool=POOLS["effect"], outcomes=False, rng=None):
    """Return the entries of every pool: its answers, or with `outcomes` the four outcomes only."""
    rng = np.random.default_rng(0) if rng is None else rng
    groups = defaultdict(list)
    for case in cases:
        groups[pool(case)].append(case)
    entries = []
    for name, mine in sorted(groups.items()):
        predicted, answers = [], []
        for case in mine:
            truth, own = case["truth"][0], defaultdict(float)
            for word, share in expected(case, plans).items():
                own[outcome(truth, word) if outcomes else word] += share
            predicted.append(own)
            answers.append(outcome(truth, said(case)) if outcomes else said(case))
        words = OUTCOMES if outcomes else sorted({*answers, *(w for own in predicted for w in own)})
        keys = np.unique([f"{plan_of(c)} {c['family']} {c['raw'][0]}" for c in mine], return_inverse=True)[1]
        draws = np.array([plans[plan_of(c)]["cases"] / 2 for c in mine], dtype=float)
        for word in words:
            p = np.array([own[word] for own in predicted])
            shares = simulated_shares(p, draws, keys, rng)
            low, high = np.quantile(shares, [0.05, 0.95])
            measured = answers.count(word) / len(mine)
            entries.append(Entry(name, word, float(p.mean()), measured, len(mine), low, high, float(shares.std())))
    return entries


def simulated_shares(p, draws, keys, rng):
    """Return what share would be counted, many times over, were the probabilities right within their own finite draws.

    Cases with the same key share one prediction, and so its error.
    """
    first = np.unique(keys, return_index=True)[1]
    held = rng.beta(p[first] * draws[first] + 0.5, (1.0 - p[first]) * draws[first] + 0.5, (DRAWS, first.size))
    return (rng.random((DRAWS, p.size)) < held[:, keys]).mean(axis=1)


def agreement(entries):
    """Return how many entries with enough cases lie within ten points and beyond their band, and the error beyond chance."""
    enough = [e for e in entries if e.cases >= FEWEST]
    if not enough:
        return {"entries": 0, "near": 0, "beyond": 0, "open": 0, "open_near": 0, "rms": np.nan, "rank": np.nan}
    difference = np.array([e.predicted - e.measured for e in enough])
    chance = np.array([e.spread for e in enough])
    undecided = [e for e in enough if CERTAIN < e.predicted < 1.0 - CERTAIN]
    return {
        "entries": len(enough),
        "near": sum(e.near for e in enough),
        "beyond": sum(e.beyond for e in enough),
        "open": len(undecided),
        "open_near": sum(e.near for e in undecided),
        "rms": float(np.sqrt(max(np.mean(difference**2 - chance**2), 0.0))),
        "rank": float(spearmanr([e.predicted for e in enough], [e.measured for e in enough]).statistic),
    }


def largest(entries, count=8):
    """Return the entries that are furthest from their prediction for their spread, those with enough cases."""
    enough = [e for e in entries if e.cases >= FEWEST and e.beyond]
    return sorted(enough, key=lambda e: -abs(e.predicted - e.measured))[:count]


def compare_in_words(cases, plans):
    """Return the comparison as text."""
    lines = [f"# Predicted and measured confusion: {len(cases)} cases", ""]
    for title, pool in POOLS.items():
        for outcomes in (True, False):
            entries = compare(cases, plans, pool, outcomes)
            found = agreement(entries)
            lines += [
                f"## By {title}, {'four outcomes' if outcomes else 'every answer'}",
                "",
                f"- entries with {FEWEST} cases or more: {found['entries']}; within 10 points: {found['near']} (of those "
                f"predicted between 5 and 95 %: {found['open_near']} of {found['open']}); outside their 90 % band: "
                f"{found['beyond']} (chance alone: up to one in ten)",
                f"- error of the prediction beyond chance: {100 * found['rms']:.1f} points rms; "
                f"rank agreement {found['rank']:.2f}",
                *(
                    f"- {e.pool} → {e.said}: predicted {100 * e.predicted:.0f} % (band {100 * e.low:.0f}–"
                    f"{100 * e.high:.0f}), measured {100 * e.measured:.0f} % of {e.cases}"
                    for e in largest(entries, 12)
                ),
                "",
            ]
    return "\n".join(lines)
