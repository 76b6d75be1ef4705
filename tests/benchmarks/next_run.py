"""Chamber hours that the live choice of the next run saves, on hidden effects in gyros whose card is known only within its tolerances.

    python tests/benchmarks/next_run.py OUT.jsonl --count N --seed S

Every case draws the card's values from their tolerances, hides one effect in one shape, and measures with the card's noise. One
campaign is a fixed set of four 8 h runs. The other begins with the first of them and goes on with what `suggest` proposes, until the
answer is the hidden effect with nothing beside it that a record could separate, or its chamber time is that of the fixed set. Cases
that are in OUT.jsonl already are not run again.
"""

import argparse
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from studies.calibration.priors import gather_priors
from studies.effects import find_effect
from studies.inference.diagnosis import Inference, infer
from studies.inference.records import make_ready
from studies.instrument.card import Instrument, load_card
from studies.planning.chamber import Chamber
from studies.planning.next_run import suggest
from studies.planning.plan import plan_campaign
from studies.record import Record
from studies.simulation.chamber import load_profile
from studies.simulation.virtual_gyro import simulate_run

CARD, ROW = "hrg-30mm", 30.0
FIXED = (
    "step 20 -10 8h",
    "staircase -10 40 10 80min",
    "soak 15 60min then cycle 15 40 -10 0.5 15min 2 then soak 15 30min",
    "soak -10 1h then ramp -10 40 0.14 then soak 40 1h",
)
HIDDEN = (
    ("second-lag", "frequency_Hz"), ("mounting-stress", "frequency_Hz"), ("hysteresis", "frequency_Hz"),
    ("radiation", "frequency_Hz"), ("thermometer-scale", "frequency_Hz"), ("activity-dip", "frequency_Hz"),
    ("rate-bias", "bias_deg_per_h"), ("cross-damping", "bias_deg_per_h"), ("hysteresis", "bias_deg_per_h"),
    ("loss-peak", "inverse_q"),
)  # fmt: skip
TIMES = 2.0
"""Size of the hidden effect over the least that the plan of the fixed set can identify."""


def hidden_table(effect: str, response: str, size: float, rng: np.random.Generator) -> dict[str, Any]:
    """Return an `[[effect]]` table of one shape between the ends of every parameter's usual range."""
    own = find_effect(effect)
    shapes = {
        "second_time_constant_s": float(rng.uniform(4e3, 12e3)),
        "time_constant_s": float(rng.uniform(3e3, 9e3)),
        "temperature_degC": float(rng.uniform(5.0, 30.0)),
        "width_K": float(rng.uniform(1.0, 3.0)),
    }
    values = np.zeros(own.spread.size)
    values[int(np.argmax(own.spread == 1.0))] = size
    shape: dict[str, float] = {}
    for parameter in own.shape:
        if parameter.steady:
            continue
        middle = (
            float(np.sqrt(parameter.low * parameter.high))
            if parameter.logarithmic
            else 0.5 * (parameter.low + parameter.high)
        )
        shape[parameter.name] = float(np.clip(shapes.get(parameter.name, middle), parameter.low, parameter.high))
    return {
        "name": effect,
        "response": response,
        **shape,
        **{k: v for k, v in own.numbers(values, response).items() if np.any(v)},
    }


def measure(gyro: Instrument, words: str, seed: int, number: int) -> Record:
    """Return the record of one more run."""
    profile = load_profile(words)
    return replace(simulate_run(gyro, profile, 1.0 / ROW, seed).record, path=f"run {number}")


def settled(found: Inference, effect: str, response: str) -> bool:
    """Whether the answer is the hidden effect alone, but for what no record can separate from it."""
    exact = find_effect(effect).equivalents.get(response, ())
    causes = [cause for cause in found.verdict.causes if cause.kind == "physics"]
    return any(c.effect == effect and set(c.equivalent) <= set(exact) for c in causes)


def run_case(card: Instrument, number: int, size: float, seed: int) -> dict[str, Any]:
    """Run one case both ways."""
    effect, response = HIDDEN[number % len(HIDDEN)]
    rng = np.random.default_rng([seed, number])
    priors = gather_priors(card)
    gyro = card.with_values(priors.at(priors.inside(rng.standard_normal(len(priors.values)))))
    table = hidden_table(effect, response, size, rng)
    gyro = gyro.with_table("effect", [table])
    fixed = [measure(gyro, words, 100 * number + k, k + 1) for k, words in enumerate(FIXED)]
    hours = sum(float(np.ptp(one["time_s"])) for one in fixed) / 3600.0
    whole = infer(card, make_ready(fixed))
    out: dict[str, Any] = {
        "case": number,
        "seed": seed,
        "hidden": table,
        "fixed": {"hours": hours, "said": str(whole.verdict), "settled": settled(whole, effect, response)},
    }
    records, spent = fixed[:1], float(np.ptp(fixed[0]["time_s"])) / 3600.0
    steps: list[Mapping[str, Any]] = []
    while True:
        found = infer(card, make_ready(records))
        done = settled(found, effect, response)
        steps.append({"hours": spent, "said": str(found.verdict), "settled": done})
        if done or spent >= hours:
            break
        words, run = suggest(found, found.verdict, Chamber(3.0, -10.0, 40.0))
        steps[-1] = {**steps[-1], "next": words}
        if run is None or spent + run.hours > hours:
            break
        profile = FIXED[0] if run.profile.startswith("repeat") else run.profile
        records = [*records, measure(gyro, profile, 100 * number + 10 + len(records), len(records) + 1)]
        spent += run.hours
    return {**out, "live": {"hours": spent, "settled": done, "steps": steps}}


def main() -> None:
    """Run what is missing and print the totals."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    known = [json.loads(line) for line in given.out.read_text().splitlines()] if given.out.exists() else []
    done = {(one["seed"], one["case"]) for one in known}
    missing = [k for k in range(given.count) if (given.seed, k) not in done]
    if missing:
        card = load_card(CARD)
        plan = plan_campaign(card, FIXED).as_dict()["effects"]
        least = {(one["effect"], one["response"]): (one["least"] or one["largest"])["value"] for one in plan}
        for k in missing:
            known.append(run_case(card, k, TIMES * least[HIDDEN[k % len(HIDDEN)]], given.seed))
            with given.out.open("a") as file:
                file.write(json.dumps(known[-1]) + "\n")
            print(
                f"case {k}: {known[-1]['hidden']['name']}, fixed {known[-1]['fixed']}, live {known[-1]['live']}",
                flush=True,
            )
    fixed = [one for one in known if one["fixed"]["settled"]]
    live = [one for one in known if one["live"]["settled"]]
    within = [one for one in live if one["live"]["hours"] <= 0.6 * one["fixed"]["hours"]]
    print(
        f"settled: fixed set {len(fixed)} of {len(known)}, live {len(live)}, live within 60 % of the hours {len(within)}"
    )
    both = [
        one["live"]["hours"] / one["fixed"]["hours"]
        for one in known
        if one["live"]["settled"] and one["fixed"]["settled"]
    ]
    if both:
        print(
            f"hours of the live choice over the fixed set where both settle: median {np.median(both):.2f}, mean {np.mean(both):.2f}"
        )


if __name__ == "__main__":
    main()
