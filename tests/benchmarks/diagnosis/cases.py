"""Draw, build and diagnose the cases of the benchmark; a case is built again from what its line in the file says."""

import itertools
import json
import subprocess
import time
from pathlib import Path

import numpy as np

from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.causes import nothing_of, scores_of
from studies.diagnosis.investigate import investigate
from studies.effects import library
from tests.benchmarks.diagnosis.ceiling import ceilings
from tests.generator.designs import DESIGNS
from tests.generator.device import build
from tests.generator.hidden import ALIENS, EFFECTS, possible
from tests.generator.noises import FAMILIES

KINDS = ("null", "effect", "effect", "effect", "alien", "without", "pair")
SNRS = (3.0, 1.0, 0.3)
FAINT = (0.3, 0.1, 0.03)


def draw_case(kind, count, rng):
    """Draw design, noise, effects, alien and SNR of one case.

    Kinds: `null` hides nothing; `effect` one effect; `faint` one effect at low SNR, where plans are decided; `without` one
    effect that is taken out of the library; `alien` what no library knows; `pair` two effects.
    """
    name = list(DESIGNS)[count % len(DESIGNS)]
    runs = len(DESIGNS[name]["chambers"])
    # one and two runs are the usual case
    design = f"{name}/{int(rng.integers(1, runs + 1))}"
    family = FAMILIES[(count // len(DESIGNS)) % len(FAMILIES)]
    names = [name for name in EFFECTS if possible(name, design)]
    if kind == "null":
        return design, family, (), "", 0.0
    if kind in ("effect", "faint", "without"):
        name = names[int(rng.integers(len(names)))]
        levels = FAINT if kind == "faint" else SNRS
        snr = 3.0 if kind == "without" else levels[int(rng.integers(3))]
        return design, family, (name,), "", snr
    if kind == "alien":
        aliens = [name for name in ALIENS if possible(name, design)]
        return design, family, (), aliens[int(rng.integers(len(aliens)))], 3.0
    pair = ()
    while len({name.split("@")[0] for name in pair}) < 2:
        pair = tuple(rng.choice(names, 2, replace=False).tolist())
    return design, family, pair, "", 3.0


def build_case(kind, count, seed):
    """Return (records, truth) of a case: the same ones whenever kind, count and seed are the same."""
    rng = np.random.default_rng(seed)
    return build(*(drawn := draw_case(kind, count, rng))[:2], rng, *drawn[2:])


def rebuild(case):
    """Return the records of a case read from a file.

    Raises
    ------
    ValueError
        If the generator has changed since, so that other effects or another noise come out.
    """
    records, truth = build_case(case["kind"], case["count"], case["seed"])
    same = list(truth.effects) == list(case["raw"]) and truth.alien == case["alien"]
    if not same or not np.allclose([truth.noise[c] for c in case["noise"]], list(case["noise"].values()), rtol=1e-9):
        raise ValueError(f"seed {case['seed']}: the generator has changed since this case was made; make new cases.")
    return records


def usable(kind, raw):
    """The library of a case: without the hidden effect in cases of the kind `without`."""
    hidden = [name.split("@")[0] for name in raw]
    return [effect for effect in library().values() if kind != "without" or effect.name not in hidden]


def run_case(kind, count, seed, held_out=True, commit=""):
    """Build and diagnose one case; return what was hidden and what was said."""
    records, truth = build_case(kind, count, seed)
    begin = time.perf_counter()
    diagnosis = investigate(
        load_campaign(records), effects=usable(kind, truth.effects), score_held_out=held_out, advise=False
    )
    found = diagnosis.verdict
    return {
        "kind": kind,
        "commit": commit,
        "design": truth.design,
        "family": truth.family,
        "truth": [name.split("@")[0] for name in truth.effects],
        "alien": truth.alien,
        "snr": truth.snr,
        "seed": seed,
        "count": count,
        "raw": truth.effects,
        "channel": truth.channel,
        "seconds": time.perf_counter() - begin,
        "verdict": found.verdict,
        "places": [place for inquiry in diagnosis.inquiries.values() for place in contended(inquiry)],
        "nearest": {k: inquiry.selection.nearest for k, inquiry in diagnosis.inquiries.items()},
        "causes": [[c.effect, list(c.equivalent), c.response, c.probability, c.evidence] for c in found.causes],
        "intervals": [{n: [p.value, p.low, p.high] for n, p in c.parameters.items()} for c in found.causes],
        "responses": {
            k: [r.verdict, r.noise, r.baseline, r.extended, r.left_over_input, r.left_over_evidence]
            for k, r in found.responses.items()
        },
        "noise": truth.noise,
        "size": {k: v.get("size") for k, v in truth.parameters.items()},
        "parameters": truth.parameters,
    }


def contended(inquiry):
    """What contends for every place of a response: names and scores, nothing, generic structure; for the constants."""
    return [
        {
            "response": inquiry.problem.response.column,
            "names": list(place.names),
            "scores": scores_of(inquiry, place),
            "nothing": nothing_of(inquiry, place),
            "unknown": inquiry.unknown - inquiry.selection.final.score,
        }
        for place in inquiry.selection.places
    ]


def collect(path, minutes, kinds, seed, held_out=True):
    """Append cases to a file for some minutes."""
    commit, end = current_commit(), time.time() + 60 * minutes
    with path.open("a") as file:
        for count in itertools.count(seed % 1000):
            if time.time() > end:
                break
            case = run_case(kinds[count % len(kinds)], count // len(kinds), seed + count, held_out, commit)
            file.write(json.dumps(case, default=float) + "\n")
            file.flush()


def add_ceilings(path):
    """Write into the file what an ideal detector would see of single effects below SNR 3 and of pairs."""
    cases = read_cases(path)
    for case in cases:
        wanted = case["kind"] == "pair" or (case["kind"] in ("effect", "faint") and case["snr"] < max(SNRS))
        if wanted and "ceiling" not in case:
            _, truth = build_case(case["kind"], case["count"], case["seed"])
            case["ceiling"] = [[own.known, own.wandering] for own in ceilings(truth)]
    path.write_text("".join(json.dumps(case, default=float) + "\n" for case in cases))


def read_cases(path):
    """Read the cases of a file; keys that older files lack are filled in."""
    lines = Path(path).read_text().splitlines()
    return [{"commit": "", "intervals": [], "parameters": {}, **json.loads(line)} for line in lines]


def key_of(case):
    """What tells a case from all others."""
    return f"{case['kind']}/{case['count']}/{case['seed']}"


def current_commit():
    """Short name of the commit under test, with a plus when files of the program differ from it."""

    def git(*words):
        where = Path(__file__).parent
        return subprocess.run(["git", *words], cwd=where, capture_output=True, text=True).stdout.strip()

    changed = git("status", "--porcelain", "--untracked-files=no", ":/studies", ":/tests/generator")
    return git("rev-parse", "--short", "HEAD") + ("+" if changed else "")
