"""A factory's lot of virtual gyros with planted odd devices and a bad batch: who is found, who is named besides, time and memory.

    python tests/benchmarks/fleet.py FOLDER [--devices 200] [--odd 5] [--bad 8] [--seed 1] [--workers 2] [--pages]

The lot is written to FOLDER/lot once; answers are kept in FOLDER/answers with --pages, so that the run goes on where it was stopped.
"""

import argparse
import json
import resource
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from studies.fleet.folder import read_lot
from studies.fleet.run import run_lot
from studies.progress import Progress
from studies.sweeps.engine import hire
from tests.studies.fleet.lots import CARD, make_lot

BATCH = 20


def main() -> None:
    """Make a lot, ask about it and print what was planted beside what was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    for name, default in (("devices", 200), ("odd", 5), ("bad", 8), ("seed", 1), ("workers", 2)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--pages", action="store_true")
    given = parser.parse_args()
    lot, planted = given.folder / "lot", given.folder / "planted.json"
    if not planted.exists():
        chosen = np.random.default_rng(given.seed).permutation(given.devices)
        odd, bad = chosen[: given.odd].tolist(), chosen[given.odd : given.odd + given.bad].tolist()
        made = make_lot(lot, given.devices, odd, bad, given.seed, BATCH)
        planted.write_text(json.dumps({"odd": made.odd, "batch": made.batch}))
    truth = json.loads(planted.read_text())
    begin = time.monotonic()
    out = str(given.folder / "answers") if given.pages else None
    devices = read_lot(str(lot), CARD)
    with Progress(len(devices), shown=True) as progress:
        found = run_lot(devices, out, hire(given.workers), progress)
    hours = (time.monotonic() - begin) / 3600.0
    who = resource.RUSAGE_CHILDREN if given.workers > 1 else resource.RUSAGE_SELF
    used = resource.getrusage(who)
    (given.folder / "lot.json").write_text(json.dumps(found.as_dict()))
    print(f"planted: odd {sorted(truth['odd'])}, batch {truth['batch']}")
    print(f"found: odd {sorted(found.odd)}, batches {sorted(found.bad_batches)}, failed {sorted(found.failed)}")
    for serial in found.odd:
        print(f"  {serial}: {'; '.join(found.reasons[serial])}")
    for one in found.shares:
        print(
            f"  {one.effect} in {one.response}: {one.kind}, {len(one.having)} have it, {len(one.lacking)} lack it, odd {one.odd}"
        )
    cpu = (used.ru_utime + used.ru_stime) / len(found.answers)
    print(f"{hours:.2f} h, {cpu:.1f} s of processor a device, {used.ru_maxrss / 1024:.0f} MB in the largest process")


if __name__ == "__main__":
    main()
