"""Every effect of the library in every response: hidden, diagnosed with the card, saved, and held against a chamber profile that is new.

    python tests/benchmarks/bench_recovery.py [--only NAME ...] [--times 20] [--moved] [--record]

Residual of the saved card on the new run over its noise, 1 being the noise: of the card as given → saved, and in brackets what the
saved card's own uncertainties let expect: two runs whose noise walks do not tell more. The target is 1.10, of the noise and of what
is stated. `--moved`: the device also differs from the card that the diagnosis is given, by one standard deviation of four values
of heat path and law.
"""

import argparse
import time

from tests.benchmarks import history
from tests.benchmarks.diagnosis.unseen import HIDDEN, MOVED, RESPONSES, TIMES, TURN_ON, recover

LIMIT = 1.1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=())
    parser.add_argument("--times", type=float, default=TIMES)
    parser.add_argument("--moved", action="store_true")
    parser.add_argument("--record", action="store_true")
    given = parser.parse_args()
    cases = [key for key in HIDDEN if not given.only or key[0] in given.only]
    found, began = [], time.process_time()
    print(f"{'effect':24} {'response':15} {'verdict':16} named  " + "".join(f"{r:>24}" for r in RESPONSES) + "  causes")
    for name, response in cases:
        stated = TURN_ON if (name, response) == ("ageing", "bias_deg_per_h") else None
        one = recover((name, response), times=given.times, moved=MOVED if given.moved else (), stated=stated)
        found.append(one)
        ratios = "".join(f"{one.before[r]:9.1f} →{one.after[r]:6.2f} ({one.stated[r]:.2f})" for r in RESPONSES)
        line = f"{name:24} {response:15} {one.verdict:16} {'yes' if one.named else 'NO':5} {ratios}  {', '.join(one.names)}"
        print(line, flush=True)
    named = sum(one.named for one in found)
    within = {r: sum(one.after[r] <= LIMIT for one in found) for r in RESPONSES}
    every = sum(max(one.after.values()) <= LIMIT for one in found)
    as_stated = {r: sum(one.after[r] <= LIMIT * one.stated[r] for one in found) for r in RESPONSES}
    print(
        f"{named} of {len(found)} named; within 10 % of the noise: " + ", ".join(f"{r} {n}" for r, n in within.items())
    )
    print("within 10 % of what is stated: " + ", ".join(f"{r} {n}" for r, n in as_stated.items()))
    print(f"in every response: {every} of {len(found)}; {time.process_time() - began:.0f} s of processor time")
    if given.record:
        counts = {"named": named, "within": within, "as_stated": as_stated, "every": every}
        history.record("recovery", cases=len(found), times=given.times, moved=given.moved, **counts)


if __name__ == "__main__":
    main()
