"""Every effect of the library in every response: hidden, diagnosed with the card, saved, and held against a chamber profile that is new.

    python tests/benchmarks/bench_recovery.py [--only NAME ...] [--times 20] [--draws 1] [--moved] [--record]

Residual of the saved card on the new run over its noise, 1 being the noise: of the card as given → saved, and in brackets what the
saved card's own uncertainties let expect: two runs whose noise walks do not tell more. The target is 1.10 of the noise, or an error
within the 1.96 standard deviations that 95 % of draws of the noise leave; over many draws (`--draws`, each case with so many) the
rms of the errors is that of the standard deviations stated. Recorded are the frequency and the response that has the effect. `--moved`: the device also differs from the card that the diagnosis is given, by one standard deviation of four values
of heat path and law.
"""

import argparse
import time

import numpy as np

from tests.benchmarks import history
from tests.benchmarks.diagnosis.unseen import DEVIATIONS, HIDDEN, MOVED, RESPONSES, TIMES, TURN_ON, recover

LIMIT = 1.1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=())
    parser.add_argument("--times", type=float, default=TIMES)
    parser.add_argument("--draws", type=int, default=1)
    parser.add_argument("--moved", action="store_true")
    parser.add_argument("--record", action="store_true")
    given = parser.parse_args()
    cases = [key for key in HIDDEN if not given.only or key[0] in given.only]
    found, began = [], time.process_time()
    print(f"{'effect':24} {'response':15} {'verdict':16} named  " + "".join(f"{r:>24}" for r in RESPONSES) + "  causes")
    for name, response in cases:
        stated = TURN_ON if (name, response) == ("ageing", "bias_deg_per_h") else None
        for seed in range(given.draws):
            moved = MOVED if given.moved else ()
            one = recover((name, response), times=given.times, seed=seed, moved=moved, stated=stated)
            found.append(one)
            ratios = "".join(
                f"{one.before[r]:9.1f} →{one.after[r]:6.2f} ({one.stated[r]:.2f})" if r in one.after else " " * 24
                for r in RESPONSES
            )
            line = f"{name:24} {response:15} {one.verdict:16} {'yes' if one.named else 'NO':5} {ratios}"
            print(f"{line}  {', '.join(one.names)}", flush=True)
    named = sum(one.named for one in found)
    held = {r: [one for one in found if r in one.after] for r in RESPONSES}
    within = {r: sum(one.after[r] <= LIMIT for one in own) for r, own in held.items()}
    as_stated = {r: sum(one.after[r] <= LIMIT or one.errors[r] <= DEVIATIONS for one in own) for r, own in held.items()}
    every = sum(max(one.after.values()) <= LIMIT for one in found)
    print(f"{named} of {len(found)} named; in every response within 10 % of the noise: {every}")
    for r, own in held.items():
        if own:
            ratio = np.sqrt(sum(one.after[r] ** 2 - 1 for one in own) / sum(one.stated[r] ** 2 - 1 for one in own))
            print(
                f"{r}: within 10 % of the noise {within[r]} of {len(own)}, or of what 95 % of draws leave {as_stated[r]}; "
                f"errors over stated: rms of each {np.sqrt(np.mean([one.errors[r] ** 2 for one in own])):.2f}, of all {ratio:.2f}"
            )
    print(f"{time.process_time() - began:.0f} s of processor time")
    if given.record:
        counts = {"named": named, "within": within, "as_stated": as_stated, "every": every, "draws": given.draws}
        history.record("recovery", cases=len(found), times=given.times, moved=given.moved, **counts)


if __name__ == "__main__":
    main()
