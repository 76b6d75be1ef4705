"""Large campaign for the diagnosis: hide effects, aliens or nothing, and count what is said.

    python tests/benchmarks/bench_diagnosis.py cases.jsonl --minutes 5 [--kinds null,effect,faint,alien,without,pair]
        [--seed N] [--names-only]                            append cases
    python tests/benchmarks/bench_diagnosis.py cases.jsonl --plan-check
                                                             what `--plan` predicts for the same designs
    python tests/benchmarks/bench_diagnosis.py cases.jsonl --calibrate
                                                             rewrite studies/diagnosis/calibration.toml from the cases
    python tests/benchmarks/bench_diagnosis.py cases.jsonl --ceilings
                                                             add to the file what an ideal detector would see
    python tests/benchmarks/bench_diagnosis.py cases.jsonl --report FILE.md

Cases are appended to the file, so that several runs add up; the seed is drawn and printed unless given.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.benchmarks.diagnosis.cases import KINDS, add_ceilings, collect, read_cases
from tests.benchmarks.diagnosis.summary import summarise


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", type=Path)
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--names-only", action="store_true", help="leave out the held-out residuals")
    parser.add_argument("--plan-check", action="store_true", help="predict the confusion of the cases of the file")
    parser.add_argument("--draws", type=int, default=100, help="cases of each effect that --plan-check predicts")
    parser.add_argument("--calibrate", action="store_true", help="fit the engine's constants on the cases of the file")
    parser.add_argument(
        "--ceilings", action="store_true", help="what an ideal detector would see of the cases of the file"
    )
    parser.add_argument("--report", type=Path)
    arguments = parser.parse_args()
    path = arguments.cases
    if arguments.calibrate:
        from tests.benchmarks.diagnosis.calibrate import write_constants

        print(write_constants(read_cases(path)))
    elif arguments.plan_check:
        from tests.benchmarks.diagnosis.plan_check import check_plan

        print(check_plan(path, arguments.draws))
    elif arguments.ceilings:
        add_ceilings(path)
    elif arguments.report:
        arguments.report.write_text(summarise(read_cases(path)))
    else:
        seed = int(np.random.SeedSequence().entropy % 2**31) if arguments.seed is None else arguments.seed
        print("seed", seed)
        collect(path, arguments.minutes, arguments.kinds.split(","), seed, not arguments.names_only)
        print(summarise(read_cases(path)))


if __name__ == "__main__":
    main()
