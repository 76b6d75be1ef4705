"""How answers are counted: rates with 90 % bands, right and wrong names, reliability, held-out ratios, coverage."""

import itertools
from collections import Counter, defaultdict

import numpy as np

from studies.effects import find_effect
from tests.generator.device import Device

SNR_ROWS = (3.0, 1.0, 0.3)
NOTHING, UNEXPLAINED = "nothing", "unexplained"
CLAIMS = (0.0, 0.3, 0.6, 0.8, 0.9, 0.96, 1.001)
NORMAL_90 = 1.645
EVENTS = ("jump", "ageing", "clock-drift", "leak")
READS = (0.08, 1.0006)
"""Zero error, °C, and gain of the generator's thermometer: a record knows temperatures as they are read only."""


def band(hits, total):
    """Wilson's 90 % band of a rate (Wilson, J. Am. Stat. Assoc. 22 (1927) 209)."""
    if not total:
        return 0.0, 1.0
    p, z = hits / total, NORMAL_90
    centre = (p + z * z / (2 * total)) / (1 + z * z / total)
    half = z * np.sqrt(p * (1 - p) / total + z * z / (4 * total**2)) / (1 + z * z / total)
    return max(float(centre - half), 0.0), min(float(centre + half), 1.0)


def rate(hits, total):
    """A rate in words."""
    if not total:
        return "no cases"
    low, high = band(hits, total)
    return f"{100 * hits / total:.1f} % ({hits}/{total}; 90 % band {100 * low:.1f}-{100 * high:.1f})"


def short_rate(hits, total):
    """A rate for a cell: percent, band, and count."""
    if not total:
        return "—"
    low, high = band(hits, total)
    return f"{100 * hits / total:.0f} [{100 * low:.0f}–{100 * high:.0f}] ({hits}/{total})"


def share_of(cases, holds):
    """Return (hits, total) of a condition."""
    return sum(bool(holds(case)) for case in cases), len(cases)


def of_kind(cases, kind, **wanted):
    """Return the cases of one kind whose entries are as wanted."""
    return [c for c in cases if c["kind"] == kind and all(c[name] == value for name, value in wanted.items())]


def first_right(case):
    """The truth is in the strongest cause's set."""
    return bool(case["causes"]) and case["truth"][0] in [case["causes"][0][0], *case["causes"][0][1]]


def said(case):
    """One word for the answer to a single hidden thing: the truth where it is in the strongest set, else what was said."""
    if not case["causes"]:
        return UNEXPLAINED if case["verdict"] == UNEXPLAINED else NOTHING
    return case["truth"][0] if case["truth"] and first_right(case) else case["causes"][0][0]


def alarmed(case):
    """Anything but adequate."""
    return case["verdict"] != "adequate"


def named_anything(case):
    """A library name was given, with or without the remark that structure is left."""
    return bool(case["causes"])


def named_without_warning(case):
    """A library name was given and nothing said to be left over: wrong when the truth is not in the library."""
    return bool(case["causes"]) and case["verdict"] != UNEXPLAINED


def exact_set(case):
    """As many causes as hidden, each holding one of them."""
    left = list(case["truth"])
    for effect, equivalent, *_ in case["causes"]:
        hit = next((t for t in left if t in [effect, *equivalent]), None)
        if hit is None:
            return False
        left.remove(hit)
    return not left


def all_found(case):
    """Every hidden effect is in some cause's set."""
    return all(any(t in [c[0], *c[1]] for c in case["causes"]) for t in case["truth"])


def floor_ratio(case):
    """Held-out residual of the extended model over the true noise, in the channel of the effect."""
    result = case["responses"].get(case["channel"])
    if result is None or result[3] is None or result[3][1] is None:
        return None
    return result[3][1] / result[1]


