"""Time and memory of a virtual run of 5 h at 200 Hz (3.6 million rows) in memory; run by hand.

    python tests/benchmarks/bench_virtual_gyro.py

Goal: under 10 s and 1 GB for the run, the shell solver's few solves included.
"""

import resource
import time

from studies.instrument.card import load_card
from studies.simulation.chamber import load_profile
from studies.simulation.virtual_gyro import simulate_run


def main():
    instrument = load_card("hrg-30mm")
    for words, rate in (("step 20 -10 5h", 1.0), ("step 20 -10 5h", 200.0)):
        began = time.perf_counter()
        run = simulate_run(instrument, load_profile(words), rate)
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
        print(f"{words}, {rate:g} Hz: {len(run.record)} rows in {time.perf_counter() - began:.1f} s, {memory:.2f} GB")


if __name__ == "__main__":
    main()
