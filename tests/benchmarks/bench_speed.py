"""Processor time of single tasks beside their targets, the shortest of several runs: PYTHONPATH=. python tests/benchmarks/bench_speed.py [NAME …].

Names: modes, study, loops, loss, split, twin, run, record. bench_solver.py has the solver beside others.
"""

import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from bench_solver import forget

from compensation.controllers import Loops
from compensation.electronics import Channels, Electronics, LoopNoise
from compensation.rebalance import simulate_rebalance
from compensation.wave import from_quality
from compensation.wave_fit import fit_whole_angle
from compensation.whole_angle import simulate_whole_angle
from shell.elastic import Elastic
from shell.imperfection import CoupledHarmonics, Imperfection, Pair, PointMass, find_split, wave
from shell.meridian import hemisphere
from shell.modes import solve_modes
from shell.resonator import Stem
from studies.instrument.card import load_card, shipped_cards
from studies.loss.model import loss_model
from studies.record import Record, write_record
from studies.simulation.chamber import load_profile
from studies.simulation.virtual_gyro import simulate_run
from studies.sweeps.evaluate import WorkPlan, evaluate_case
from studies.sweeps.run import run_study
from studies.sweeps.spec import read_study
from studies.twin.fmu import write_fmu
from studies.twin.plan import plan_twin
from tests.studies.twin.building import compile_twin, run_twin, write_profile

H = 0.9e-3


def best(work: Callable[[], object], times: int = 1) -> float:
    """Return the shortest processor time of several runs, s; it is the process's own, of which a child's is no part."""
    found = []
    for _ in range(times):
        start = time.process_time()
        work()
        found.append(time.process_time() - start)
    return min(found)


def tell(what: str, seconds: float, target: str = "") -> None:
    print(f"{what:64} {seconds:9.4f} s{f'  (target {target})' if target else ''}", flush=True)


def modes() -> None:
    """One mode with the operators of its geometry kept, several, to other tolerances; and from a card, with nothing kept."""
    silica, dome = Elastic(72.7e9, 0.17, 2203.0), hemisphere(15e-3, H)
    for n, count, tolerance in ((2, 1, 1e-5), (2, 16, 1e-5), (5, 8, 1e-5), (20, 1, 1e-5), (2, 1, 1e-3), (2, 1, 1e-7)):

        def solve(n: int = n, count: int = count, tolerance: float = tolerance) -> object:
            return solve_modes(dome, silica, n, count, tolerance=tolerance)

        solve()
        tell(f"{count} of n = {n} of the free dome to {tolerance:g}", best(solve, 10))

    def from_card(name: str) -> None:
        forget()
        card = load_card(name)
        solve_modes(card.resonator, card.material.elastic(card.reference_temperature))

    for name in shipped_cards():
        tell(f"from the card {name} to its frequency", best(lambda name=name: from_card(name), 20))


def study() -> None:
    """Designs of a free dome: a plain loop over the solver, studies on one and two processes, and through a family."""
    ranges = [{"name": f"resonator.{key}", "low": low, "high": high} for key, low, high in (("thickness_mm", 0.8, 1), ("radius_mm", 14, 16))]  # fmt: skip

    def spec(cases: int, solver: str) -> dict[str, object]:
        sampling = {"method": "latin-hypercube", "cases": cases, "seed": 1, "solver": solver}
        return {"card": "free-dome", "sampling": sampling, "parameter": ranges, "quantity": [{"name": "frequency"}]}

    plan, rng = WorkPlan.of(read_study(spec(1, "full"))), np.random.default_rng(1)
    designs = [{one["name"]: float(rng.uniform(one["low"], one["high"])) for one in ranges} for _ in range(200)]
    tell("plain loop over 200 designs", best(lambda: [evaluate_case(plan, design) for design in designs]))
    for cases, solver, workers in ((200, "full", 1), (200, "full", 2), (10_000, "family", 1), (1_000_000, "family", 1)):
        with tempfile.TemporaryDirectory() as folder:
            began = time.perf_counter()
            run_study(spec(cases, solver), folder, workers=workers).close()
            tell(f"study of {cases} designs, {solver}, {workers} process(es), its store included", time.perf_counter() - began)  # fmt: skip


def loops() -> None:
    """Ten hours of a gyro's loops, held and free, with every error of the electronics and noise."""
    gyro = from_quality(
        4432.0, 1e7, damping_anisotropy=0.01, damping_axis=0.2, frequency_split=5e-3, frequency_axis=0.1
    )
    drive = Channels(-0.02, 0.001, 0.002, 5e-4, 0.02)
    electronics = Electronics(Channels(0.01, 0.002, 0.003, 0.001, 0.01), drive, LoopNoise(1e-6, 1e-5, 5e-5))
    rows, rate = np.arange(0.0, 36000.0), 7e-5
    noisy = np.random.default_rng(1)
    held = best(lambda: simulate_rebalance(gyro, electronics, Loops(), rows, rate=rate, angle=0.4, generator=noisy))
    tell("force to rebalance, 36000 rows of 1000 samples", held, "10 s")
    turn = np.radians(0.5) * np.where(rows < 18000, 1.0, -1.0)
    runs = []
    free = best(lambda: runs.append(
        simulate_whole_angle(gyro, electronics, Loops(), rows, rate=rate, precession=turn, generator=noisy)
    ))  # fmt: skip
    tell("whole angle, self-precession of 0.5 °/s", free, "10 s")
    seen = {"decay": runs[0].decay, "frequency": runs[0].omega, "quadrature": runs[0].quadrature}
    tell("its fit", best(lambda: fit_whole_angle(rows, runs[0].angle, runs[0].rate, coupling=gyro.coupling, **seen)))


