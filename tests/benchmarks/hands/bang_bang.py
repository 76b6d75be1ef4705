"""Hand B: campaigns of virtual gyroscopes in a temperature chamber, with one hidden cause each (or none, or two, or an alien)."""
from __future__ import annotations

import argparse
import json
import os
import subprocess
import tempfile
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Callable

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter
from scipy.sparse import csr_matrix

Array = np.ndarray
Delta = dict[str, Array]  # of one run: Tr (resonator), Tm (thermometer), f, b, q
G = 20.0  # grid of the inner simulation, s
COLUMN = {"f": "frequency_Hz", "b": "bias_deg_per_h", "q": "inverse_q"}
DRIVE = {"A": "drive_amplitude_V", "V": "electrode_bias_V", "Q": "quadrature_V", "P": "pattern_angle_deg"}
NEEDS = {"self-heating": "A", "amplitude-frequency": "A", "electrostatic-softening": "V", "quadrature-leakage": "Q", "axis-rotation": "P"}
THERMAL = ["second-lag", "radiation", "self-heating", "thermometer-scale", "thermometer-lag", "clock-offset"]
ACTS: dict[str, str] = {**{n: "fbq" for n in THERMAL}, "rate-bias": "b", "rate-frequency": "f", "hysteresis": "fbq", "ageing": "fbq", "jump": "fbq",
    "activity-dip": "f", "electrostatic-softening": "f", "amplitude-frequency": "f", "curvature": "f", "cross-damping": "b", "loss-peak": "q",
    "leak": "q", "periodic": "fbq", "clock-drift": "f", "quadrature-leakage": "b", "axis-rotation": "b", "mounting-stress": "fb"}
POSITIVE = {"self-heating", "electrostatic-softening", "loss-peak", "leak", "radiation", "thermometer-lag", "second-lag"}
ALIENS = {"telegraph": "fb", "heater-interference": "fb", "beat-chirp": "fb", "slip-ratchet": "fb", "frost": "f", "shock-train": "fb",
    "desorption": "q", "table-glitches": "b", "lab-air": "fb"}
# true, rival, responses, drives, longest number of runs
INSEPARABLE = [("clock-drift", "f", "", 1), ("ageing", "f", "", 1), ("electrostatic-softening", "f", "AV", 2), ("amplitude-frequency", "f", "AV", 2),
    ("leak", "q", "", 1), ("curvature", "f", "", 1), ("thermometer-scale", "f", "", 1), ("rate-frequency", "f", "", 1), ("second-lag", "f", "", 1),
    ("mounting-stress", "f", "", 1), ("thermometer-lag", "f", "", 1), ("hysteresis", "b", "", 1)]


def lag(x: Array, tau: float, start: float | None = None) -> Array:
    """First-order lag on the grid, exact for an input linear between its points; starts settled unless told."""
    tau = max(tau, 1e-3)
    e = float(np.exp(-G / tau))
    now, before = 1 - tau / G * (1 - e), tau / G * (1 - e) - e
    return lfilter([now, before], [1, -e], x, zi=[(x[0] if start is None else start) - now * x[0]])[0]


@dataclass
class Run:
    start: float  # absolute, s
    chamber: Array
    heater: Array
    housing: Array
    resonator: Array
    drives: dict[str, Array]
    rows: Array = field(default_factory=lambda: np.zeros(0))
    extra: dict[str, Array] = field(default_factory=dict)  # what the card's simulation has beyond a law of the mean temperature
    wake: float = 0.0  # kelvin below its settled state at power-on

    @property
    def t(self) -> Array:
        return np.arange(self.chamber.size) * G


@dataclass
class World:
    runs: list[Run]
    records: int  # the runs after these are unseen
    tau: float
    law: Callable[[Array], Array]
    bias: Callable[[Array], Array]
    loss: Callable[[Array], Array]
    responses: str
    columns: list[str]
    noise: dict[str, float]
    thin_q: int

    def base(self, key: str, T: Array) -> Array:
        return {"f": self.law, "b": self.bias, "q": self.loss}[key](T)

    @property
    def span(self) -> tuple[float, float]:
        T = np.concatenate([r.resonator for r in self.runs[: self.records]])
        return float(T.min()), float(T.max())


def chamber(rng: np.random.Generator, hours: float, points: list[float], ripple: float, door: bool, smooth: float) -> tuple[Array, Array]:
    """Air of a bang-bang chamber whose set point an operator turns at odd times."""
    n = int(hours * 3600 / G)
    changes, t = [], rng.uniform(300, 2400)
    goals = list(points[1:])
    share = (n * G - t) / max(len(goals), 1)
    while goals:
        changes.append((t, goals.pop(0)))
        t += share * rng.uniform(0.6, 1.15)
    up, down, band = rng.uniform(1, 3.5) / 60, rng.uniform(0.8, 2.5) / 60, 0.25 * ripple + 0.01
    T, on, goal = points[0], False, points[0]
    air, heat = np.empty(n), np.empty(n)
    opened = rng.uniform(0.3, 0.8) * n * G if door else -1.0
    for i in range(n):
        while changes and i * G >= changes[0][0]:
            goal = changes.pop(0)[1]
        on = T < goal + band if on else T < goal - band
        slow = 0.12 * (0.15 + 0.85 * ripple) if abs(T - goal) < 3 * band + 0.5 else 1.0
        T += G * (up if on else -down) * slow
        if opened >= 0 and opened <= i * G < opened + 90:
            T += G / 250 * (22 - T)
        air[i], heat[i] = T, on
    return lag(air, smooth), heat


def drives(rng: np.random.Generator, n: int, kinds: str, tied: bool) -> dict[str, Array]:
    """Commanded quantities: held levels with changes at odd times; quadrature wanders besides."""
    def levels(choices: Array, holds: float) -> Array:
        out, i = np.empty(n), 0
        while i < n:
            k = int(rng.uniform(0.4, 1.6) * holds / G) + 1
            out[i : i + k] = rng.choice(choices)
            i += k
        return out
    out: dict[str, Array] = {}
    for kind in kinds:
        hold = rng.uniform(2000, 6000)
        if kind == "A":
            out["A"] = levels(np.array([0.7, 0.85, 1.0, 1.15]), hold)
        elif kind == "V":
            out["V"] = 100 * np.sqrt(0.4 + 0.6 * out["A"] ** 2) if tied and "A" in out else levels(np.array([80.0, 90, 100, 110]), hold)
        elif kind == "Q":
            out["Q"] = 0.2 * levels(np.array([-1.0, 0, 1]), hold) + 0.05 * lag(np.cumsum(rng.normal(size=n)) * 0.05, 600)
        else:
            out["P"] = levels(np.array([0.0, 11.25, 22.5, 33.75]) + 4, hold)
    return out


def play(T: Array, width: float, memory: float) -> Array:
    out, y = np.empty_like(T), T[0] + memory * width
    for i, x in enumerate(T.tolist()):
        y = min(max(y, x - width), x + width)
        out[i] = y
    return out


