"""Judge of the inference: what the commands answer to campaigns that they have not seen, kept by commit, old beside new.

    python tests/benchmarks/judge.py ask NEW.jsonl [--data DIR] [--stranger 200] [--cards 40] [--devices 8] [--measured]
        [--folder DIR …] [--seed 910000] [--minutes M] [--jobs 1]
    python tests/benchmarks/judge.py compare OLD.jsonl[.gz] NEW.jsonl[.gz]

Answers of earlier commits, to compare with: tests/reference/judge_*.jsonl.gz (same kinds, counts and seed).

`ask` appends one line a campaign and passes over those that the file holds, so it goes on where it was stopped. Campaigns stay in
the data folder: asked again with it, another commit answers to the same bytes. Kinds of campaigns:

stranger   the independent generator, without a card: effects, pairs, nulls, causes outside the library in turn
card       the virtual gyro of a shipped card that hides one effect or none, with the card
device     the virtual gyro of a card whose values are drawn from their stated widths; `hrg calibrate` answers too
folder     examinations by others: `truth.json` beside `cases/NAME/run_*.csv`; six independent examiners' generators write such folders:
           python tests/benchmarks/hands/distributed.py|bang_bang.py|pi_chamber.py|dead_band.py|places.py|stations.py OUT --count 100 --seed S
measured   data that nobody of this project wrote: answers are listed, not marked

A row is a share of old and of new with 90 % bands (Wilson); `lost` and `won` count campaigns that changed, and a row is worse
beyond chance where fewer than 5 % of fair coins lose as many.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from contextlib import redirect_stdout
from dataclasses import replace
from functools import partial
from itertools import islice, zip_longest
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from shell.errors import ShellError
from studies.effects import library
from studies.errors import InputError
from studies.instrument.card import load_card
from studies.record import write_record
from studies.simulation.chamber import load_profile
from studies.simulation.virtual_gyro import simulate_run
from tests.benchmarks.diagnosis.card_cases import CARDS, SEEN, ceiling, make_case, run
from tests.benchmarks.diagnosis.marks import compare, read_lines
from tests.measured import DATA, bring_in
from tests.stranger.__main__ import make_one

PROFILES = ("staircase 20 -10 15 75min", "ramp -10 35 0.5 then soak 35 90min")
ASK = "import sys; from studies.cli import main; sys.exit(main(sys.argv[1:]))"
DCXO = (
    '# unknown column: "column 3"',
    '[[file.column]]\nfrom = "column 3"\nto = "frequency_Hz"\nunit = "ppm"\nnominal_Hz = 25e6\n',
)
BURSTS = (("scale = 1.0 ", "scale = 0.00390625 "), ("offset = 0.0 ", "offset = -231.0 "))
MEASURED: dict[str, tuple[str, tuple[tuple[str, str], ...], str]] = {
    **{f"chamber-{a}": ("imu_chamber.txt", (('unit = "deg/s"', 'unit = "rad/s"'),), f"run_{a}.csv") for a in "xyz"},
    "bursts": ("pan_bursts.csv", BURSTS, "run_x.csv"),
    "crystal": ("dcxo_gps.txt", (DCXO,), "run.csv"),
    "liquid": ("qcm_steps.txt", (), "run.csv"),
}
Line = dict[str, Any]


def commit() -> str:
    """Return the commit, with a plus where files have been changed since."""
    asked = (["rev-parse", "--short", "HEAD"], ["status", "--porcelain", "--untracked-files=no"])
    here, changed = (
        subprocess.run(["git", *words], cwd=Path(__file__).parent, capture_output=True, text=True, check=False).stdout
        for words in asked
    )
    return (here.strip() or "unknown") + ("+" if changed.strip() else "")


def make_stranger(folder: Path, seed: int, first: int) -> Line:
    truth, ideal = make_one(seed, seed - first, folder)
    return {
        "kind": truth.kind,
        "hidden": [sorted(h.right_names) for h in truth.hidden] if truth.kind != "alien" else [],
        "effects": "+".join(h.effect for h in truth.hidden),
        "snr": min((h.snr for h in truth.hidden), default=0.0),
        "reach": min((h.detectability for h in truth.hidden), default=0.0),
        "verdicts": truth.verdicts,
        "tolerated": truth.tolerated,
        "floor": truth.own_floor,
        "ideal": ideal,
        "files": [str(folder / f) for f in truth.files],
    }


def make_card(folder: Path, seed: int, ideal: bool) -> Line:
    case = make_case(seed)
    names = [case.name, *(e for own in library()[case.name].equivalents.values() for e in own)] if case.name else []
    return {
        "kind": "effect" if case.name else "null",
        "hidden": [names] if names else [],
        "effects": case.name,
        "snr": case.snr,
        **({"reach": (2.0 * max(ceiling(seed), 0.0)) ** 0.5} if ideal and names and case.snr <= SEEN else {}),
        "verdicts": ["explained", "not-identifiable"] if names else ["adequate"],
        "card": case.card.name,
        "files": written(folder, run(case.device, case.drives, seed)),
    }


def make_device(folder: Path, seed: int) -> Line:
    from studies.calibration.priors import gather_priors

    card = load_card(CARDS[seed % len(CARDS)])
    priors = replace(gather_priors(card), wave=None)
    drawn = priors.inside(np.random.default_rng(seed).standard_normal(len(priors.values)))
    device = card.with_values(priors.at(drawn))
    records = [simulate_run(device, load_profile(w), 0.033, 100 * seed + k).record for k, w in enumerate(PROFILES)]
    own = {"kind": "null", "hidden": [], "effects": "", "snr": 0.0, "verdicts": ["adequate"], "card": card.name}
    return {**own, "calibrate": True, "files": written(folder, records)}


def make_measured(folder: Path, name: str) -> Line:
    own = {"kind": "measured", "hidden": [], "effects": name, "snr": 0.0, "verdicts": []}
    if name in MEASURED:
        raw, edits, file = MEASURED[name]
        with redirect_stdout(sys.stderr):
            bring_in(raw, folder, *edits)
        return {**own, "files": [str(folder / file)]}
    files = sorted(DATA.glob("resistor_run*.csv")) if name == "resistor" else [DATA / f"{name}.csv"]
    return {**own, "files": [str(f.resolve()) for f in files]}


def find_case(_: Path, root: Path, name: str) -> Line:
    """Return the truth of an examination's campaign: a list with `id`, or names with `hidden`."""
    every = json.loads((root / "truth.json").read_text())
    truth = every[name] if isinstance(every, dict) else next(t for t in every if t["id"] == name)
    accept = truth.get("acceptable", [h["accept"] for h in truth.get("hidden", [])])
    kind = {"single": "effect", "inseparable": "effect", "off": "alien"}.get(truth["kind"], truth["kind"])
    hidden = truth.get("hidden", truth.get("effects", []))
    folder = root / "cases" / name
    return {
        "kind": kind,
        "hidden": accept if kind in ("effect", "pair") else [],
        "effects": "+".join(h.get("name", h.get("effect", "?")) for h in hidden),
        "snr": min((h["snr"] for h in hidden if h.get("snr")), default=0.0),
        "verdicts": truth.get("right_verdicts", truth.get("verdicts")),
        "floor": truth.get("noise_floor_rms", {}),
        "tolerated": truth.get("tolerated", []),
        **({"card": str(folder / "card.toml")} if truth.get("card") else {}),
        "files": [str(f) for f in sorted(folder.glob("run_*.csv"))],
    }


