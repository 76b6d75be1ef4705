"""The benchmark in plain text."""

from collections import Counter

import numpy as np

from tests.benchmarks.diagnosis.ceiling import PRICE
from tests.benchmarks.diagnosis.scoring import (
    NOTHING,
    SNR_ROWS,
    UNEXPLAINED,
    alarmed,
    all_found,
    claims,
    exact_set,
    first_right,
    floor_ratio,
    held_out_group,
    named_without_warning,
    of_kind,
    rate,
    reliability,
    share_of,
)
from tests.generator.noises import FAMILIES


def summarise(cases):
    """Return the report as text."""
    lines = [f"# Diagnosis on the independent generator: {len(cases)} cases", ""]
    lines += ["## False alarms (any verdict but adequate)", ""]
    for family in FAMILIES:
        lines.append(f"- {family}: {rate(*share_of(of_kind(cases, 'null', family=family), alarmed))}")
    nets = sorted((net for c in of_kind(cases, "null") for net in c.get("nearest", {}).values()), reverse=True)
    if nets:
        words = ", ".join(f"{net:.1f}" for net in nets[:3])
        lines.append(f"- strongest effects in {len(nets)} responses, log posterior over nothing: {words}")
    lines += ["", "## Right class (truth in the strongest set) and exact answers", ""]
    singles = of_kind(cases, "effect") + of_kind(cases, "faint")
    levels = sorted({c["snr"] for c in singles} | set(SNR_ROWS), reverse=True)
    for snr in levels:
        mine = [c for c in singles if c["snr"] == snr]
        lines.append(
            f"- SNR {snr:g}: {rate(*share_of(mine, first_right))}; "
            f"nothing named {rate(*share_of(mine, lambda c: not c['causes']))}; "
            f"unexplained {rate(*share_of(mine, lambda c: c['verdict'] == UNEXPLAINED))}; "
            f"more than one cause {rate(*share_of(mine, lambda c: len(c['causes']) > 1))}"
        )
    head = " | ".join(f"{snr:g}" for snr in levels)
    lines += ["", f"| effect | SNR {head} | mistaken for (SNR 1 and 3) |", "| --- " * (len(levels) + 2) + "|"]
    for name in sorted({c["truth"][0] for c in singles}):
        mine = [c for c in singles if c["truth"][0] == name]
        row = [share_of([c for c in mine if c["snr"] == snr], first_right) for snr in levels]
        wrong = Counter(_word(c) for c in mine if c["snr"] >= 1 and not first_right(c))
        lines.append(f"| {name} | {' | '.join(f'{hits}/{total}' for hits, total in row)} | {_counts(wrong)} |")
    lines += ["", *_within_reach(singles, "one effect", first_right)]
    lines += ["", "## Held-out residual over the noise (right name)", ""]
    groups = sorted({held_out_group(c) for c in singles})
    for group, snr in [(None, snr) for snr in levels] + [(group, None) for group in groups]:
        ratios = [
            r
            for c in singles
            if (c["snr"] == snr if group is None else held_out_group(c) == group)
            and first_right(c)
            and (r := floor_ratio(c)) is not None
        ]
        if ratios:
            lines.append(
                f"- {f'SNR {snr:g}' if group is None else group}: median {np.median(ratios):.3f}, "
                f"within 10 % {rate(sum(r < 1.1 for r in ratios), len(ratios))}, "
                f"within 5 % {rate(sum(r < 1.05 for r in ratios), len(ratios))}"
            )
    lines += ["", "## Aliens at SNR 3", ""]
    for kind in ("alien", "without"):
        mine = of_kind(cases, kind)
        lines.append(
            f"- {kind}: unexplained {rate(*share_of(mine, lambda c: c['verdict'] == UNEXPLAINED))}; "
            f"wrong name alone {rate(*share_of(mine, named_without_warning))}"
        )
        for name in sorted({_hidden(c) for c in mine}):
            words = Counter(
                UNEXPLAINED if c["verdict"] == UNEXPLAINED else _word(c) for c in mine if _hidden(c) == name
            )
            lines.append(f"  - {name}: {_counts(words)}")
    pairs = of_kind(cases, "pair")
    lines += ["", "## Two effects at SNR 3", ""]
    lines.append(f"- exact set: {rate(*share_of(pairs, exact_set))}; both found: {rate(*share_of(pairs, all_found))}")
    lines += _within_reach(pairs, "both of a pair", all_found)
    lines += ["", "## Reliability of the stated probability", ""]
    stated = claims(cases)
    rows, error = reliability(stated)
    lines += [
        f"- claimed {low:.2f}-{high:.2f}: mean {mean:.3f}, right {rate(hits, total)}"
        for low, high, mean, hits, total in rows
    ]
    seconds = [c["seconds"] for c in cases]
    lines += [
        f"- calibration error {error:.3f} on {len(stated)} claims",
        "",
        f"Median time {np.median(seconds):.2f} s, longest {max(seconds):.2f} s."
        f" Commits: {_counts(Counter(c['commit'] or 'not recorded' for c in cases))}.",
    ]
    return "\n".join(lines) + "\n"


def _within_reach(cases, word, found):
    """Lines on what an ideal detector could name, and how much of it was found."""
    lines = []
    for k, knows in enumerate(("knows the noise", "does not know whether the noise wanders")):
        for snr in sorted({c["snr"] for c in cases if "ceiling" in c}, reverse=True):
            mine = [c for c in cases if c["snr"] == snr and "ceiling" in c]
            seen = [c for c in mine if min(own[k] for own in c["ceiling"]) > PRICE]
            lines.append(
                f"- {word} at SNR {snr:g}, an ideal detector that {knows}: could name {len(seen)} of {len(mine)}; "
                f"of these found {rate(*share_of(seen, found))}"
            )
            missed = [f"{c['truth'][0]} {min(own[k] for own in c['ceiling']):.0f}" for c in seen if not found(c)]
            if missed:
                lines.append(f"  - missed, with its log likelihood ratio: {', '.join(sorted(missed))}")
    return lines


def _hidden(case):
    return case["alien"] or case["truth"][0]


def _word(case):
    if case["causes"]:
        return case["causes"][0][0]
    return UNEXPLAINED if case["verdict"] == UNEXPLAINED else NOTHING


def _counts(counter):
    return ", ".join(f"{name} {count}" for name, count in sorted(counter.items()))