def loss() -> None:
    """The budget after the mode is solved, seven temperatures, a card with a film, gas and an activated loss."""
    film = {"material": "gold", "thickness_nm": 100.0, "loss": 1e-4}
    parts = {"pressure_Pa": 1e-3, "film": [film], "activated": [{"height": 1e-9, "energy_eV": 0.5, "peak_degC": 120.0}]}
    for name in ("free-dome", "hrg-30mm", "cvg-25mm", "bvg-bell"):
        card = load_card(name).with_table("loss", parts)
        loss_model(card)  # the mode
        tell(
            f"loss of {name}",
            best(lambda card=card: loss_model(card).budget(np.linspace(253.15, 313.15, 7)), 5),
            "50 ms",
        )
        if card.resonator.stem is not None:
            tell("  with its anchor", best(lambda card=card: loss_model(card, anchor=True), 2), "2 s")


def split() -> None:
    """First order after a solved mode, cold and again; coupled harmonics, prepared; and how far the two lie apart."""
    silica, one = Elastic(72.7e9, 0.17, 2203.0), Imperfection(thickness=wave(4, 0.01 * H, 0.3))
    waves = wave(1, 0.02 * H) + wave(3, 0.01 * H, 0.4) + wave(4, 0.01 * H, 0.3)
    three = Imperfection(thickness=waves, masses=(PointMass(1e-8, 0.2),))
    stem = {"support": "stem", "stem": Stem(2.5e-3, -5e-3, 0.5e-3)}
    for name, more in (("free dome", {}), ("dome on a stem", stem)):
        (mode,) = solve_modes(hemisphere(radius=15e-3, thickness=H, **more), silica, 2)
        _ = mode.solution.strain, mode.solution.displacement, mode.solution.eigenvalue
        pair, coupled = Pair(mode), CoupledHarmonics(mode, silica)
        tell(f"{name}: first order", best(lambda mode=mode: find_split(Pair(mode), one), 15))
        tell("  again", best(lambda pair=pair: find_split(pair, one), 15))
        coupled.solve(three)
        for words, flaw in (("one wave", one), ("three waves and a mass", three)):
            tell(f"  coupled, {words}", best(lambda c=coupled, flaw=flaw: c.solve(flaw), 60), "10 ms")
        small = coupled.solve(Imperfection(thickness=wave(4, 1e-5 * H))).relative / 1e-5
        print(f"  first order differs by {coupled.solve(one).relative / 1e-2 / small - 1:.1e} at 1 % of the thickness")


def twin() -> None:
    """The C twin over ten hours at 1 Hz, and its size as an FMU."""
    columns = {"time_s": [0.0, 18000.0, 36000.0], "chamber_temperature_degC": [20.0, -10.0, 40.0]}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        profile = write_profile(folder / "profile.csv", columns)
        for card in sorted(shipped_cards()):
            write_fmu(plan_twin(load_card(card)), folder / "twin.fmu", "3.0")
            program = compile_twin(load_card(card), folder / card, ("-std=c11", "-O2"))
            began = time.perf_counter()
            run_twin(program, profile, 1.0, "1", full=False)
            size = (folder / "twin.fmu").stat().st_size
            tell(f"twin of {card}, FMU of {size / 1000:.0f} kB", time.perf_counter() - began, "36 s, 1 MB")


def run() -> None:
    """A virtual run of 5 h at 1 and 200 Hz in memory, the solver's few solves included."""
    card = load_card("hrg-30mm")
    for rate in (1.0, 200.0):
        spent = best(lambda rate=rate: simulate_run(card, load_profile("step 20 -10 5h"), rate))
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
        tell(f"5 h at {rate:g} Hz, {memory:.2f} GB at most", spent, "10 s, 1 GB")


def record() -> None:
    """A 5 h record at 200 Hz (3.6 million rows): read, decimated, fitted stepwise, Allan-analysed."""
    rng, t = np.random.default_rng(1), 0.005 * np.arange(3_600_000)
    change = -17.0 * (1 - (3000 * np.exp(-t / 3000) - 900 * np.exp(-t / 900)) / 2100)
    bias = 0.3 * change - 500 * np.gradient(change, t) + 10 * rng.normal(size=t.size)
    frequency = np.round(4433.0 + change + 0.01 * rng.normal(size=t.size), 4)
    with tempfile.TemporaryDirectory() as folder:
        path = f"{folder}/long.csv"
        write_record(
            Record({"time_s": np.round(t, 6), "frequency_Hz": frequency, "bias_deg_per_h": np.round(bias, 4)}), path
        )
        words = ["fit", "bias", path, "--save", f"{folder}/m.toml"]
        began = time.perf_counter()
        subprocess.run([sys.executable, "-c", "from studies.cli import run; run()", *words], check=True)
        memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e6
        tell(f"hrg fit bias, {memory:.2f} GB at most", time.perf_counter() - began, "15 s, 2 GB")


TASKS = {one.__name__: one for one in (modes, study, loops, loss, split, twin, run, record)}


if __name__ == "__main__":
    for chosen in sys.argv[1:] or TASKS:
        TASKS[chosen]()
