"""Draws a campaign: device, protocol, hidden causes scaled to their SNR, noise; writes its files."""

import datetime
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.stranger.aliens import ALIENS
from tests.stranger.baseline import COLUMN, Fitted, Rows, fit_all, orthonormal, rms
from tests.stranger.effects import EFFECTS, JUDGED, Effect, Shape
from tests.stranger.files import write_campaign
from tests.stranger.network import Network, draw_network, housing_of, integrate
from tests.stranger.noise import FAMILIES, draw_noise
from tests.stranger.protocol import DRIVE, PROTOCOLS, Run, add_drive, draw_runs, sample_times
from tests.stranger.rivals import nearest, rivals, seen_in
from tests.stranger.truth import Hidden, Truth

KINDS = ("effect", "pair", "null", "alien")
LARGEST = {"radiation": 1.0, "second-lag": 0.5, "thermometer-scale": 0.2}
ABSORBED = {"temperature": "frequency", "clock": "frequency", "reading": "frequency"}


@dataclass
class Cause:
    effect: Effect
    target: str
    shape: Shape
    size: float = 0.0

    @property
    def response(self) -> str:
        return ABSORBED.get(self.target, self.target)


@dataclass
class Device:
    """f(T) = f₀ (1 + s x + c x² + spread d x³), x = T − 20 °C; bias a cubic of that change; 1/Q a quadratic of T."""

    network: Network
    f0: float
    law: tuple[float, float, float]
    bias: tuple[float, float, float]
    offsets: np.ndarray
    loss: tuple[float, float, float]
    spread: float = 1.0

    def responses(self, runs: list[Run], causes: list[Cause], present: list[str]) -> dict[str, list[np.ndarray]]:
        """Clean responses on the grid, with `reading` and `reference`."""
        out: dict[str, list[np.ndarray]] = {key: [] for key in (*present, "reading", "reference")}
        for i, run in enumerate(runs):
            add = dict.fromkeys(("temperature", "frequency", "bias", "inverse_q", "clock", "reading"), 0.0)
            for cause in causes:
                add[cause.target] = add[cause.target] + cause.size * cause.shape[i]
            x = run.mode + add["temperature"] - 20
            s, c, d = self.law
            change = self.f0 * (s * x + c * x**2 + self.spread * d * x**3)
            physical = self.f0 + change + add["frequency"]
            out["reference"].append(physical)
            out["frequency"].append(physical * (1 + add["clock"]))
            out["reading"].append(run.housing + add["reading"])
            if "bias" in out:
                b1, b2, b3 = self.bias
                out["bias"].append(self.offsets[i] + b1 * change + b2 * change**2 + b3 * change**3 + add["bias"])
            if "inverse_q" in out:
                q0, q1, q2 = self.loss
                out["inverse_q"].append(q0 * (1 + q1 * x + q2 * x**2) + add["inverse_q"])
        return out


def _device(rng: np.random.Generator, count: int) -> Device:
    return Device(
        network=draw_network(rng),
        f0=4432.07 * (1 + rng.normal(0, 1e-3)),
        law=(rng.uniform(77e-6, 88e-6), rng.uniform(-1.0e-7, -0.5e-7), rng.normal(0, 1e-9)),
        bias=(rng.normal(0, 0.6), rng.normal(0, 0.05), rng.normal(0, 0.003)),
        offsets=rng.normal(0, 1) + rng.normal(0, 0.2, count),
        loss=(rng.uniform(0.6e-7, 2e-7), rng.uniform(-4e-3, 4e-3), rng.uniform(0, 4e-5)),
    )  # fmt: skip


