"""One batch of campaigns for a whole session: each is drawn and answered once, whoever of the test processes comes first."""

import fcntl
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from studies import workbench
from studies.calibration.observed import RESPONSES
from studies.diagnosis.verdict import Verdict
from studies.record import read_record
from tests.sketches import coarsen
from tests.stranger.aliens import ALIENS
from tests.stranger.baseline import COLUMN
from tests.stranger.campaign import make_campaign
from tests.stranger.effects import EFFECTS
from tests.stranger.noise import FAMILIES
from tests.stranger.truth import Truth

PAIRS = ("hysteresis+amplitude-frequency", "jump+leak", "rate-frequency+radiation")
"""The last one was once named as a bond with its joint, which imitates both at once."""
CASES: tuple[tuple[str, str, float | None], ...] = (
    *(("effect", name, 5.0) for name in EFFECTS),
    *(("null", name, None) for name in FAMILIES),
    *(("alien", name, 6.0) for name in ALIENS),
    *(("pair", name, 6.0) for name in PAIRS),
)
"""Kind, what is hidden, SNR; every effect of the library, every noise, every cause outside the library."""
IN_TWO_RUNS = {"ageing", "leak", "clock-drift", "clock-offset", "radiation"}
"""Seen between two runs, or not of every SNR in one; of the others three in four are hidden in one."""
FIRST_SEED = 5000
MEANS, OF_ALIENS = 60, 120
"""Of a run; fewer leave too little of a cause outside the library."""
Line = dict[str, Any]


def faults_of(truth: Truth, snr: float | None, folder: Path) -> list[str]:
    """What of a campaign is not as its truth says: its files, its SNR, a null that hides something."""
    found = []
    for file, clean, noise in zip(truth.files, truth.clean, truth.noise, strict=True):
        record = read_record(folder / file)
        for key in noise:
            departure = np.abs(record[COLUMN[key]] - clean[key])
            if not np.nanmedian(departure) < 2 * truth.floor[COLUMN[key]] + 3 * np.std(noise[key]):
                found.append(f"{file}: {key} is not what was drawn")
    for hidden in truth.hidden:
        own = EFFECTS.get(hidden.effect)
        pairs = zip(truth.clean, truth.bare, strict=True)
        changed = np.concatenate([clean[hidden.response] - bare[hidden.response] for clean, bare in pairs])
        shown = (own is not None and own.targets == ("reading",)) or np.std(changed) > truth.floor[
            COLUMN[hidden.response]
        ]
        if not (abs(hidden.snr / snr - 1.0) < 0.06 and hidden.effect in hidden.right_names and shown):
            found.append(f"{hidden.effect} has SNR {hidden.snr:.2f}")
    if truth.kind == "null" and not (
        truth.verdicts == ("adequate",)
        and all(np.array_equal(c[k], b[k]) for c, b in zip(truth.clean, truth.bare, strict=True) for k in c if k in b)
    ):
        found.append("a null hides something")
    return found


def truth_of(place: int, folder: Path) -> tuple[Line, list[str], set[str]]:
    """Draw a campaign of two runs or one; return its truth in the form that marks read, its files and the responses that matter."""
    kind, name, snr = CASES[place]
    runs = 2 if kind == "pair" or name in IN_TWO_RUNS or place % 4 == 0 else 1
    truth = make_campaign(FIRST_SEED + place, kind, name, snr, runs=runs, folder=folder)
    line = {
        "kind": kind,
        "hidden": [sorted(h.right_names) for h in truth.hidden] if kind != "alien" else [],
        "snr": snr or 0.0,
        "verdicts": truth.verdicts,
        "tolerated": truth.tolerated,
        "faults": faults_of(truth, snr, folder),
    }
    own = [COLUMN[h.response] for h in truth.hidden] or [("bias_deg_per_h", "inverse_q")[place // 2 % 2]]
    return line, [str(folder / file) for file in truth.files], {"frequency_Hz", *own}


def diagnose(files: list[str], asked: set[str], means: int) -> Verdict:
    """Ask for the frequency and the responses in which something is hidden."""
    records = [read_record(file) for file in files]
    kept = [{n: own for n, own in r.columns.items() if n in asked or n not in RESPONSES} for r in records]
    with pytest.MonkeyPatch.context() as patch:
        coarsen(patch, means)
        return workbench.diagnose_records([replace(r, columns=o) for r, o in zip(records, kept, strict=True)]).verdict


def answer(place: int, folder: Path) -> Line:
    """Return truth and verdict of one campaign, from the file where another process has left it."""
    kind, name, _ = CASES[place]
    folder = folder / f"{kind}-{name}"
    folder.mkdir(parents=True, exist_ok=True)
    kept = folder / "answer.json"
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not kept.exists():
            line, files, asked = truth_of(place, folder)
            found = diagnose(files, asked, OF_ALIENS if kind == "alien" else MEANS).as_dict()
            kept.write_text(
                json.dumps({"case": f"{kind}:{name}", "card": False, "truth": line, **found}, default=float)
            )
    return json.loads(kept.read_text())


def stub(line: Line, state: str, *names: str) -> Line:
    """Return the answer of an engine that does not look: the same verdict and names, whatever is hidden."""
    cause = {"effect": names[0], "equivalent": list(names[1:]), "probability": 0.99} if names else None
    return line | {"verdict": state, "causes": [cause] if cause else [], "responses": {}}


STUBS: dict[str, Callable[[Line], Line]] = {
    "always adequate": lambda line: stub(line, "adequate"),
    "always the first effect": lambda line: stub(line, "explained", next(iter(EFFECTS))),
    "one of all effects": lambda line: stub(line, "not-identifiable", *EFFECTS),
}
