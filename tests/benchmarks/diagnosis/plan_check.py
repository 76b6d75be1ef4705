"""Is the confusion that `--plan` predicts the one that is measured?

The plan sees the temperatures and drives of a design, through the record of one gyro that hides nothing. It does not know
the noise of the cases: it assumes a random kind and strength of slow noise, and its hidden effects have the library's own
forms. The cases have other gyros, the generator's forms, and its five families of noise in turn. Both sides are pooled
over the same cases: to each case belongs the prediction for its design and SNR.
"""

import json
from collections import defaultdict

import numpy as np
from scipy.stats import spearmanr

from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.plan import NOTHING, predict
from tests.benchmarks.diagnosis.cases import current_commit, read_cases
from tests.benchmarks.diagnosis.scoring import band, of_kind, said
from tests.generator.device import build

FEWEST = 12
WITHIN = 0.10


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
        for snr in sorted({c["snr"] for c in cases if c["design"] == design}):
            plan = predict(campaign, snr, draws, np.random.default_rng(21), max(draws // 8, 3))
            out["plans"][f"{design} {snr:g}"] = plan.as_dict()
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


def expected(case, plans):
    """Return said -> probability for one case; said is the truth where the answer holds it."""
    plan = plans[f"{case['design']} {case['snr']:g}"]
    return plan["confusion"].get(plan_key(case["raw"][0], case["channel"]), {NOTHING: 1.0})


def compare(cases, plans, pool=lambda case: case["raw"][0]):
    """Return rows (truth, said, predicted, measured, cases) for every pair that occurs on either side."""
    groups = defaultdict(list)
    for case in cases:
        groups[pool(case)].append(case)
    rows = []
    for truth, mine in sorted(groups.items()):
        predicted, measured = defaultdict(float), defaultdict(float)
        for case in mine:
            measured[said(case)] += 1.0 / len(mine)
            for name, share in expected(case, plans).items():
                predicted[name] += share / len(mine)
        names = sorted({*predicted, *measured}, key=lambda name: -measured[name])
        rows += [(truth, name, predicted[name], measured[name], len(mine)) for name in names]
    return rows


def agreement(rows):
    """Return how many entries lie within ten points, how many beyond what chance allows, and the rank agreement."""
    enough = [row for row in rows if row[4] >= FEWEST]
    near = sum(abs(p - m) <= WITHIN for _, _, p, m, _ in enough)
    excused = sum(abs(p - m) > WITHIN and not outside_band(p, round(m * n), n, WITHIN) for _, _, p, m, n in enough)
    own = [row for row in enough if row[1] == row[0].split(" ")[0].split("@")[0]]
    ranks = {
        "all entries": spearmanr([r[2] for r in enough], [r[3] for r in enough]).statistic
        if len(enough) > 2
        else np.nan,
        "named rightly": spearmanr([r[2] for r in own], [r[3] for r in own]).statistic if len(own) > 2 else np.nan,
    }
    return {"entries": len(enough), "near": near, "excused": excused, "ranks": ranks}


def outside_band(predicted, hits, total, slack=0.0):
    """Whether a prediction lies outside the 90 % band of what was counted, by more than a slack."""
    low, high = band(hits, total)
    return not low - slack <= predicted <= high + slack


def largest(rows, count=8):
    """Return the entries with the largest differences, those with enough cases."""
    return sorted((r for r in rows if r[4] >= FEWEST), key=lambda r: -abs(r[2] - r[3]))[:count]


def compare_in_words(cases, plans):
    """Return the comparison as text."""
    lines = [f"# Predicted and measured confusion: {len(cases)} cases", ""]
    pools = {
        "pooled over designs and SNR": lambda c: c["raw"][0],
        **{
            f"SNR {snr:g}, pooled over designs": lambda c, snr=snr: c["raw"][0]
            for snr in sorted({c["snr"] for c in cases}, reverse=True)
        },
    }
    for title, pool in pools.items():
        mine = [c for c in cases if title.startswith("pooled") or title.startswith(f"SNR {c['snr']:g},")]
        rows = compare(mine, plans, pool)
        found = agreement(rows)
        ranks = ", ".join(f"{name} {value:.2f}" for name, value in found["ranks"].items())
        lines += [
            f"## {title} ({len(mine)} cases)",
            "",
            f"- entries with {FEWEST} cases or more: {found['entries']}; within 10 points: {found['near']}; "
            f"of the others within 10 points of the measured 90 % band: {found['excused']}",
            f"- rank agreement (Spearman): {ranks}",
            *(
                f"- {truth} → {name}: predicted {100 * p:.0f} %, measured {100 * m:.0f} % of {n}"
                for truth, name, p, m, n in largest(rows)
            ),
            "",
        ]
    return "\n".join(lines)