def written(folder: Path, records: list[Any]) -> list[str]:
    folder.mkdir(parents=True, exist_ok=True)
    for k, record in enumerate(records):
        write_record(record, folder / f"run_{k}.csv")
    return [str(folder / f"run_{k}.csv") for k in range(len(records))]


def command(*words: str) -> tuple[Line, float, float]:
    """Return what a command answers, its processor time in s and its memory in MB."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        process = subprocess.Popen([sys.executable, "-c", ASK, *words, "--json"], stdout=out, stderr=err)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0), err.seek(0)
        text, error = out.read().decode(), err.read().decode()
    answer = json.loads(text) if process.returncode == 0 else {"verdict": "failed", "error": error[-400:]}
    return answer, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def short(value: Any) -> Any:
    """Numbers to four digits, to keep answers small."""
    if isinstance(value, dict):
        return {k: short(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [short(v) for v in value]
    return float(f"{value:.4g}") if isinstance(value, float) else value


def answer_case(key: str, make: Callable[[Path], Line], data: Path) -> Line:
    """Make a campaign, or find it made, and ask."""
    folder = data / key.replace(":", "-").replace("/", "-")
    kept = folder / "asked.json"
    if not kept.exists():
        folder.mkdir(parents=True, exist_ok=True)
        try:
            kept.write_text(json.dumps(make(folder), default=float))
        except (InputError, ShellError) as error:  # no gyro shows such an effect at this SNR
            return {"case": key, "commit": commit(), "skipped": str(error)}
    truth = json.loads(kept.read_text())
    card = ["--card", truth["card"]] if "card" in truth else []
    answer, seconds, memory = command("diagnose", *truth["files"], *card)
    names = ("effect", "response", "equivalent", "probability", "evidence", "kind", "parameters")
    line = {"case": key, "commit": commit(), "seconds": seconds, "MB": memory, "truth": truth | {"files": len(truth["files"])}}  # fmt: skip
    line |= {"verdict": answer["verdict"], "error": answer.get("error")}
    line["causes"] = [{k: c[k] for k in names if k in c} for c in answer.get("causes", [])]
    line["responses"] = answer.get("responses", {})
    if truth.get("calibrate"):
        found, line["calibrate_seconds"], _ = command("calibrate", truth["card"], *truth["files"])
        # values in °, ppm … as the command gives them: a half width of 90 % is 1.645 standard deviations
        line["posterior"] = {
            v["parameter"]: [v["value"], (v["high"] - v["low"]) / 3.29] for v in found.get("values", [])
        }
        line["calibrated"] = {r: [v["calibrated"], v["noise"]] for r, v in found.get("responses", {}).items()}
    line["truth"].pop("card", None)
    return dict(short(line), card=bool(card))


def campaigns(given: argparse.Namespace) -> Iterator[tuple[str, Callable[[Path], Line]]]:
    """Return keys and makers, the kinds in turn."""
    first = given.seed
    asked = [
        [(f"stranger:{s}", partial(make_stranger, seed=s, first=first)) for s in range(first, first + given.stranger)],
        [(f"card:{s}", partial(make_card, seed=s, ideal=given.ceilings)) for s in range(first, first + given.cards)],
        [(f"device:{s}", partial(make_device, seed=s)) for s in range(first, first + given.devices)],
        [(f"measured:{n}", partial(make_measured, name=n)) for n in (*MEASURED, "resistor", "voltmeter_sweep")] * given.measured,
    ]  # fmt: skip
    for root in given.folder:
        names = sorted(p.name for p in (root / "cases").iterdir())
        asked.append([(f"{root.name}:{n}", partial(find_case, root=root, name=n)) for n in names])
    for group in zip_longest(*asked):
        yield from (one for one in group if one is not None)


def ask(given: argparse.Namespace) -> None:
    """Answer what the file does not hold yet, one line each."""
    done = {line["case"] for line in read_lines(given.answers)} if given.answers.exists() else set()
    data = (given.data or given.answers.with_suffix("")).resolve()
    end = time.monotonic() + 60.0 * given.minutes
    ahead = ((key, make) for key, make in campaigns(given) if key not in done)
    with ProcessPoolExecutor(given.jobs) as pool, given.answers.open("a") as file:
        running = {pool.submit(answer_case, key, make, data) for key, make in islice(ahead, given.jobs)}
        while running:
            finished, running = wait(running, return_when=FIRST_COMPLETED)
            for future in finished:
                line = future.result()
                file.write(json.dumps(line, default=float) + "\n")
                file.flush()
                print(
                    line["case"],
                    line.get("verdict", "skipped"),
                    [c["effect"] for c in line.get("causes", [])],
                    flush=True,
                )
                if time.monotonic() < end:
                    running |= {pool.submit(answer_case, key, make, data) for key, make in islice(ahead, 1)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    doing = parser.add_subparsers(required=True, dest="doing")
    one = doing.add_parser("ask")
    one.add_argument("answers", type=Path)
    one.add_argument("--data", type=Path)
    for kind in ("stranger", "cards", "devices"):
        one.add_argument(f"--{kind}", type=int, default=0)
    one.add_argument("--measured", action="store_true")
    one.add_argument(
        "--ceilings", action="store_true", help="what an ideal detector sees of cards at SNR 3 and below (slow)"
    )
    one.add_argument("--folder", type=Path, action="append", default=[])
    one.add_argument("--seed", type=int, default=910000)
    one.add_argument("--minutes", type=float, default=1e9)
    one.add_argument("--jobs", type=int, default=1)
    two = doing.add_parser("compare")
    two.add_argument("old", type=Path)
    two.add_argument("new", type=Path)
    two.add_argument("--list", action="store_true", help="campaigns whose mark changed")
    given = parser.parse_args()
    if given.doing == "ask":
        ask(given)
    else:
        print(compare(read_lines(given.old), read_lines(given.new), given.list))


if __name__ == "__main__":
    main()
