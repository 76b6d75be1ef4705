"""Speed of the C twin over ten hours at 1 Hz, and its size as an FMU; run by hand.

    python tests/benchmarks/bench_twin.py

Goal: 1 000 times real time, 1 MB.
"""

import tempfile
import time
from pathlib import Path

from studies.instrument.card import load_card, shipped_cards
from studies.twin.fmu import write_fmu
from studies.twin.plan import plan_twin
from tests.studies.twin.building import compile_twin, run_twin, write_profile


def main():
    columns = {"time_s": [0.0, 18000.0, 36000.0], "chamber_temperature_degC": [20.0, -10.0, 40.0]}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        profile = write_profile(folder / "profile.csv", columns)
        for card in sorted(shipped_cards()):
            write_fmu(plan_twin(load_card(card)), folder / "twin.fmu", "3.0")
            program = compile_twin(load_card(card), folder / card, ("-std=c11", "-O2"))
            for seed in ("noiseless", "1"):
                began = time.perf_counter()
                run_twin(program, profile, 1.0, seed, full=False)
                taken = time.perf_counter() - began
                size = (folder / "twin.fmu").stat().st_size
                print(f"{card}, {seed}: {36000 / taken:.0f} times real time; FMU {size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
