"""Speed of studies, run by hand: python tests/benchmarks/bench_studies.py [CASES]

Designs per second of a free hemisphere's n = 2 frequency: a plain loop over the solver, a study on one and two processes,
one Dask task a design as a peer would do it, a study on a two-worker Dask cluster, families; Dask's cost per chunk;
and what a million designs take. Everything in one run, on one machine, one thread a process.
"""

import os
import sys
import tempfile
import time
from pathlib import Path

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

CARD = """schema = "hrg.card/1"
name = "free-dome"
[resonator]
shape = "hemisphere"
radius_mm = 15.0
thickness_mm = 0.9
[material]
name = "fused-silica"
"""


def spec_of(card: Path, cases: int, solver: str) -> dict:
    parameters = [
        {"name": "resonator.thickness_mm", "low": 0.8, "high": 1.0},
        {"name": "resonator.radius_mm", "low": 14.0, "high": 16.0},
    ]
    sampling = {"method": "latin-hypercube", "cases": cases, "seed": 1, "solver": solver}
    return {"card": str(card), "sampling": sampling, "parameter": parameters, "quantity": [{"name": "frequency"}]}


def solve_one(card: str, thickness: float, radius: float) -> float:
    from shell.modes import solve_modes
    from studies.instrument.card import load_card
    from studies.sweeps.parameters import set_parameters

    given = {"resonator.thickness_mm": thickness, "resonator.radius_mm": radius}
    instrument = set_parameters(load_card(card), given)
    return solve_modes(*instrument.at(instrument.reference_temperature))[0].frequency


def nothing(_: int) -> None:
    return None


def tell(what: str, cases: int, seconds: float) -> None:
    print(f"{what:52s} {cases:8d} designs {seconds:8.2f} s {cases / seconds:12.1f} /s", flush=True)


def main(cases: int) -> None:
    from studies.sweeps.design import draw
    from studies.sweeps.run import run_study
    from studies.sweeps.spec import read_study

    folder = Path(tempfile.mkdtemp())
    card = folder / "free.toml"
    card.write_text(CARD)
    rows = draw(read_study(spec_of(card, cases, "full"))).values.tolist()
    solve_one(str(card), *rows[0])
    began = time.perf_counter()
    for row in rows:
        solve_one(str(card), *row)
    tell("plain loop over the solver", cases, time.perf_counter() - began)
    for workers in (1, 2):
        began = time.perf_counter()
        run_study(spec_of(card, cases, "full"), folder / f"pool{workers}", workers=workers)
        tell(f"study, {workers} process(es), start and store included", cases, time.perf_counter() - began)
    bench_dask(card, cases, rows, folder)
    for many in (10_000, 1_000_000):
        began = time.perf_counter()
        results = run_study(spec_of(card, many, "family"), folder / f"family{many}")
        tell("study through a family, its solves and the store included", many, time.perf_counter() - began)
        tell("  of which evaluation of the bases", many, results.store.seconds())
        print(f"  largest relative error estimate {(results.errors / results.values).max():.1e}")


def bench_dask(card: Path, cases: int, rows: list, folder: Path) -> None:
    from studies.sweeps.run import run_study

    try:
        from distributed import Client, LocalCluster
    except ImportError:
        print("dask[distributed] is not installed: its part is left out")
        return
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        client.gather(
            [client.submit(solve_one, str(card), *rows[0], pure=False, workers=[w]) for w in client.nthreads()]
        )
        began = time.perf_counter()
        client.gather([client.submit(solve_one, str(card), *row, pure=False) for row in rows])
        tell("peer: one Dask task a design, 2 workers, no store", cases, time.perf_counter() - began)
        began = time.perf_counter()
        run_study(spec_of(card, cases, "full"), folder / "dask", scheduler=cluster.scheduler_address)
        tell("study on the same Dask cluster, store included", cases, time.perf_counter() - began)
        began = time.perf_counter()
        client.gather(client.map(nothing, range(1000), pure=False))
        print(f"Dask overhead per chunk: {1e3 * (time.perf_counter() - began) / 1000:.2f} ms")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