def effect(name: str, w: World, k: int, p: dict[str, float], a: float, key: str) -> Delta:
    """What cause `name` of size a does to run k; own formulas."""
    r = w.runs[k]
    t, T, n = r.t, r.resonator, r.t.size
    age, lo, hi = r.start + t - w.runs[0].start, *w.span
    z = (T - 0.5 * (lo + hi)) / max(0.5 * (hi - lo), 1e-6)
    sensor = r.housing if "housing" in w.columns else r.chamber
    kelvin = T + 273.15
    if name == "second-lag":  # part of the heat comes through a slower (or quicker) leg
        return {"Tr": a * (lag(sensor, p["tau2"]) - lag(sensor, w.tau))}
    if name == "radiation":  # conductance grows as the cube of the mean temperature
        middle = np.r_[sensor[0], 0.5 * (sensor[1:] + sensor[:-1])]
        y, x, out, e = T[0], middle.tolist(), np.empty(n), float(np.exp(-G / w.tau))
        plain = lfilter([1 - e], [1, -e], middle, zi=[e * T[0]])[0]
        for i in range(n):
            m = (0.5 * (x[i] + y) + 273.15) / 293.15
            y += (1 - np.exp(-G / w.tau * (1 - a + a * m**3))) * (x[i] - y)
            out[i] = y
        return {"Tr": out - plain - (out[0] - plain[0]) * np.exp(-t / w.tau)}
    if name == "self-heating":
        return {"Tr": lag(a * r.drives["A"] ** 2 * p.get("grow", 1.0), w.tau)}
    if name == "thermometer-scale":
        u = (sensor - 20) / 10
        return {"Tm": a * (p["c2"] * u**2 + p["c3"] * u**3 + p.get("c4", 0) * u**4)}
    if name == "thermometer-lag":
        return {"Tm": lag(sensor, max(a, 0.0)) - sensor if a > 0.3 else -a * np.gradient(sensor, G)}
    if name == "clock-offset":
        return {"Tm": np.interp(t - a, t, sensor) - sensor if k == p["run"] else np.zeros(n)}
    rate = np.gradient(T, G)
    if name in ("rate-bias", "rate-frequency"):
        s = a * rate * (1 + p.get("mix", 0.0) * z)
    elif name == "hysteresis":
        s = a * (play(T, p["width"], p.get("memory", 0.0)) - T) * (1 + p.get("twist", 0.0) * z)
    elif name == "ageing":
        local = t if p.get("restarts") else age
        s = a * {0: np.log1p(local / p["onset"]), 1: -np.expm1(-local / p["onset"]), 2: local / 86400, 3: (local / p["onset"] + 1) ** 0.3}[int(p["form"])]
    elif name == "jump":
        on = (t >= p["time"]) & (k == p["run"])
        s = a * np.where(on, p.get("stay", 1.0) + p.get("relax", 0.0) * np.exp(-np.clip(t - p["time"], 0, None) / p.get("decay", 1e3)), 0.0)
        s = s + a * p.get("stay", 1.0) * p.get("later", 1.0) * (k > p["run"])
    elif name == "activity-dip":  # avoided crossing of two damped modes
        x = (T - p["T0"]) / p["width"]
        return {"f": a * x / (1 + x**2) if p["form"] else -a / (1 + x**2), "q": abs(a) * p["q"] / (1 + x**2)}
    elif name == "electrostatic-softening":
        s = -a * (r.drives["V"] / 100) ** 2 * (1 + p.get("narrow", 0.0) * (r.drives["V"] / 100) ** 2)
    elif name == "amplitude-frequency":
        s = a * (r.drives["A"] ** 2 + p.get("quart", 0.0) * r.drives["A"] ** 4)
    elif name in ("curvature", "cross-damping"):
        form = int(p["form"])
        s = a * (np.polynomial.legendre.legval(z, np.eye(12)[int(p["order"])]) if form == 0 else np.logaddexp(0, 4 * (z - p["knee"])) if form == 1
                 else np.exp(-((z - p["knee"]) / 0.35) ** 2))
    elif name == "loss-peak":  # Debye peak of an activated relaxation
        x = p["E"] * (1 / kelvin - 1 / (p["T0"] + 273.15)) / 8.617e-5
        s = a / np.cosh(np.clip(x, -50, 50))
    elif name == "leak":
        s = a * (age / 86400 if p["form"] == 0 else np.sqrt(age / 86400)) * np.sqrt(kelvin / 293.15)
    elif name == "periodic":
        local = t if p.get("restarts") else age
        s = a * (np.sin(2 * np.pi * local / p["period"] + p["phase"]) + p.get("over", 0.0) * np.sin(4 * np.pi * local / p["period"]))
    elif name == "clock-drift":
        s = a * age / 86400 * w.law(T) / w.law(np.array(20.0))
    elif name == "quadrature-leakage":
        s = a * r.drives["Q"] * (1 + p.get("slope", 0.0) * (T - 20) / 10)
    elif name == "axis-rotation":
        s = a * np.sin(np.deg2rad(4 * (r.drives["P"] - p["turn"] * (T - 20) / 10)) + p["phase"])
    elif name == "mounting-stress":
        s = a * (sensor - lag(sensor, p["tau2"])) if not p.get("joint") else a * lag(sensor - lag(sensor, p["tau2"]), w.tau)
    else:
        s = a * alien(name, w, k, p)
    return {key: s}