def held_out_group(case):
    """What a run that is left out can be expected to show: effects that the other runs know, or something of its own."""
    if case["truth"][0] in EVENTS:
        return "events and drifts: what the other runs cannot know"
    if case["design"] == "steps":
        return "single steps: every run has temperatures of its own"
    return "effects that the other runs know"


def claims(cases):
    """Return (stated probability, right) of every cause."""
    return [
        (cause[3], any(t in [cause[0], *cause[1]] for t in case["truth"]))
        for case in cases
        if case["kind"] in ("effect", "pair", "null", "alien")
        for cause in case["causes"]
    ]


def reliability(stated):
    """Return (low, high, mean claim, hits, total) of each bin of claims, and the calibration error."""
    rows, error = [], 0.0
    for low, high in itertools.pairwise(CLAIMS):
        inside = [(p, hit) for p, hit in stated if low <= p < high]
        if inside:
            mean, hits = float(np.mean([p for p, _ in inside])), sum(hit for _, hit in inside)
            rows.append((low, min(high, 1.0), mean, hits, len(inside)))
            error += len(inside) / len(stated) * abs(mean - hits / len(inside))
    return rows, error


def confusion(cases, truth=lambda case: case["raw"][0]):
    """Return truth -> said -> count of cases that hide one thing."""
    table = defaultdict(Counter)
    for case in cases:
        table[truth(case)][said(case)] += 1
    return {name: table[name] for name in sorted(table)}


def true_parameters(case):
    """The hidden effect's parameters in the names and units of the library: those whose meaning is the same on both sides.

    The forms differ in the rest (widths of differently shaped curves, polynomials about another temperature).
    """
    if case["kind"] != "effect" or not case["parameters"]:
        return {}
    name, effect = case["truth"][0], find_effect(case["truth"][0])
    own = case["parameters"][name]
    size = own["size"]
    out = {}
    match name:
        case "jump":
            out = {"run": own["run"], "time_s": own["time"], "step": size}
        case "second-lag":
            out = {"second_time_constant_s": own["time"]}
        case "hysteresis":
            out = {"half_width_K": own["width"]}
        case "activity-dip" | "loss-peak":
            out = {"temperature_degC": READS[0] + READS[1] * own["centre"]}
        case "periodic":
            out = {"period_s": own["period"]}
        case "ageing" if own.get("kind", "log") == "log":
            out = {"onset_s": own["onset"]}
        case "mounting-stress":
            out = {"relaxation_time_s": own["relax"]}
        case "rate-bias":
            out = {"coefficient": 1e3 * size}
        case "self-heating":
            out = {"heating_K_per_V2": size}
        case "radiation":
            out = {"radiated_share": min(abs(size), 1.0)}
        case "amplitude-frequency":
            out = {"slope": 1e-7 * size * _device(case).f0}
        case "clock-drift":
            out = {"drift": 1e-9 * size * _device(case).f0}
    names = (*(p.name for p in effect.shape), *effect.coefficient_names(case["channel"]))
    return {
        next((full for full in names if full == key or full.startswith(key + "_")), key): v for key, v in out.items()
    }


def _device(case):
    from tests.benchmarks.diagnosis.cases import draw_case

    rng = np.random.default_rng(case["seed"])
    draw_case(case["kind"], case["count"], rng)
    return Device.draw(rng)


def coverage(cases):
    """Return (effect, parameter) -> [(covered, error over half width, relative error)], the hidden effect named right."""
    out = defaultdict(list)
    for case in cases:
        if not case["causes"] or case["causes"][0][0] != (case["truth"] or [""])[0]:
            continue
        if case["causes"][0][2] != case["channel"] or not case["intervals"]:
            continue
        for name, true in true_parameters(case).items():
            if name in case["intervals"][0] and name != "run":
                value, low, high = case["intervals"][0][name]
                half = max(0.5 * (high - low), 1e-300)
                out[case["truth"][0], name].append((low <= true <= high, (value - true) / half, value / true - 1.0))
    return dict(sorted(out.items()))
