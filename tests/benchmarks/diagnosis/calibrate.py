"""Fit the engine's constants on cases of the tests' generator, and write them with their provenance.

`temper` and `misfit` are the most likely ones for the hidden names among the rivals of their places, the doubts the shares of sure
names that are wrong all the same, where one cause in ten is of no library. The others are beliefs, with their reasons beside them.
"""

import re
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

import studies.diagnosis
from studies.diagnosis.constants import CONSTANTS

FILE = Path(studies.diagnosis.__file__).parent / "calibration.toml"
SURE = 0.95
HIDDEN, ALIEN = ("effect", "pair"), "alien"
UNLISTED = 0.1
"""Part of all campaigns with something to find whose cause no library has: a belief."""


def fit_constants(cases):
    """Return the fitted constants by name."""
    places = [
        (place, next((n for n in place["names"] if n in case["truth"]), None))
        for case in cases
        if case["kind"] in HIDDEN
        for place in case.get("places", [])
    ]
    known = [(place, name) for place, name in places if name is not None]

    def minus_log(logs):
        temper, misfit = np.exp(logs)
        total = 0.0
        for place, name in known:
            scores = np.array(place["scores"])
            lead = max(scores.max() - place["nothing"], 0.0)
            weight = np.exp((scores - scores.max()) / (temper + misfit * lead))
            total -= np.log(weight[place["names"].index(name)] / weight.sum())
        return total

    bounds = [(0.0, 2.0), tuple(np.log([0.002, 0.1]))]
    temper, misfit = np.exp(minimize(minus_log, (0.5, np.log(0.03)), method="Nelder-Mead", bounds=bounds).x)
    return {"temper": float(temper), "misfit": float(misfit), **doubts(cases)}


def doubts(cases):
    """Return how often sure names are wrong, first ones and further ones."""
    hidden, aliens = (sum(case["kind"] in kinds for case in cases) for kinds in (HIDDEN, (ALIEN,)))
    weights = dict.fromkeys((*HIDDEN, "null"), 1.0) | {ALIEN: UNLISTED / (1.0 - UNLISTED) * hidden / max(aliens, 1)}
    wrong, all_ = (dict.fromkeys(("doubt", "doubt_further"), start) for start in (0.5, 1.0))
    for case in cases:
        for k, (name, others, _, probability, _) in enumerate(case["causes"]):
            side = "doubt_further" if k else "doubt"
            if case["kind"] in weights and probability > SURE * (1.0 - CONSTANTS[side]):
                all_[side] += weights[case["kind"]]
                wrong[side] += weights[case["kind"]] * (not any(true in [name, *others] for true in case["truth"]))
    return {side: wrong[side] / all_[side] for side in wrong}


def write_constants(cases):
    """Rewrite the fitted values, commit and number of cases in the engine's file; return them."""
    found = fit_constants(cases)
    text = FILE.read_text()
    for name, value in found.items():
        text = re.sub(rf"(\[constant\.{name}\]\nvalue = )[^\n]*", rf"\g<1>{value:.3g}", text)
    text = re.sub(r"(?m)^commit = .*$", f'commit = "{", ".join(sorted({case["commit"] for case in cases}))}"', text)
    text = re.sub(r"(?m)^cases = .*$", f"cases = {len(cases)}", text)
    FILE.write_text(text)
    return found