def alien(name: str, w: World, k: int, p: dict[str, float]) -> Array:
    """Causes that no library has; unit size."""
    r, rng = w.runs[k], np.random.default_rng([int(p["seed"]), k])
    t, T, n = r.t, r.resonator, r.t.size
    if name == "telegraph":  # a trapped charge hops between two states
        flips = np.cumsum(rng.random(n) < G / p["dwell"]) % 2
        return flips - 0.5
    if name == "heater-interference":  # the heater's current couples into the electronics
        return lag(r.heater, 30.0) - 0.5
    if name == "beat-chirp":  # a spurious tone whose beat follows temperature through zero
        return np.cos(np.cumsum(2 * np.pi * G * (T - p["T0"]) * p["rate"]))
    if name == "slip-ratchet":  # a clamp that creeps with each kelvin travelled and slips back at odd loads
        load, y, out = np.r_[0, np.cumsum(np.abs(np.diff(T)))], 0.0, np.empty(n)
        limits = np.cumsum(p["step"] * rng.uniform(0.3, 1.7, 400))
        out = load - np.r_[0, limits][np.searchsorted(limits, load)]
        return out / p["step"]
    if name == "frost":  # water adsorbs below the dew point, bakes off above it
        m, out = 0.0, np.empty(n)
        for i, x in enumerate(T.tolist()):
            m = max(m + G / 3600 * ((1.0 - 0.6 * m) if x < p["T0"] else -6.0 * m), 0.0)
            out[i] = -m
        return out
    if name == "shock-train":  # several knocks of either sign, each rings down within minutes
        out = np.zeros(n)
        for _ in range(int(rng.integers(4, 9))):
            i = rng.uniform(0, n * G)
            out += rng.normal() * np.where(t > i, np.exp(-np.clip(t - i, 0, None) / p["decay"]), 0)
        return out
    if name == "desorption":  # gas leaves a wall each time a new highest temperature is reached, and is pumped
        fresh = np.r_[0, np.diff(np.maximum.accumulate(T + 0.0))]
        return lag(fresh / G * 60, p["decay"], 0.0)
    if name == "table-glitches":  # wrong entries of an on-board compensation table of steps
        table = np.random.default_rng(int(p["seed"])).normal(size=400)
        return table[np.clip(((T + 80) / p["step"]).astype(int), 0, 399)]
    knots = rng.normal(size=n // int(p["dwell"] / G) + 5)  # lab-air: electronics outside the chamber
    return lag(np.interp(t, np.arange(knots.size) * p["dwell"], knots), 300.0)


def draw_shape(name: str, w: World, rng: np.random.Generator, separable: bool) -> dict[str, float]:
    lo, hi = w.span
    u, run = rng.uniform, int(rng.integers(0, w.records))
    inside = u(lo + 0.25 * (hi - lo), hi - 0.25 * (hi - lo))
    long = w.runs[run].t[-1]
    table: dict[str, dict[str, float]] = {
        "second-lag": {"tau2": w.tau * u(2.5, 7)}, "thermometer-scale": {"c2": u(-1, 1), "c3": u(0.3, 1) if not separable else u(0.1, 0.5), "c4": u(0, 0.05)},
        "self-heating": {}, "radiation": {}, "thermometer-lag": {}, "clock-offset": {"run": run}, "rate-bias": {"mix": u(-0.5, 0.5)}, "rate-frequency": {},
        "hysteresis": {"width": u(0.5, 6), "memory": u(-1, 1), "twist": u(-0.3, 0.3)},
        "ageing": {"form": 2 if not separable else int(rng.choice([0, 1, 3])), "onset": 10 ** u(3, 5), "restarts": 0},
        "jump": {"run": run, "time": u(0.2, 0.8) * long, "relax": rng.choice([0.0, 0.4]), "decay": u(800, 4000), "later": 1.0},
        "activity-dip": {"T0": inside, "width": u(0.3, 1.8), "form": int(rng.integers(0, 2)), "q": w.noise["q"] / w.noise["f"] if "q" in w.responses else 0.0},
        "electrostatic-softening": {"narrow": u(0, 0.1)}, "amplitude-frequency": {"quart": u(0, 0.15)},
        "curvature": {"form": int(rng.integers(0, 3)) if separable else 0, "order": int(rng.integers(3, 6)), "knee": u(-0.4, 0.4)},
        "cross-damping": {"form": int(rng.integers(0, 3)), "order": int(rng.integers(4, 7)), "knee": u(-0.4, 0.4)},
        "loss-peak": {"T0": inside, "E": u(0.5, 1.4)}, "leak": {"form": 0}, "clock-drift": {},
        "periodic": {"period": u(900, 9000), "phase": u(0, 6.28), "over": rng.choice([0.0, 0.25]), "restarts": int(rng.integers(0, 2))},
        "quadrature-leakage": {"slope": u(-0.1, 0.2)}, "axis-rotation": {"turn": u(0.5, 4), "phase": u(0, 6.28)},
        "mounting-stress": {"tau2": u(5e3, 4e4), "joint": int(rng.integers(0, 2))}}
    return table[name] if name in table else {"seed": float(rng.integers(1, 1 << 30)), "dwell": u(1500, 4000), "T0": inside, "rate": u(2e-5, 6e-5), "decay": u(300, 1500), "step": u(1.5, 4)}


def rival_sets(name: str, w: World) -> list[list[dict[str, float]]]:
    """Shapes tried of a rival: outer list are alternatives, inner lists are fitted together."""
    lo, hi = w.span
    temps = np.linspace(lo, hi, 9)[1:-1]
    if name == "second-lag": return [[{"tau2": w.tau * m}] for m in (0.1, 0.4, 1.6, 2.5, 4, 6, 10)]
    if name == "thermometer-scale": return [[{"c2": 1, "c3": 0, "c4": 0}, {"c2": 0, "c3": 1, "c4": 0}, {"c2": 0, "c3": 0, "c4": 1}]]
    if name == "clock-offset": return [[{"run": k}] for k in range(w.records)] if w.records > 1 else []
    if name == "hysteresis": return [[{"width": h, "memory": m} for h in (0.3, 1, 2.5, 5, 10)] for m in (-1, 0, 1)]
    if name == "ageing": return [[{"form": f, "onset": o, "restarts": s} for f in (0, 1, 2)] for o in (1e3, 4e3, 2e4, 1e5) for s in (0, 1)]
    if name == "jump":
        return [[{"run": k, "time": x * w.runs[k].t[-1], "later": 1.0}, {"run": k, "time": x * w.runs[k].t[-1], "stay": 0.0, "relax": 1.0, "decay": 1500.0}]
                for k in range(w.records) for x in np.linspace(0.06, 0.94, 9)]
    if name == "activity-dip": return [[{"T0": T, "width": h, "form": 0, "q": 0.0}, {"T0": T, "width": h, "form": 1, "q": 0.0}] for T in temps for h in (0.7, 2.2)]
    if name == "curvature": return [[{"form": 0, "order": o} for o in range(3, 9)]]
    if name == "cross-damping": return [[{"form": 0, "order": o} for o in range(4, 9)]]
    if name == "loss-peak": return [[{"T0": T, "E": e}] for T in temps for e in (0.4, 0.8, 1.6)]
    if name == "leak": return [[{"form": 0}, {"form": 1}]]
    if name == "periodic":
        return [[{"period": x, "phase": f, "restarts": s} for f in (0, np.pi / 2)] for s in (0, 1) for x in np.geomspace(900, 3 * max(r.t[-1] for r in w.runs[: w.records]), 18)]
    if name == "quadrature-leakage": return [[{}, {"slope": 1.0}]]
    if name == "axis-rotation": return [[{"turn": x, "phase": f} for f in (0, np.pi / 2)] for x in (0.5, 1.5, 3, 5)]
    if name == "mounting-stress": return [[{"tau2": x}, {"tau2": x, "joint": 1}] for x in (1.2e3, 4e3, 1e4, 3e4, 1e5)]
    if name == "rate-bias": return [[{"mix": 0}, {"mix": 1}]]
    return [[{}]]


class Campaign:
    """Noise, bins, whitening and the projections of one record."""

    def __init__(self, w: World, rng: np.random.Generator, noise: dict[str, float | str]) -> None:
        self.w, self.kind = w, noise
        rows = sum(r.rows.size for r in w.runs[: w.records])
        self.bin = max(1, -(-rows // 900))
        self.mean = [self.averager(r) for r in w.runs]
        self.scale = {c: w.noise[c] for c in w.responses}
        self.drawn = {c: [self.draw(c, r, rng) for r in w.runs] for c in w.responses}
        self.ar = {c: self.whitener(c, rng) for c in w.responses}

    def averager(self, r: Run) -> csr_matrix:
        """From the grid to means over bins of rows."""
        m = r.rows.size // self.bin
        rows = r.rows[: m * self.bin]
        i = np.minimum((rows / G).astype(int), r.chamber.size - 2)
        part = np.clip(rows / G - i, 0, 1)
        b = np.arange(rows.size) // self.bin
        weights = np.r_[1 - part, part] / self.bin
        return csr_matrix((weights, (np.r_[b, b], np.r_[i, i + 1])), shape=(m, r.chamber.size))

    def draw(self, c: str, r: Run, rng: np.random.Generator) -> Array:
        """Noise of one run at its rows."""
        rows, sigma = r.rows, self.w.noise[c]
        step = float(np.min(np.diff(rows)))
        index = np.round(rows / step).astype(int)
        n = int(index[-1]) + 1
        kind, red = str(self.kind["kind"]), np.zeros(n)
        if kind == "flicker":
            f = np.fft.rfftfreq(2 * n, step)
            f[0] = np.inf
            red = np.fft.irfft(rng.normal(size=f.size) / np.sqrt(f) * np.exp(2j * np.pi * rng.random(f.size)), 2 * n)[:n]
            red /= np.sqrt(np.mean(red**2)) + 1e-30
        elif kind == "walk":
            red = np.cumsum(rng.normal(size=n)) * np.sqrt(step / 20000.0)
        elif kind == "ou":
            e = np.exp(-step / float(self.kind["tau"]))
            red = lfilter([np.sqrt(1 - e**2)], [1, -e], rng.normal(size=n))
        return sigma * (rng.normal(size=rows.size) + float(self.kind["red"]) * red[index])

    def bins(self, run: int, x: Array) -> Array:
        k = self.bin
        m = x.size // k * k
        return x[:m].reshape(-1, k).mean(1)

    def whitener(self, c: str, rng: np.random.Generator) -> tuple[Array, float]:
        """Autoregression of the binned noise, from long draws of it."""
        size, acf = 8, np.zeros(9)
        for _ in range(6):
            for k, r in enumerate(self.w.runs[: self.w.records]):
                x = self.bins(k, self.draw(c, r, rng))
                if x.size > 30:
                    acf += np.array([x[: x.size - j] @ x[j:] for j in range(9)])
        acf[0] *= 1.0001
        lagged = acf[np.abs(np.subtract.outer(np.arange(size), np.arange(size)))]
        phi = np.linalg.solve(lagged, acf[1:])
        count = 6 * sum(r.rows.size // self.bin for r in self.w.runs[: self.w.records])
        thin = self.w.thin_q if c == "q" else 1
        return np.r_[1, -phi], float(np.sqrt((acf[0] - phi @ acf[1:]) / count * thin))

    def stack(self, per: dict[str, list[Array]], white: bool) -> Array:
        """Rows of all responses and runs, in units of noise."""
        out = []
        for c in self.w.responses:
            for k, x in enumerate(per[c]):
                out.append(lfilter(self.ar[c][0], [1.0], x) / self.ar[c][1] if white else x / self.scale[c])
        return np.concatenate(out)

    def at_rows(self, k: int, x: Array) -> Array:
        return self.mean[k] @ x

    def moved(self, k: int, d: Delta, c: str) -> Array | None:
        """What a cause adds to response c of run k, seen from a baseline driven by the thermometer; on the grid."""
        w, T = self.w, self.w.runs[k].resonator
        if "Tr" not in d and "Tm" not in d:
            return d.get(c)
        move = d.get("Tr", 0.0) - (lag(d["Tm"], w.tau) if "Tm" in d else 0.0)
        return w.base(c, T + move) - w.base(c, T)

    def signal(self, deltas: list[Delta]) -> dict[str, list[Array]]:
        zero = [np.zeros(m.shape[1]) for m in self.mean]
        def part(k: int, d: Delta, c: str) -> Array:
            x = self.moved(k, d, c)
            return self.mean[k] @ (zero[k] if x is None else x)
        return {c: [part(k, d, c) for k, d in enumerate(deltas[: self.w.records])] for c in self.w.responses}

    def many(self, name: str, shapes: list[dict[str, float]], key: str, size: float) -> Array:
        """Whitened columns of many members of one family, projected."""
        made = [[effect(name, self.w, k, p, size, key) for p in shapes] for k in range(self.w.records)]
        blocks = []
        for c in self.w.responses:
            for k, row in enumerate(made):
                parts = [self.moved(k, d, c) for d in row]
                if all(x is None for x in parts):
                    blocks.append(np.zeros((self.mean[k].shape[0], len(shapes))))
                else:
                    blocks.append(lfilter(self.ar[c][0], [1.0], self.mean[k] @ np.stack(parts, 1), axis=0) / self.ar[c][1])
        return self.project(np.vstack(blocks), True)

    def set_baseline(self, columns: list[dict[str, list[Array]]], widths: list[float]) -> None:
        """Orthonormal bases of what the baseline absorbs; finite widths are priors."""
        self.basis: dict[bool, Array] = {}
        for white in (False, True):
            J = np.stack([self.stack(c, white) for c in columns], 1)
            tail = np.diag([0.0 if np.isinf(x) else 1 / x for x in widths])
            size = np.linalg.norm(np.vstack([J, tail]), axis=0) + 1e-300
            q, r = np.linalg.qr(np.vstack([J, tail]) / size)
            keep = np.abs(np.diag(r)) > 1e-9
            self.basis[white] = q[:, keep]
        self.extra = len(widths)

    def project(self, y: Array, white: bool) -> Array:
        full = np.r_[y, np.zeros(self.extra)] if y.ndim == 1 else np.vstack([y, np.zeros((self.extra, y.shape[1]))])
        q = self.basis[white]
        return full - q @ (q.T @ full)

    def part(self, r: Array, c: str) -> Array:
        sizes = [sum(x.rows.size // self.bin for x in self.w.runs[: self.w.records])] * len(self.w.responses)
        i = self.w.responses.index(c)
        return r[sum(sizes[:i]) : sum(sizes[: i + 1])]

    def noise_after(self, c: str) -> float:
        per = {x: [self.bins(k, self.drawn[x][k]) for k in range(self.w.records)] for x in self.w.responses}
        y = self.stack(per, False)
        before, after = self.part(y, c), self.part(self.project(y, False), c)
        full = np.mean(np.concatenate(self.drawn[c][: self.w.records]) ** 2) / self.scale[c] ** 2
        return float(np.sqrt(max(full - np.mean(before**2) + np.mean(after**2), 1e-6)))

    def snr(self, deltas: list[Delta], c: str) -> float:
        return float(np.sqrt(np.mean(self.part(self.project(self.stack(self.signal(deltas), False), False), c) ** 2))) / self.noise_after(c)

    def left_of(self, target: Array, rival: str, key: str) -> float:
        """Chi square that the best member of a rival leaves of a projected, whitened signal."""
        best, at, sets = float(target @ target), 0, rival_sets(rival, self.w)
        if not sets:
            return best
        full = self.many(rival, [p for x in sets for p in x], key, 0.02 if rival == "radiation" else 0.2)
        for shapes in sets:
            B = full[:, at : at + len(shapes)]
            at += len(shapes)
            B = B / (np.linalg.norm(B, axis=0) + 1e-12)
            c = np.linalg.lstsq(B, target, rcond=1e-8)[0]
            best = min(best, float(np.sum((target - B @ c) ** 2)))
        return best

    def rivals(self, name: str, deltas: list[Delta]) -> tuple[dict[str, float], float]:
        target = self.project(self.stack(self.signal(deltas), True), True)
        left: dict[str, float] = {}
        for other, acts in ACTS.items():
            if other == name or (NEEDS.get(other) and NEEDS[other] not in self.w.runs[0].drives):
                continue
            keys = ["f"] if other in THERMAL else [c for c in acts if c in self.w.responses]
            if keys:
                left[other] = min(self.left_of(target, other, c) for c in keys)
        return left, float(target @ target)


def own_world(rng: np.random.Generator, plan: "Plan") -> tuple[World, Campaign, float, float]:
    """A device of our own; its departures from the simplest baseline shrink until the baseline follows it within the noise."""
    seed, noise = int(rng.integers(1 << 30)), plan.noise(rng)
    strength, chi = 0.3, 1e9
    for trial in range(4):
        w = build(np.random.default_rng(seed), plan, strength)
        camp = Campaign(w, np.random.default_rng(seed + 1), noise)
        share, chi = fit_healthy(w, camp)
        if chi < 6:
            break
        strength = min(strength * float(np.sqrt(3 / chi)), 0.3) if trial < 2 else 0.0
    return w, camp, share, chi


@dataclass
class Plan:
    responses: str
    columns: list[str]
    drives: str
    tied: bool
    most_runs: int
    least_runs: int
    card: bool
    coarse: bool

    def noise(self, rng: np.random.Generator) -> dict[str, float | str]:
        kind = str(rng.choice(["white", "flicker", "walk", "ou"]))
        return {"kind": kind, "red": 0.0 if kind == "white" else float(rng.uniform(0.2, 0.9)), "tau": float(rng.uniform(100, 3000)),
                "outliers": float(rng.choice([0.0, rng.uniform(0.001, 0.008)])), "rounding": float(rng.choice([0.02, 0.2, 0.6]))}


def skeleton(rng: np.random.Generator, plan: Plan, strength: float) -> list[Run]:
    """Chamber, drives and rows of all runs (and of the unseen one); the device is still missing."""
    count = int(rng.integers(plan.least_runs, plan.most_runs + 1))
    middle, half = rng.uniform(5, 25), rng.uniform(15, 35)
    soaks = [middle + half * x for x in rng.uniform(-1, 1, 4)] + [middle - half, middle + half]
    repeated, start, runs = rng.random() < 0.4, 0.0, []
    step = float(rng.choice([30, 60, 120] if plan.coarse else [1, 2, 5, 10, 20, 30, 60, 120]))
    hours = [rng.uniform(2, 12) for _ in range(count + plan.card)]
    step = max(step, float(np.ceil(sum(hours) * 3600 / 12000)))
    two_rates, hole, door = rng.random() < 0.25 and step <= 40, rng.random() < 0.3, rng.random() < 0.25
    empty = float(rng.uniform(300, 1800))
    for k, long in enumerate(hours):
        n = int(np.clip(rng.integers(1, 5), 1, max(1, long // 1.5)))
        pool = soaks[-2:] if repeated and k < count else soaks
        points = [22.0 if rng.random() < 0.5 else float(rng.choice(soaks))]
        for _ in range(n):
            points.append(float(rng.choice([x for x in pool + soaks[-2:] if abs(x - points[-1]) > 8] or pool)))
        air, heat = chamber(rng, long, points, float(rng.uniform(0.3, 1.5)) * (0.3 + 0.7 * strength), door and k == 0, max(60.0, (8 if two_rates else 3) * step))
        t = np.arange(0, air.size * G - 1, step)
        if two_rates:
            t = np.r_[t[t < t[-1] * 0.4], np.arange(t[-1] * 0.4 // step * step + step, t[-1], 3 * step)]
        a = rng.uniform(0.5, 0.85) * t[-1]
        if hole and k == 0 and strength > 0.02:
            t = t[(t < a) | (t > a + empty)]
        extra = drives(rng, air.size, plan.drives, plan.tied)
        runs.append(Run(start, air, heat, air, air, extra, np.round(t, 3), {}, float(rng.uniform(0.2, 2.0)) if rng.random() < 0.35 else 0.0))
        start += air.size * G + 3600 * rng.uniform(6, 72)
    return runs


def build(rng: np.random.Generator, plan: Plan, s: float) -> World:
    runs = skeleton(rng, plan, s)
    metal = rng.random() < 0.3
    f0, a = rng.uniform(3000, 8000), (rng.choice([-1, 1]) * rng.uniform(2e-5, 6e-5) if metal else rng.uniform(1.4e-4, 2.0e-4))
    b, c, alpha = rng.uniform(-2, -0.5) * 1e-7, rng.uniform(-1, 1) * 3e-10 * s, (8e-6 if metal else 5e-7)

    def law(T: Array) -> Array:  # f ~ sqrt(E / rho) h / r^2
        d = np.asarray(T) - 20
        return f0 * np.sqrt((1 + a * d + b * d**2 + c * d**3) * (1 + alpha * d))
    slope = float(law(np.array(21.0)) - law(np.array(20.0)))
    k1, k2, k3, level = rng.normal(0, 0.5) / max(abs(slope), 0.02), rng.normal(0, 0.008) / slope**2, rng.normal(0, 1e-4) / slope**3, rng.normal(0, 8)
    q0, qs, qc = 10 ** rng.uniform(-7.3, -4.8), rng.uniform(-1, 6) * 1e-3, rng.uniform(-1, 1) * 3e-5
    def bias(T: Array) -> Array:
        u = law(T) - f0 if "f" in plan.responses else slope * (np.asarray(T) - 20)
        return level + k1 * u + k2 * u**2 + k3 * u**3
    def loss(T: Array) -> Array:
        d = np.asarray(T) - 20
        return q0 * (1 + qs * d + qc * d**2 + 5e-8 * s * d**3)
    tau, tau_h, quick, share = rng.uniform(500, 3000), rng.uniform(150, 900), rng.uniform(0.02, 0.08) * s, rng.uniform(0.01, 0.05) * s
    both = "housing" not in plan.columns
    for r in runs:
        r.housing = lag(r.chamber, tau_h)
        x = (lag(r.chamber, 0.1 * tau_h * s) if both else r.housing).tolist()
        base, y, out = x[0], x[0] - r.wake, np.empty(len(x))
        t3 = 1.0 / 293.15**3
        for i, h in enumerate(x):  # housing -> base -> resonator; the second node is quick, part of its conductance radiates
            if quick > 0.002:
                base += (1 - np.exp(-G / (quick * tau))) * (h - base)
            else:
                base = h if i == 0 else 0.5 * (h + x[i - 1])
            y += (1 - np.exp(-G / tau * (1 - share + share * (0.5 * (base + y) + 273.15) ** 3 * t3))) * (base - y)
            out[i] = y
        r.resonator = out
    noise = {"f": rng.uniform(1e-3, 5e-3) * (0.5 if metal else 1), "b": rng.uniform(0.02, 0.12), "q": q0 * rng.uniform(0.002, 0.008)}
    return World(runs, len(runs) - plan.card, tau, law, bias, loss, plan.responses, plan.columns, noise, int(rng.choice([1, 1, 4])))


def column_of(w: World, k: int) -> Array:
    return w.runs[k].housing if "housing" in w.columns else w.runs[k].chamber


def fit_healthy(w: World, camp: Campaign) -> tuple[float, float]:
    """The contract's baseline without a card, refitted to the healthy signals; sets what it absorbs, gives what it leaves."""
    sampled = [np.interp(r.t, r.rows, np.interp(r.rows, r.t, column_of(w, k))) for k, r in enumerate(w.runs[: w.records])]
    truth = {c: [camp.at_rows(k, w.base(c, r.resonator)) for k, r in enumerate(w.runs[: w.records])] for c in w.responses}
    y = camp.stack({c: [x - w.base(c, np.array(20.0)) for x in truth[c]] for c in w.responses}, False)

    def linear(p: Array) -> list[dict[str, list[Array]]]:
        T = [lag(x, np.exp(p[0])) + p[1 + k] * np.exp(-np.arange(x.size) * G / np.exp(p[0])) for k, x in enumerate(sampled)]
        zero = [np.zeros(r.rows.size // camp.bin) for r in w.runs[: w.records]]
        out: list[dict[str, list[Array]]] = []
        def add(c: str, cols: list[Array]) -> None:
            out.append({x: cols if x == c else zero for x in w.responses})
        for c in w.responses:
            if c in "fq":
                for m in range(3):
                    add(c, [camp.at_rows(k, ((x - 20) / 20) ** m) for k, x in enumerate(T)])
            else:
                u = [(w.law(x) - w.law(np.array(20.0))) / 5 if "f" in w.responses else (x - 20) / 20 for x in T]
                for m in range(1, 4):
                    add(c, [camp.at_rows(k, x**m) for k, x in enumerate(u)])
                for k in range(w.records):
                    add(c, [z + (i == k) for i, z in enumerate(zero)])
        return out

    def residual(p: Array) -> Array:
        A = np.stack([camp.stack(c, False) for c in linear(p)], 1)
        size = np.linalg.norm(A, axis=0) + 1e-30
        return y - A @ (np.linalg.lstsq(A / size, y, rcond=1e-12)[0] / size)
    p0 = np.r_[np.log(w.tau), [-r.wake for r in w.runs[: w.records]]]
    best = least_squares(residual, p0, diff_step=1e-5, x_scale=np.r_[0.01, np.full(w.records, 0.1)], max_nfev=8)
    w.tau = float(np.exp(best.x[0]))
    cols = linear(best.x)
    A = np.stack([camp.stack(c, False) for c in cols], 1)
    coef = np.linalg.lstsq(A, y, rcond=1e-13)[0]
    for i in range(best.x.size):  # directions of the lag and of the initial states
        step = np.zeros(best.x.size)
        step[i] = 1e-3
        up, down = linear(best.x + step), linear(best.x - step)
        n = len(coef)
        cols.append({c: [sum(coef[j] * (up[j][c][k] - down[j][c][k]) for j in range(n)) for k in range(w.records)] for c in w.responses})
    camp.set_baseline(cols, [np.inf] * len(cols))
    fitted = {c: [sum(coef[j] * cols[j][c][k] for j in range(len(coef))) + w.base(c, np.array(20.0)) for k in range(w.records)] for c in w.responses}
    gap = {c: [truth[c][k] - fitted[c][k] for k in range(w.records)] for c in w.responses}
    white = camp.project(camp.stack(gap, True), True)
    return float(np.sqrt(np.mean(best.fun**2))), float(white @ white)


# ---- with a card: the product's own simulation is the healthy device -------------------------------------------------------------
HEAD = 'schema = "hrg.card/1"\nname = "{name}"\nreference_temperature_degC = 20.0\n'
CARDS = {
    "dome-b": '[resonator]\nshape = "hemisphere"\nradius_mm = 15.0\nthickness_mm = 0.9\nrim_angle_deg = 90.0\npole_angle_deg = 0.0\nsupport = "free"\n',
    "stem-b": '[resonator]\nshape = "hemisphere"\nradius_mm = 15.0\nthickness_mm = 0.85\nsupport = "stem"\n[resonator.stem]\nradius_mm = 2.5\nend_mm = -5.0\nside = "inner"\nfillet_mm = 0.5\n',
    "cup-b": '[resonator]\nshape = "cylinder"\nradius_mm = 12.5\nthickness_mm = 1.0\nheight_mm = 18.0\nbottom_thickness_mm = 1.5\nclamp_radius_mm = 3.0\n'}
SILICA, ALLOY = ['name = "fused-silica"', 'law = "default"'], ['name = "3j53"']
STATED: dict[str, dict[str, object]] = {"cup-b": {  # what a card states itself; the rest is as documented
    "material.youngs_modulus_GPa": "{ value = 190.0, sd = 5.0 }", "material.poisson_ratio": "{ value = 0.3, sd = 0.03 }",
    "thermal.conductivity_W_per_m_K": "{ value = 12.0, relative_sd = 0.3 }", "thermal.heat_capacity_J_per_kg_K": "{ value = 500.0, sd = 25.0 }",
    "thermal.film_emissivity": "{ value = 0.2, relative_sd = 0.7 }", "thermal.mount_conductance_W_per_K": "{ value = 0.1, relative_sd = 1.0 }",
    "loss.inverse_q": "{ value = 5e-5, relative_sd = 1.0 }", "bias.offset_deg_per_h": "{ value = 0.0, sd = 100.0 }",
    "bias.damping_anisotropy": "{ value = 0.001, relative_sd = 1.0 }"}}
VALUES: dict[str, list[dict[str, object]]] = {}


def hrg(*args: str) -> str:
    done = subprocess.run(["hrg", *args], capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return done.stdout


def card_text(name: str, values: dict[str, float]) -> str:
    """A card file; drawn values replace the stated ones."""
    tables: dict[str, list[str]] = {"material": list(ALLOY if name == "cup-b" else SILICA)}
    for key, value in {**STATED.get(name, {}), **values}.items():
        table, leaf = key.rsplit(".", 1)
        tables.setdefault(table, []).append(f"{leaf} = {value}")
    return HEAD.format(name=name) + CARDS[name] + "".join(f"[{t}]\n" + "\n".join(x) + "\n" for t, x in tables.items())


def simulate(text: str, w_runs: list[Run], use: list[Array], boundary: str, step: float) -> list[dict[str, Array]]:
    """All runs as one record with long settling gaps between them."""
    with tempfile.TemporaryDirectory() as where:
        card, source, out = (str(Path(where) / x) for x in ("card.toml", "in.csv", "out.csv"))
        Path(card).write_text(text)
        ts, xs, spans, t0 = [], [], [], 0.0
        for r, x in zip(w_runs, use):
            t = np.arange(0, r.t[-1] + 0.1, step)
            if ts:
                ts.append(np.array([t0 - 36000.0]))
                xs.append(np.array([x[0]]))
            spans.append((t0, t.size))
            ts.append(t0 + t)
            xs.append(np.interp(t, r.t, x))
            t0 += t[-1] + 50000.0
        T, X = np.concatenate(ts), np.concatenate(xs)
        np.savetxt(source, np.c_[T, X, X * 0 + 4000], delimiter=",", fmt="%.6f", comments="", header=f"time_s,{boundary}_temperature_degC,frequency_Hz")
        hrg("simulate", card, source, "--noiseless", "--boundary", boundary, "--out", out)
        lines = [x for x in Path(out).read_text().splitlines() if not x.startswith("#")]
        table = dict(zip(lines[0].split(","), np.array([[float(v) for v in x.split(",")] for x in lines[1:]]).T))
    result = []
    for r, (start, n) in zip(w_runs, spans):
        i = int(np.searchsorted(table["time_s"], start - 1e-3))
        local = table["time_s"][i : i + n] - start
        result.append({k: np.interp(r.t, local, v[i : i + n]) for k, v in table.items()})
    return result


@dataclass
class Device:
    """A drawn device with some campaigns of healthy runs, simulated in one go."""
    name: str
    drawn: dict[str, float]
    campaigns: list[list[Run]]
    truth: list[list[dict[str, Array]]]
    fits: dict[str, Callable[[Array], Array]]


STOCK: list[Device] = []


def new_device(rng: np.random.Generator, campaigns: int = 5) -> Device:
    name = str(rng.choice(list(CARDS)))
    if name not in VALUES:
        with tempfile.TemporaryDirectory() as where:
            (Path(where) / "c.toml").write_text(card_text(name, {}))
            VALUES[name] = json.loads(hrg("cards", str(Path(where) / "c.toml"), "--json"))["values"]
    drawn: dict[str, float] = {}
    for v in VALUES[name]:
        key, value, sd = str(v["name"]), float(v["value"]), float(v["sd"])
        z = float(np.clip(rng.normal(), -1.4, 1.4))
        drawn[key] = value * float(np.exp(z * sd / value)) if v["logarithmic"] and value else value + z * sd
    drawn = {k: x for k, x in drawn.items() if "anisotropy_angle" not in k}
    plan = Plan("fbq", ["housing"], "", False, 6, 1, True, False)
    groups = [skeleton(rng, plan, 0.15) for _ in range(campaigns)]
    flat = [r for g in groups for r in g]
    truth = simulate(card_text(name, drawn), flat, [r.chamber for r in flat], "chamber", 20.0)
    for r, x in zip(flat, truth):
        r.housing, r.resonator = x["housing_temperature_degC"], x["resonator_temperature_degC"]
    T = np.concatenate([r.resonator for r in flat])
    fits = {c: np.polynomial.Chebyshev.fit(T, np.concatenate([x[COLUMN[c]] for x in truth]), 7) for c in "fbq"}
    if os.environ.get("HAND_B_TALK"):
        print("  device", name, {c: float(np.std(fits[c](T) - np.concatenate([x[COLUMN[c]] for x in truth]))) for c in "fbq"}, flush=True)
    each = iter(truth)
    return Device(name, drawn, groups, [[next(each) for _ in g] for g in groups], fits)


def card_world(rng: np.random.Generator, plan: Plan, check: bool) -> tuple[World, Campaign, float, float, str]:
    if not STOCK or not STOCK[0].campaigns:
        STOCK[:] = [new_device(rng)]
    d = STOCK[0]
    name, drawn, fits = d.name, d.drawn, d.fits
    i = max(range(len(d.campaigns)), key=lambda j: (len(d.campaigns[j]) > plan.least_runs, j))
    runs, truth = d.campaigns.pop(i), d.truth.pop(i)
    keep = int(min(len(runs) - 1, plan.most_runs))
    runs, truth = runs[:keep] + runs[-1:], truth[:keep] + truth[-1:]
    if keep < plan.least_runs:
        raise ValueError("too few runs")
    for r in runs:
        r.drives = drives(rng, r.chamber.size, plan.drives, plan.tied)
        if plan.coarse:
            r.rows = r.rows[:: max(1, int(60 / np.min(np.diff(r.rows))))]
    lagged = drawn.get("noise.housing_lag_s", 10.0)
    q0 = float(fits["q"](20.0))
    slope = abs(float(fits["f"].deriv()(20.0)))
    noise = {"f": rng.uniform(1.5e-3, 5e-3) * (1 if slope > 0.1 else 0.5), "b": rng.uniform(0.03, 0.12), "q": q0 * rng.uniform(0.002, 0.008)}
    w = World(runs, len(runs) - 1, 1000.0, fits["f"], fits["b"], fits["q"], plan.responses, plan.columns, noise, int(rng.choice([1, 4])))
    taus = np.geomspace(200, 8000, 30)
    w.tau = float(taus[np.argmin([sum(np.sum((lag(column_of(w, k), x) - r.resonator) ** 2) for k, r in enumerate(runs)) for x in taus])])
    camp = Campaign(w, rng, plan.noise(rng))
    recorded = runs[: w.records]
    zero = [np.zeros(r.rows.size // camp.bin) for r in recorded]
    cols: list[dict[str, list[Array]]] = []
    widths: list[float] = []
    def add(values: dict[str, list[Array]], sd: float) -> None:
        cols.append({c: values.get(c, zero) for c in w.responses})
        widths.append(sd)
    def moved(m: float, order: int) -> list[Array]:
        return [camp.at_rows(k, m * (r.resonator - 20) ** order) for k, r in enumerate(recorded)]
    f0, alloy = float(fits["f"](20.0)), name == "cup-b"
    for order, sd in enumerate((0.0035, 2.9e-6 if alloy else 7.2e-6, 0.7e-7 if alloy else 2.3e-7)):
        add({"f": moved(f0 * sd, order)}, 1.0)
    for order, sd in enumerate((1.0, 0.004, 4e-5)):
        add({"q": moved(q0 * sd, order)}, 1.0)
    for m, sd in ((1, 1.0), (2, 0.1), (3, 0.01)):
        add({"b": [camp.at_rows(k, sd * (w.law(r.resonator) - f0) ** m) for k, r in enumerate(recorded)]}, 1.0)
    for k in range(w.records):
        add({"b": [z + (i == k) for i, z in enumerate(zero)]}, np.inf)
        start = {c: [camp.at_rows(i, (w.base(c, r.resonator + 0.5) - w.base(c, r.resonator)) * np.exp(-r.t / w.tau) * (i == k)) for i, r in enumerate(recorded)] for c in w.responses}
        add(start, np.inf)
    boundary = "housing" if "housing" in plan.columns else "chamber"
    seconds = [lag(column_of(w, k), w.tau) for k in range(w.records)]  # the heat path's constants: its lag, its split in two nodes, its radiated share
    paths = [[lag(column_of(w, k), 1.05 * w.tau) - x for k, x in enumerate(seconds)],
             [lag(lag(column_of(w, k), 0.25 * w.tau), 0.75 * w.tau) - x for k, x in enumerate(seconds)],
             [0.05 * (lag(x, w.tau) - x) * (x - 20) / 30 for x in seconds]]
    for path, sd in zip(paths, (10.0, 1.0, 2.0)):
        add({c: [camp.at_rows(k, w.base(c, r.resonator + path[k]) - w.base(c, r.resonator)) for k, r in enumerate(recorded)] for c in w.responses}, sd)
    shift = [lag(column_of(w, k), 10.0) - column_of(w, k) for k in range(w.records)]  # the sensor's own lag is uncertain
    if boundary == "housing":
        add({c: [camp.at_rows(k, w.base(c, r.resonator - lag(shift[k], w.tau)) - w.base(c, r.resonator)) for k, r in enumerate(recorded)] for c in w.responses}, 1.0)
    camp.set_baseline(cols, widths)
    left = chi = -1.0
    if check:  # the product's simulation, driven by what the record says
        seen = [np.interp(r.t, r.rows, np.interp(r.rows, r.t, column_of(w, k))) for k, r in enumerate(recorded)]
        other = simulate(card_text(name, drawn), recorded, seen, boundary, 20.0)
        gap = {c: [camp.at_rows(k, truth[k][COLUMN[c]] - x[COLUMN[c]]) for k, x in enumerate(other)] for c in w.responses}
        plain, white = camp.project(camp.stack(gap, False), False), camp.project(camp.stack(gap, True), True)
        left, chi = float(np.sqrt(np.mean(plain**2))), float(white @ white)
    for r, x in zip(runs, truth):  # as simulated: a start that decays with one lag is none of a card's network
        r.extra, r.wake = {c: x[COLUMN[c]] - fits[c](r.resonator) for c in w.responses}, 0.0
        if boundary == "housing":
            r.housing = lag(r.housing, lagged)
    return w, camp, left, chi, card_text(name, {})


# ---- a case ----------------------------------------------------------------------------------------------------------------------
def scale_to(camp: Campaign, name: str, p: dict[str, float], key: str, snr: float, sign: float) -> tuple[list[Delta], float, str]:
    """Size the cause so that the refitted baseline leaves snr noises of it; gives its deltas, size and strongest response."""
    w = camp.w
    a = {"radiation": 0.05, "thermometer-lag": 20.0, "clock-offset": 30.0, "second-lag": 0.05}.get(name, 0.01) * sign
    c = key
    for _ in range(4):
        deltas = [effect(name, w, k, p, a, key) for k in range(len(w.runs))]
        if name in THERMAL:
            c = max(w.responses, key=lambda x: camp.snr(deltas, x))
        now = camp.snr(deltas, c)
        if not np.isfinite(now) or now < 1e-12:
            raise ValueError("invisible")
        a *= min(snr / now, 1e9)
        if name == "radiation" and a > 0.95 or name == "thermometer-lag" and a > 900 or name == "second-lag" and a > 0.6 or name == "clock-offset" and abs(a) > 900:
            raise ValueError("too large")
    deltas = [effect(name, w, k, p, a, key) for k in range(len(w.runs))]
    moves = max(float(np.max(np.abs(d.get("Tr", d.get("Tm", np.zeros(1)))))) for d in deltas)
    if moves > 12:
        raise ValueError("too large")
    return deltas, a, c


def write(path: Path, camp: Campaign, k: int, deltas: list[list[Delta]], sensor: dict[str, float], stamp: bool, rng: np.random.Generator) -> dict[str, float]:
    """One record; gives the rms of its noise (rounding included, outliers not)."""
    w, r = camp.w, camp.w.runs[k]
    rows, noise = r.rows, {}
    columns: dict[str, Array] = {"time_s": rows}
    move = sum((d[k].get("Tr", 0.0) for d in deltas), np.zeros(r.t.size))
    wrong = sum((d[k].get("Tm", 0.0) for d in deltas), np.zeros(r.t.size))
    for place in w.columns:
        primary = place == ("housing" if "housing" in w.columns else "chamber")
        T = np.interp(rows, r.t, (r.housing if place == "housing" else r.chamber) + (wrong if primary else 0.0))
        T = T + sensor["offset"] + sensor["gain"] * (T - 20) + 0.003 * rng.normal(size=rows.size)
        columns[f"{place}_temperature_degC"] = np.round(T / sensor["step"]) * sensor["step"]
    for c in w.responses:
        x = np.interp(rows, r.t, w.base(c, r.resonator + move) + r.extra.get(c, 0.0))
        for d in deltas:
            y = d[k].get(c, np.zeros(r.t.size))
            held = np.max(np.abs(np.diff(y))) > 0.1 * np.ptp(y)  # a step stays one
            x = x + (y[np.minimum((rows / G).astype(int), y.size - 1)] if held else np.interp(rows, r.t, y))
        step = float(camp.kind["rounding"]) * w.noise[c]
        y = np.round((x + camp.drawn[c][k]) / step) * step
        noise[COLUMN[c]] = float(np.sqrt(np.mean((y - x) ** 2)))
        if float(camp.kind["outliers"]) and rows.size > 60:
            for _ in range(int(np.ceil(float(camp.kind["outliers"]) * rows.size / 4))):
                i = int(rng.integers(0, rows.size - 4))
                y[i : i + int(rng.integers(1, 5))] += rng.choice([-1, 1]) * rng.uniform(6, 25) * w.noise[c]
        columns[COLUMN[c]] = y
    for key, x in r.drives.items():
        columns[DRIVE[key]] = x[np.minimum((rows / G).astype(int), x.size - 1)]
    head = [f"# start: {(datetime(2024, 3, 4, 7, 12) + timedelta(seconds=r.start)).isoformat(timespec='seconds')}"] if stamp else []
    lines = head + [",".join(columns)]
    names = list(columns)
    for i in range(rows.size):
        cells = [("" if c == "inverse_q" and i % w.thin_q else f"{columns[c][i]:.10g}") for c in names]
        lines.append(",".join(cells))
    path.write_text("# instrument: hand-b\n" + "\n".join(lines) + "\n")
    return noise


def hide(rng: np.random.Generator, kind: str, names: list[str], acts: list[str], camp: Campaign) -> tuple[list[dict[str, object]], list[list[Delta]]]:
    """Draw, size and judge the causes of one campaign."""
    w, tied = camp.w, kind == "inseparable"
    hidden: list[dict[str, object]] = []
    deltas: list[list[Delta]] = []
    for n, act in zip(names, acts):
        key = str(rng.choice([c for c in act if c in w.responses]))
        snr = float(rng.choice([1, 3, 6], p=[0.6, 0.3, 0.1] if tied else [1 / 3] * 3))
        p = draw_shape(n, w, rng, not tied)
        found, size, c = scale_to(camp, n, p, key, snr, 1.0 if n in POSITIVE else float(rng.choice([-1, 1])))
        rivals, total = camp.rivals(n, found)
        accept = [n] + sorted((o for o, x in rivals.items() if x < 6), key=lambda o: rivals[o])
        if kind == "alien" and (total < 60 or min(rivals.values()) < 0.3 * total):
            raise ValueError("a known effect would do")
        if tied and len(accept) < 2 or total < 25:
            raise ValueError("separable or invisible")
        hidden.append({"name": n, "response": COLUMN[c], "snr": snr, "accept": accept, "near": sorted(o for o, x in rivals.items() if 6 <= x < max(20, 0.01 * total)),
            "structure_chi2": round(total, 1), "size": size, "shape": {k: float(v) for k, v in p.items()}, "closest": {o: round(x, 1) for o, x in sorted(rivals.items(), key=lambda q: q[1])[:3]}})
        deltas.append(found)
    return hidden, deltas


def make_case(rng: np.random.Generator, kind: str, card: bool, wanted: list[str], where: Path) -> dict[str, object]:
    """One campaign; draws again what cannot be represented."""
    tied = kind == "inseparable"
    entry = INSEPARABLE[int(rng.integers(len(INSEPARABLE)))] if tied else None
    names = [entry[0]] if entry else wanted
    acts = [ACTS.get(n) or ALIENS[n] for n in names]
    sets = [s for s in ("f", "f", "fb", "fb", "fbq", "fbq", "b", "fq") if all(any(c in s for c in a) for a in acts)] or ["fbq"]
    plan = Plan(entry[1] if entry else str(rng.choice(sets)), [["housing"], ["chamber"], ["housing", "chamber"]][int(rng.choice(3, p=[0.5, 0.25, 0.25]))],
        entry[2] if entry else "".join(sorted({NEEDS[n] for n in names if n in NEEDS} | ({str(rng.choice(list("AVQP")))} if rng.random() < 0.2 else set()))),
        tied, entry[3] if entry else 6, 2 if "clock-offset" in names else 1, card, tied)
    if card:
        w, camp, left, chi, text = card_world(rng, plan, kind == "null")
    else:
        (w, camp, left, chi), text = own_world(rng, plan), ""
    if chi > 12:
        raise ValueError("the baseline does not follow this device")
    for again in range(5):
        try:
            hidden, deltas = hide(rng, kind, names, acts, camp)
            break
        except ValueError:
            if again == 4:
                raise
    sensor = {"offset": float(rng.normal(0, 0.15)), "gain": float(rng.normal(0, 0.003)), "step": float(rng.choice([0.001, 0.005, 0.01]))}
    stamp = rng.random() < 2 / 3 or bool({"ageing", "clock-drift", "leak", "periodic", "jump"} & set(names))  # their course needs the gaps
    where.mkdir(parents=True, exist_ok=True)
    floors = [write(where / f"run_{k}.csv", camp, k, deltas, sensor, stamp, rng) for k in range(w.records)]
    weight = [w.runs[k].rows.size for k in range(w.records)]
    truth: dict[str, object] = {"kind": kind, "card": card, "responses": [COLUMN[c] for c in w.responses], "columns": w.columns, "drives": [DRIVE[x] for x in plan.drives],
        "noise": str(camp.kind["kind"]) + ("+outliers" if camp.kind["outliers"] else ""), "hidden": hidden,
        "right_verdicts": {"null": ["adequate"], "alien": ["unexplained"]}.get(kind, ["explained", "not-identifiable"]),
        "noise_floor_rms": {c: float(np.sqrt(np.average([f[c] ** 2 for f in floors], weights=weight))) for c in floors[0]}, "unseen_noise_rms": {},
        "healthy_left_over_noises": left, "healthy_left_over_chi2": chi, "runs": w.records, "rows": int(sum(weight)), "lag_s": w.tau}
    if card:
        (where / "card.toml").write_text(text)
        truth["unseen_noise_rms"] = write(where / "unseen.csv", camp, w.records, deltas, sensor, stamp, rng)
    return truth


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    rng = np.random.default_rng(args.seed)
    shares = {"single": 0.5, "null": 0.15, "alien": 0.15, "pair": 0.1, "inseparable": 0.1}
    kinds = [k for k, x in shares.items() for _ in range(round(x * args.count))]
    kinds = [kinds[i] for i in rng.permutation(len(kinds))]
    bags: dict[str, list[str]] = {"lib": [], "alien": []}
    def take(bag: str, source: list[str]) -> str:
        if not bags[bag]:
            bags[bag] = [source[i] for i in rng.permutation(len(source))]
        return bags[bag].pop()
    truth: dict[str, object] = {}
    for i, kind in enumerate(kinds):
        name, card = f"b{args.seed}_{i:03d}", rng.random() < 1 / 3
        wanted = {"null": [], "inseparable": [], "alien": [take("alien", list(ALIENS))] if kind == "alien" else []}.get(kind)
        if wanted is None:
            wanted = [take("lib", list(ACTS)) for _ in range(1 + (kind == "pair"))]
        for attempt in range(40):
            try:
                truth[name] = make_case(rng, kind, card, wanted, args.out / "cases" / name)
                break
            except ValueError as why:
                if os.environ.get("HAND_B_TALK"):
                    print("  again", name, kind, wanted, card, why, flush=True)
                if attempt > 3 and attempt % 4 == 0 and kind in ("single", "pair", "alien"):
                    wanted = [str(rng.choice(list(ALIENS if kind == "alien" else ACTS))) for _ in wanted]
        print(name, kind, card, [(h["name"], h["snr"], h["accept"]) for h in truth.get(name, {}).get("hidden", [])] if name in truth else "gave up", flush=True)
        (args.out / "truth.json").parent.mkdir(parents=True, exist_ok=True)
        (args.out / "truth.json").write_text(json.dumps(truth, indent=1))


if __name__ == "__main__":
    main()