def make_campaign(seed: int, kind: str, effect: str | None = None, snr: float | None = None,
                  runs: int | None = None, *, folder: str | Path) -> Truth:  # fmt: skip
    """Write one campaign into `folder` and return what it hides."""
    rng = np.random.default_rng([seed, zlib.crc32(f"{kind}/{effect}".encode())])
    names = _names(rng, kind, effect)
    snr = float(rng.choice([0.3, 1, 3, 6, 12])) if snr is None else snr
    table = ALIENS if kind == "alien" else EFFECTS
    chosen = [table[n] for n in names]
    needs = {need for e in chosen for need in e.needs}
    count = int(rng.choice([1, 1, 2, 2, 3, 4, 5, 6])) if runs is None else runs
    protocol = _protocol(rng, names, needs, count)
    done = draw_runs(rng, protocol, count)
    varied = needs & set(DRIVE)
    add_drive(rng, done, varied, {n for n in DRIVE if rng.random() < 0.25})
    device = _device(rng, count)
    targets = [str(rng.choice(e.targets)) for e in chosen]
    present = ["frequency"]
    for name, chance in (("bias", 0.85), ("inverse_q", 0.5)):
        if rng.random() < chance or name in targets:
            present.append(name)
    sigma = {
        "frequency": np.exp(rng.uniform(np.log(5e-4), np.log(1e-2))),
        "bias": np.exp(rng.uniform(np.log(0.02), np.log(0.4))),
        "inverse_q": device.loss[0] * np.exp(rng.uniform(np.log(1e-3), np.log(1e-2))),
    }
    fixed = effect if kind == "null" and effect else None
    family = {r: fixed or str(rng.choice(FAMILIES, p=[0.35, 0.15, 0.1, 0.15, 0.15, 0.1])) for r in present}
    memory = rng.uniform(20, 300)
    rich = kind in ("effect", "pair") and snr >= 1 and rng.random() < 0.33
    state = int(rng.integers(2**62))
    for attempt in range(5):
        again = np.random.default_rng(state)
        dt, times, rows, pick = _sampling(again, device, done, present, sigma, 0.05 * snr if rich else None)
        unit = {r: [draw_noise(family[r], t, again, memory) for t in times] for r in present}
        allowed = 0.05 * snr if rich else 2 / np.sqrt(sum(map(len, times)))
        departure = _settle(device, done, rows, present, sigma, allowed)
        causes = [Cause(e, t, e.draw(done, again)) for e, t in zip(chosen, targets, strict=True)]
        noise = {r: np.concatenate([sigma[r] * u[p] for u, p in zip(unit[r], pick, strict=True)]) for r in present}
        reached = [_scale(c, snr, device, done, rows, noise, present) for c in causes]
        weak = [(c, got) for c, got in zip(causes, reached, strict=True) if got < 0.95 * snr]
        if attempt == 4 or not (weak or (kind == "alien" and _familiar(causes[0], device, done, rows, present, again))):
            break
        state += not weak
        for cause, got in weak:
            sigma[cause.response] *= max(got / snr, 0.02)
    noise_full = [{r: sigma[r] * unit[r][i] for r in present} for i in range(count)]
    clean = device.responses(done, causes, present)
    bare = device.responses(done, [], present)
    reference = kind != "null" and (("reference" in needs and rng.random() < 0.6) or rng.random() < 0.1)
    starts = protocol == "far" or "starts" in needs or rng.random() < 0.6
    hidden = []
    barred = {"clock-drift"} if reference else set()
    for cause, got in zip(causes, reached, strict=True):
        fit, structure = _structure([cause], cause.response, device, done, rows, present)
        r = cause.response
        draws = [
            _cells(times, pick, [sigma[r] * draw_noise(family[r], t, rng, memory) for t in times]) for _ in range(24)
        ]
        seen = seen_in(structure, fit, draws)
        right = {cause.effect.name: "hidden"}
        if kind != "alien":
            slope = device.f0 * device.law[0]
            sealed = set(EFFECTS) if reference and cause.target == "clock" else barred
            left = nearest(cause.effect.name, r, structure, fit, rows, done, slope, sealed, rng)
            right = rivals(cause.effect.name, left, fit, draws)
            if cause.target == "clock" and not reference:
                right["ageing"] = "without a reference clock, a drift of the clock is one of the resonator"
        hidden.append(Hidden(cause.effect.name, r, got, seen, right))
    floor = _floor(times, noise_full, device.network.main_s, ("frequency", "bias", "inverse_q"))
    own = _floor(times, noise_full, device.network.main_s, ("frequency",))
    truth = Truth(
        seed, kind, tuple(hidden), _verdicts(kind, hidden), floor, own, family, (protocol,) * count,
        ("second-lag", "curvature", "radiation") if rich else (), departure * np.sqrt(sum(map(len, times))),
        tuple(f"run_{i + 1}.csv" for i in range(count)), dt, starts, device.network.main_s, memory,
        [{"time_s": t} | {k: np.interp(t, run.time, v[i]) for k, v in clean.items()} for i, (t, run) in enumerate(zip(times, done, strict=True))],
        noise_full,
        [{k: np.interp(t, run.time, v[i]) for k, v in bare.items()} for i, (t, run) in enumerate(zip(times, done, strict=True))],
    )  # fmt: skip
    begin = datetime.datetime(2024, 1, 1) + datetime.timedelta(hours=float(rng.integers(0, 5000)))
    write_campaign(Path(folder), truth, done, times, sigma, begin if starts else None, bool(reference), rng)
    return truth


