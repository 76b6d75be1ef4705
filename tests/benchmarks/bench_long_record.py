"""A 5 h record at 200 Hz (3.6 million rows): read, decimated, fitted stepwise, Allan-analysed; goal 15 s and 2 GB.

Run by hand: python tests/benchmarks/bench_long_record.py [FOLDER]
"""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from studies.record import Record, write_record

ROWS, STEP = 3_600_000, 0.005


def write_long_record(path: Path) -> None:
    """Write the record of one cooling run with white noise and a planted bias."""
    rng = np.random.default_rng(1)
    t = STEP * np.arange(ROWS)
    change = -17.0 * (1 - (3000 * np.exp(-t / 3000) - 900 * np.exp(-t / 900)) / 2100)
    rate = np.gradient(change, t)
    columns = {
        "time_s": np.round(t, 6),
        "frequency_Hz": np.round(4433.0 + change + 0.01 * rng.normal(size=ROWS), 4),
        "bias_deg_per_h": np.round(0.3 * change - 500 * rate + 10 * rng.normal(size=ROWS), 4),
    }
    write_record(Record(columns), path)


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp())
    path = folder / "long.csv"
    if not path.exists():
        write_long_record(path)
    print(f"{path}: {path.stat().st_size / 1e6:.0f} MB, {ROWS:,} rows")
    begin = time.perf_counter()
    command = [
        sys.executable,
        "-c",
        "from studies.cli import run; run()",
        "fit",
        "bias",
        str(path),
        "--save",
        str(folder / "m.toml"),
    ]
    subprocess.run(command, check=True)
    elapsed = time.perf_counter() - begin
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    busy = usage.ru_utime + usage.ru_stime
    print(
        f"hrg fit bias: {elapsed:.1f} s (goal 15), {busy:.1f} s of processor, {usage.ru_maxrss / 1e6:.2f} GB (goal 2)"
    )


if __name__ == "__main__":
    main()