def _names(rng: np.random.Generator, kind: str, effect: str | None) -> list[str]:
    if kind not in KINDS:
        raise ValueError(f"kind is one of {', '.join(KINDS)}")
    if kind == "null":
        return []
    if kind == "pair":
        return effect.split("+") if effect else [str(n) for n in rng.choice(list(JUDGED), 2, replace=False)]
    return [effect or str(rng.choice(list(ALIENS if kind == "alien" else JUDGED)))]


def _protocol(rng: np.random.Generator, names: list[str], needs: set[str], count: int) -> str:
    possible = [p for p in PROTOCOLS if not (p == "far" and count < 2)]
    if "returns" in needs:
        possible = [p for p in possible if p not in ("paper-step", "far", "soak")]
    if "hysteresis" in names:
        possible = ["cycles", "ramp"]
    return str(rng.choice(possible))


def _sampling(
    rng: np.random.Generator,
    device: Device,
    runs: list[Run],
    present: list[str],
    sigma: dict[str, float],
    limit: float | None,
) -> tuple[float, list[np.ndarray], Rows, list[np.ndarray]]:
    """Draw rows from which the drive of the baseline can be had: a step missed between two rows is no effect."""
    total = sum(r.time[-1] for r in runs)
    _let_run(device, runs, 1e-3)
    possible = [d for d in (1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0) if total / d < 30000]
    for dt in possible[int(rng.integers(0, len(possible))) :: -1]:
        for holes in (True, True, False):
            times = sample_times(rng, runs, dt, holes)
            pick = [np.unique(np.linspace(0, len(t) - 1, max(150, 1500 // len(runs))).astype(int)) for t in times]
            rows = Rows([t[p] for t, p in zip(times, pick, strict=True)], [r.time for r in runs], times)
            worst = _departure(device, runs, rows, present, sigma)
            if worst < 0.5 * (limit or 2 / np.sqrt(sum(map(len, times)))):
                return dt, times, rows, pick
    return dt, times, rows, pick


def _let_run(device: Device, runs: list[Run], spread: float) -> None:
    """The courses of the bare device at this spread."""
    device.spread = spread
    network = device.network.scaled(spread)
    for run in runs:
        run.main_s = network.main_s
        run.housing = housing_of(network, run.chamber)
        run.mode, run.stem = integrate(network, run.housing, run.start_offset)


def _departure(device: Device, runs: list[Run], rows: Rows, present: list[str], sigma: dict[str, float]) -> float:
    """What the baseline leaves of the bare device, the worst response, over the noise."""
    fits = _fit(device, [], runs, rows, present)
    return max(rms(fits[r].residual) / sigma[r] for r in present)


def _settle(
    device: Device, runs: list[Run], rows: Rows, present: list[str], sigma: dict[str, float], allowed: float
) -> float:
    """Bring the device's own departures from the baseline (chain, T⁴, cubic law) below `allowed` noise."""
    spread = 1.0
    for _ in range(12):
        _let_run(device, runs, spread)
        worst = _departure(device, runs, rows, present, sigma)
        if worst <= allowed:
            break
        spread *= min(0.6, 0.8 * allowed / worst)
    return worst


def _fit(device: Device, causes: list[Cause], runs: list[Run], rows: Rows, present: list[str]) -> dict[str, Fitted]:
    grid = device.responses(runs, causes, present)
    return fit_all(rows, rows.recorded(grid["reading"]), {r: rows.at(grid[r]) for r in present}, device.network.main_s)


def _structure(
    causes: list[Cause], r: str, device: Device, runs: list[Run], rows: Rows, present: list[str]
) -> tuple[Fitted, np.ndarray]:
    needed = ["frequency"] if r == "frequency" else ["frequency", r]
    fit = _fit(device, causes, runs, rows, needed)[r]
    return fit, fit.residual


def _scale(
    cause: Cause,
    snr: float,
    device: Device,
    runs: list[Run],
    rows: Rows,
    noise: dict[str, np.ndarray],
    present: list[str],
) -> float:
    """Find the size whose refitted residual is `snr` times the projected noise; return the SNR reached."""
    r, most = cause.response, LARGEST.get(cause.effect.name, np.inf)
    unit = {"temperature": device.f0 * device.law[0], "clock": device.f0, "reading": device.f0 * device.law[0]}
    cause.size = min(
        snr
        * rms(noise[r])
        / (rms(rows.at(cause.shape) - rows.at(cause.shape).mean()) * unit.get(cause.target, 1) + 1e-300),
        most,
    )
    got = 0.0
    for _ in range(10):
        fit, left = _structure([cause], r, device, runs, rows, present)
        got = rms(left) / rms(fit.project(noise[r]))
        if abs(got / snr - 1) < 0.01 or (cause.size >= most and got < snr):
            break
        cause.size = min(cause.size * float(np.clip(snr / got, 0.1, 10)), most)
    return got


def _familiar(
    alien: Cause, device: Device, runs: list[Run], rows: Rows, present: list[str], rng: np.random.Generator
) -> bool:
    """Whether some known effect happens to remove seven tenths of an alien's structure (drawn again then)."""
    fit, structure = _structure([alien], alien.response, device, runs, rows, present)
    left = nearest("", alien.response, structure, fit, rows, runs, device.f0 * device.law[0], set(), rng)
    return min(rms(v) for v in left.values()) < 0.3 * rms(structure)


def _cells(times: list[np.ndarray], pick: list[np.ndarray], values: list[np.ndarray]) -> np.ndarray:
    """Mean over the rows that each thinned row stands for."""
    return np.concatenate(
        [np.add.reduceat(v, p) / np.diff(np.r_[p, len(v)]) for v, p in zip(values, pick, strict=True)]
    )


def _floor(
    times: list[np.ndarray], noise: list[dict[str, np.ndarray]], tau: float, start: tuple[str, ...]
) -> dict[str, float]:
    """Take every run's offset out of its noise, and in the responses of `start` an initial state that fades."""
    out = {}
    for r in noise[0]:
        left = []
        for t, n in zip(times, noise, strict=True):
            basis = orthonormal(np.column_stack([np.ones_like(t), np.exp(-t / tau)])[:, : 2 if r in start else 1])
            left.append(n[r] - basis @ (basis.T @ n[r]))
        out[COLUMN[r]] = rms(np.concatenate(left))
    return out


def _verdicts(kind: str, hidden: list[Hidden]) -> tuple[str, ...]:
    known = ("unexplained",) if kind == "alien" else ("explained", "not-identifiable")
    if kind == "null":
        return ("adequate",)
    return (*known, "adequate") if all(h.detectability < 3 for h in hidden) else known
