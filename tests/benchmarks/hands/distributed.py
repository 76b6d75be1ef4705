"""Campaigns of virtual vibrating gyros in a temperature chamber (hand A), written independently of the product.

python generator.py OUT --count 100 --seed S      writes OUT/cases/NAME/run_K.csv and OUT/truth.json
"""
from __future__ import annotations
import argparse, json
from collections import Counter
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Callable, Iterator
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize, minimize_scalar
from scipy.signal import lfilter

A = NDArray[np.float64]
G = 5.0                                              # s, grid of the simulation
F, B, Q = "frequency_Hz", "bias_deg_per_h", "inverse_q"
DRIVES = {"drive": "drive_amplitude_V", "volt": "electrode_bias_V", "quad": "quadrature_V", "angle": "pattern_angle_deg"}
NEED = {"amplitude-frequency": "drive", "self-heating": "drive", "electrostatic-softening": "volt",
        "quadrature-leakage": "quad", "axis-rotation": "angle"}
THERMAL = {"second-lag", "radiation", "self-heating", "thermometer-lag", "thermometer-scale", "clock-offset"}
ACTS: dict[str, tuple[str, ...]] = {
    "amplitude-frequency": (F,), "electrostatic-softening": (F,), "curvature": (F,), "clock-drift": (F,), "rate-frequency": (F,),
    "rate-bias": (B,), "cross-damping": (B,), "quadrature-leakage": (B,), "axis-rotation": (B,), "loss-peak": (Q,), "leak": (Q,),
    "mounting-stress": (F, B), "activity-dip": (F, Q), "hysteresis": (F, B, Q), "ageing": (F, B, Q), "jump": (F, B, Q),
    "periodic": (F, B, Q), **{n: (F,) for n in THERMAL}}
ALIENS: dict[str, tuple[str, ...]] = {"telegraph": (F, B), "fringes": (B,), "frost": (F,), "creaks": (F, B), "chirp": (F, B),
                                      "fan": (F, B), "adsorption": (F,), "spurs": (B,)}


def lag(u: A, tau: float, x0: float | None = None, dt: float = G) -> A:
    """First-order lag, exact for an input that is linear between samples."""
    e = np.exp(-dt / tau)
    b1 = 1 - (1 - e) * tau / dt
    return lfilter([b1, 1 - e - b1], [1, -e], u, zi=[(u[0] if x0 is None else x0) - b1 * u[0]])[0]


# ------------------------------------------------------------------ chamber, housing, plate
@dataclass
class Run:
    t: A
    air: A
    housing: A
    plate: A
    fan: A
    setpoint: A
    start_s: float                                   # since the start of the campaign
    drives: dict[str, A] = field(default_factory=dict)
    rows: A = field(default_factory=lambda: np.empty(0))
    hole_ends: list[float] = field(default_factory=list)
    start_offset: float = 0.0
    jitter: A = field(default_factory=lambda: np.empty(0))


def set_points(rng: np.random.Generator, hours: float, first: float, lo: float, hi: float) -> tuple[A, A]:
    """A profile that a laboratory would run: knots of (time, set point)."""
    kind = rng.choice(["step", "staircase", "triangle", "cycle", "there-and-back"])
    T = hours * 3600
    t, s = [0.0, rng.uniform(600, 2400)], [first, first]
    goals: list[float]
    if kind == "step":
        goals = [rng.choice([lo, hi])]
    elif kind == "staircase":
        g = np.linspace(lo, hi, int(rng.integers(3, 6)))
        goals = list(g if rng.random() < .5 else g[::-1])
    elif kind == "there-and-back":
        goals = [lo, hi, first] if rng.random() < .5 else [hi, first]
    else:
        goals = [hi, lo] * int(rng.integers(1, 3)) if rng.random() < .5 else [lo, hi] * int(rng.integers(1, 3))
    part = (T - t[1]) / len(goals)
    rate = rng.uniform(1, 4) / 60 if kind in ("step", "staircase", "there-and-back") else 0.0
    for k, g in enumerate(goals):
        ramp = min(abs(g - s[-1]) / rate, part * .9) if rate else part * (.97 if kind == "triangle" else .6)
        t += [t[1] + k * part + max(ramp, 60.), t[1] + (k + 1) * part]
        s += [g, g]
    return np.array(t), np.array(s)


def chamber(rng: np.random.Generator, hours: float, first: float, lo: float, hi: float, w: dict[str, float], start: float) -> Run:
    """PID-controlled air, compressor cycling, a film that depends on the fan, housing and slow plate (5 s steps)."""
    t = np.arange(0, hours * 3600, G)
    sp = np.interp(t, *set_points(rng, hours, first, lo, hi))
    n = len(t)
    out = np.empty((4, n))
    a = h = p = first
    a += rng.normal(0, .3); integ = 0.0; fan = 0.0; dist_phase = rng.uniform(0, w["cycle"])
    dist = w["ripple"] * np.sign(np.sin(2 * np.pi * (t + dist_phase) / w["cycle"] * (1 + .03 * np.sin(t / 3000)))) + rng.normal(0, .002, n)
    for k in range(n):
        e = sp[k] - a
        u = w["kp"] * e + w["ki"] * integ
        uu = min(max(u, -w["umax"]), w["umax"])
        if u == uu: integ += e * G
        fan = 1.0 if abs(sp[k] - h) > 2 else (0.0 if abs(sp[k] - h) < 1 else fan)
        out[:, k] = a, h, p, fan
        film = (1.0 if fan else w["calm"]) / w["tau_h"]
        da = uu + .15 * film * (h - a) * 3 + dist[k]
        h, p, a = h + G * (film * (a - h) + .08 * (p - h) / w["tau_p"]), p + G * (h - p) / w["tau_p"], a + G * da
    return Run(t, out[0], out[1], out[2], out[3], sp, start)


def stepped(rng: np.random.Generator, t: A, levels: A) -> A:
    """A drive that the operator steps every half hour to two hours."""
    edges = np.cumsum(rng.uniform(1800, 6500, 24))
    return rng.permutation(np.tile(levels, 25))[:25][np.searchsorted(edges, t)]


# ------------------------------------------------------------------ the device
@dataclass
class World:
    rng: np.random.Generator
    runs: list[Run]
    responses: list[str]
    drives: list[str]
    reference: bool
    dated: bool
    p: dict[str, Any]
    noise_kind: dict[str, str] = field(default_factory=dict)
    sigma: dict[str, float] = field(default_factory=dict)
    noise: dict[str, A] = field(default_factory=dict)
    cov: dict[str, Callable[[A, A], A]] = field(default_factory=dict)


@dataclass
class Effect:
    name: str
    response: str
    seed: int
    amp: float = 0.0
    between_runs: bool = False
    cap: float = np.inf


def network(w: World, run: Run, share: float, rad: float, power: A | None) -> A:
    """Ten nodes along stem and shell, finite volumes, exact exponential step by modes; radiation by Picard iteration."""
    n, p = 10, w.p
    C = np.r_[np.full(4, .06), np.full(6, .76 / 6)]
    foot, shell = np.eye(n)[0], np.r_[np.zeros(4), np.full(6, 1 / 6)]
    g_int = p["kappa"] / p["tau"] * np.r_[np.full(3, 2.0), np.full(6, 1.0)]
    gh = (foot * .9 * (1 - rad) + shell * (.1 * (1 - rad) + rad)) * (1 - share) / p["tau"]
    gp = shell * share / p["tau"]
    K = np.diag(gh + gp) + np.diag(np.r_[g_int, 0] + np.r_[0, g_int]) - np.diag(g_int, 1) - np.diag(g_int, -1)
    lam, V = np.linalg.eigh(K / np.sqrt(np.outer(C, C)))
    M = V.T / np.sqrt(C)
    lin = np.outer(M @ gh, run.housing) + np.outer(M @ gp, run.plate)
    if power is not None: lin += np.outer(M @ shell, power / p["tau"])
    z0 = V.T @ (np.sqrt(C) * (run.housing[0] + run.start_offset))

    def solve(src: A) -> A:
        z = np.stack([lag(s / l, 1 / l, z) for s, l, z in zip(src, lam, z0)])
        return (V / np.sqrt(C)[:, None]) @ z
    T = solve(lin)
    for _ in range(7 if rad else 0):
        k4 = lambda x: ((x + 273.15) ** 4) / (4 * 293.15 ** 3) - x
        T = solve(lin + (M * (shell * rad * (1 - share) / p["tau"])) @ (k4(run.housing) - k4(T)))
    return T


def preisach(T: A, rng: np.random.Generator, start: A | None) -> tuple[A, A]:
    """Hysteron ensemble; rate-independent, states survive between runs."""
    n = 150
    c, half = rng.normal(rng.uniform(-5, 35), 18, n), rng.uniform(.6, 1.4, n) * rng.uniform(1, 7)
    s = np.where(T[0] > c, 1., -1.) if start is None else start
    out, end = np.zeros(len(T)), np.empty(n)
    for k in range(n):
        raw = np.where(T > c[k] + half[k], 1., np.where(T < c[k] - half[k], -1., 0.))
        raw[0] = raw[0] or s[k]
        raw = raw[np.maximum.accumulate(np.where(raw != 0, np.arange(len(T)), 0))]
        out += raw / n; end[k] = raw[-1]
    return out, end


def signal(w: World, e: Effect, runs: list[tuple[Run, A]]) -> list[A]:
    """What one effect adds to its response, unit size, on each run's grid (x: mean temperature over nodes)."""
    r = np.random.default_rng(e.seed)
    total = runs[-1][0].start_s + runs[-1][0].t[-1]
    xall = np.concatenate([x.mean(0) for _, x in runs]); lo, hi = xall.min(), xall.max()
    u = {k: r.uniform() for k in "abcdefgh"}
    jr = int(r.integers(1, len(runs))) if e.between_runs and len(runs) > 1 else int(r.integers(len(runs)))
    keep, sgn = r.random() < .7, r.choice([-1., 1.])
    state: A | None = None; load = 0.0; kicks = np.sort(r.uniform(0, total, int(r.integers(9, 16)))); kamp = r.normal(0, 1, 16)
    out: list[A] = []
    for k, (run, nodes) in enumerate(runs):
        x, t, ta = nodes.mean(0), run.t, run.t + run.start_s
        z = (x - (lo + hi) / 2) / max(10., (hi - lo) / 2)
        grad = (nodes[0] - nodes[9]) * w.p["kappa"] / w.p["tau"]
        rr = np.random.default_rng(e.seed + 1)
        n = e.name
        if n == "amplitude-frequency": s = sgn * (run.drives["drive"] ** 2 + .02 * run.drives["drive"] ** 4)
        elif n == "electrostatic-softening": s = -run.drives["volt"] ** 2 * (1 + 1e-5 * run.drives["volt"] ** 2)
        elif n == "curvature":
            s = [z ** 3, z ** 4 + .5 * z ** 3, np.logaddexp(0, (z - u["a"] + .5) / .12)][int(u["b"] * 3)] * sgn
        elif n == "clock-drift": s = sgn * ta / 86400
        elif n in ("rate-frequency", "rate-bias"): s = sgn * grad * (1 + (.3 * u["a"] * z if n == "rate-bias" else 0))
        elif n == "cross-damping":
            s = [np.exp(-1.8 * z), np.tanh((z - u["a"] + .5) / .3), z ** 4 - .4 * z ** 5][int(u["b"] * 3)] * sgn
        elif n == "quadrature-leakage": s = sgn * run.drives["quad"] * (1 + .15 * (u["a"] - .5) * z)
        elif n == "axis-rotation": s = np.sin(4 * np.deg2rad(run.drives["angle"] - 40 * u["a"] - (.1 + .4 * u["b"]) * (x - 20)))
        elif n == "loss-peak":
            T0, Ea = lo + (hi - lo) * (.2 + .6 * u["a"]) + 273.15, .3 + .5 * u["b"]
            s = 1 / np.cosh(Ea / 8.617e-5 * (1 / (x + 273.15) - 1 / T0))
        elif n == "leak":
            fill = 86400 * (1 + 20 * u["a"]); s = fill * (1 - np.exp(-ta / fill)) * np.sqrt((x + 273.15) / 293.15) / 86400
        elif n == "mounting-stress":
            foot = nodes[0]; t1 = 2500 * 12 ** u["a"]; ref = state[0] if state is not None else foot[0]
            s = sgn * (foot - lag(foot, t1, ref)) + .3 * sgn * (foot - lag(foot, 3 * t1, foot[0]))
        elif n == "activity-dip":
            d, T0 = .3 + 1.7 * u["a"], lo + (hi - lo) * (.2 + .6 * u["b"])
            s = sgn * 2 * ((x - T0) / d) / (1 + ((x - T0) / d) ** 2) if e.response == F else 1 / (1 + ((x - T0) / d) ** 2)
        elif n == "hysteresis":
            s, state = preisach(x, rr, state); s = s * sgn
        elif n == "ageing": s = sgn * (1 - np.exp(-(ta / (3600 * 40 ** u["a"])) ** (.45 + .4 * u["b"])))
        elif n == "jump":
            t0 = -1. if e.between_runs else t[-1] * (.15 + .7 * u["a"]); rec = .6 * u["b"]
            s = sgn * np.where(t > t0, 1 - rec * (1 - np.exp(-np.maximum(t - t0, 0) / (900 + 5000 * u["c"]))), 0.) * (k == jr)
            if k > jr and (keep or e.between_runs): s = sgn * np.full(len(t), 1 - rec)
        elif n == "periodic":
            ph = 2 * np.pi * (ta if keep else t) / (1500 * 6 ** u["a"]); s = np.sin(ph) + .2 * np.sin(2 * ph + 1)
        # ---- causes outside the library
        elif n == "telegraph":
            s = sgn * (np.searchsorted(np.cumsum(rr.exponential(total / 22 * np.tile([.6, 1.4], 100))), ta) % 2).astype(float)
        elif n == "fringes":
            ph = (x - lo) / max((hi - lo) / (11 + 6 * u["a"]), .5) + u["b"]; s = (ph % 1) - .5
        elif n == "frost":
            s = np.empty(len(t)); dew = lo + .35 * (hi - lo)
            for i, T in enumerate(x):
                s[i] = -load
                load += G * ((1 - load) * .8e-4 * (1 + u["a"]) if T < dew else -load * (0 if T < dew + .3 * (hi - lo) else 2.5e-3))
        elif n == "creaks":
            s = sum((kamp[i] * np.where(ta > q, np.exp(-np.maximum(ta - q, 0) / (500 + 1500 * u["a"])), 0.) for i, q in enumerate(kicks)), np.zeros(len(t)))
        elif n == "chirp":
            det = 2.5e-3 * np.abs(z - u["a"] + .5) + 1.2e-4; s = np.sin(2 * np.pi * np.cumsum(det) * G * .25) / (1 + (det / 1.5e-3) ** 2)
        elif n == "fan": s = sgn * lag(run.fan, 60.) * (1 + .4 * np.sin(run.fan.cumsum() * G / 700))
        elif n == "adsorption":
            s = np.empty(len(t)); theta = load or .5
            kd = 1e-4 * np.exp(np.clip(5200 * (1 / 290 - 1 / (x + 273.15)), -6, 6))
            for i in range(len(t)):
                s[i] = -theta; theta += G * (1e-4 * (1 - theta) - min(kd[i], .02) * theta)
            load = theta
        elif n == "spurs":
            c = lo + (hi - lo) * (np.arange(7) + rr.uniform(.1, .9, 7)) / 7; m = rr.normal(0, 1, 7)
            s = sum((m[i] / (1 + ((x - c[i]) / (.5 + .5 * u["a"])) ** 2) for i in range(7)), np.zeros(len(t)))
        else: s = np.zeros(len(t))
        if n == "mounting-stress": state = np.array([lag(nodes[0], 2500 * 12 ** u["a"], ref)[-1]])
        out.append(np.asarray(s, float))
    return out


def simulate(w: World, effects: list[Effect]) -> dict[str, Any]:
    """Noise-free columns at the rows (concatenated) and the logged temperature, with these effects in force."""
    on = {e.name: e for e in effects if e.name in THERMAL}
    amp = lambda n: on[n].amp if n in on else 0.0
    p = w.p
    runs = [(r, network(w, r, p["plate_share"] + amp("second-lag"), amp("radiation"),
                        amp("self-heating") * r.drives["drive"] ** 2 if "self-heating" in on else None)) for r in w.runs]
    add = {e.response: [np.zeros(len(r.t)) for r in w.runs] for e in effects}
    ref = [np.zeros(len(r.t)) for r in w.runs]
    for e in effects:
        if e.name in THERMAL: continue
        for k, s in enumerate(signal(w, e, runs)):
            add[e.response][k] = add[e.response][k] + e.amp * s
            if e.response == F and e.name != "clock-drift": ref[k] = ref[k] + e.amp * s
    cols: dict[str, list[A]] = {c: [] for c in [F, B, Q, "T", "ref", *w.drives]}
    late = int(np.random.default_rng(on["clock-offset"].seed).integers(len(runs))) if "clock-offset" in on else -1
    scale_rng = np.random.default_rng(on["thermometer-scale"].seed if "thermometer-scale" in on else 0)
    c3, from_run, per_run = scale_rng.uniform(.4, 1.2), int(scale_rng.integers(1, max(2, len(runs)))), scale_rng.random() < .4 and len(runs) > 1
    for k, (r, nodes) in enumerate(runs):
        d = nodes - 20.0
        law = p["a1"] * d + p["a2"] * d ** 2 + p["a3"] * d ** 3
        f = p["f0"] + p["weights"] @ law
        m = (p["weights"] @ nodes - 20) / 30
        healthy = {F: f, B: p["b"] @ np.stack([m, m ** 2, m ** 3]) + p["boff"][k], Q: p["q"] @ np.stack([m * 0 + 1, m, m ** 2])}
        shift = amp("clock-offset") if k == late else 0.0
        for c in (F, B, Q):
            cols[c].append(np.interp(r.rows + shift, r.t, healthy[c] + add.get(c, ref)[k] if c in add else healthy[c]))
        cols["ref"].append(np.interp(r.rows + shift, r.t, f + ref[k]))
        T = lag(r.housing, p["sensor"] + amp("thermometer-lag") + 1e-3)
        if "thermometer-scale" in on:
            y = (T - 25) / 30
            T = T + amp("thermometer-scale") * ((1 + .3 * c3 * y) * (k >= from_run) if per_run else .5 * y ** 2 + c3 * y ** 3)
        cols["T"].append(np.round((np.interp(r.rows, r.t, T) + r.jitter * p["tn"]) / p["tq"]) * p["tq"])
        for c in w.drives: cols[c].append(np.interp(r.rows, r.t, r.drives[c]))
    return {c: np.concatenate(v) if v else v for c, v in cols.items()} | {"runs": runs}


# ------------------------------------------------------------------ the contract's baseline and rivals, refitted
class Judge:
    """Baseline and rivals by variable projection on block means, whitened with the noise's own covariance."""

    def __init__(self, w: World) -> None:
        self.w, self.n = w, [len(r.rows) for r in w.runs]
        self.run = np.repeat(np.arange(len(w.runs)), self.n)
        self.t = np.concatenate([r.rows for r in w.runs])
        self.ta = np.concatenate([r.rows + r.start_s for r in w.runs])
        m = max(1, int(np.ceil(sum(self.n) / 400)))
        self.start = np.concatenate([np.arange(0, k, m) + o for k, o in zip(self.n, np.cumsum([0, *self.n[:-1]]))])
        self.size = np.diff(np.r_[self.start, len(self.t)]).astype(float)
        bad = np.zeros(len(self.t), bool)
        for k, r in enumerate(w.runs):
            for h in r.hole_ends: bad |= (self.run == k) & (self.t > h - 1) & (self.t < h + w.p["tau"])
        self.ok = self.block(bad.astype(float)[:, None])[:, 0] < .01
        self.white: dict[str, A] = {}
        self.plain = np.sqrt(self.size) * self.ok

    def block(self, c: A) -> A:
        return np.add.reduceat(c, self.start, axis=0) / self.size[:, None]

    @staticmethod
    def weigh(W: A, M: A) -> A:
        return W[:, None] * M if W.ndim == 1 else W @ M

    def whitener(self, c: str) -> A:
        if c not in self.white:
            t, k = self.block(np.c_[self.t, self.ta])[self.ok].T, self.run[self.start][self.ok]
            C = np.where(k[:, None] == k, self.w.cov[c](t[0][:, None], t[0]), 0) + np.diag(self.w.p["white"][c] ** 2 / self.size[self.ok])
            W = np.linalg.inv(np.linalg.cholesky(C))
            full = np.zeros((len(W), len(self.ok))); full[:, self.ok] = W
            self.white[c] = full
        return self.white[c]

    def lag(self, u: A, tau: float) -> A:
        out = []
        for k in range(len(self.n)):
            t, v = self.t[self.run == k], u[self.run == k]
            g = np.arange(t[0], t[-1] + 10, 10.)
            out.append(np.interp(t, g, lag(np.interp(g, t, v), tau, dt=10.)))
        return np.concatenate(out)

    def ctx(self, data: dict[str, Any], tau: float) -> dict[str, Any]:
        x = self.lag(data["T"], tau) - 20
        return {"x": x, "h": data["T"] - 20, "tau": tau, "rate": (data["T"] - 20 - x) / tau * 100, "d": data,
                "z": np.clip((x - x.min()) / max(np.ptp(x), 1), 0, 1)}

    def base(self, c: str, k: dict[str, Any]) -> A:
        each = np.eye(len(self.n))[self.run]
        if c == B:
            g = k["d"][F] - k["d"][F].mean() - k.get("minus", 0) if F in self.w.responses else k["x"]
            g = g / np.abs(g).max()
            start = [] if F in self.w.responses else [each * np.exp(-self.t / k["tau"])[:, None]]
            return np.column_stack([each, g, g ** 2, g ** 3, *start])
        y = k["x"] / 40
        return np.column_stack([np.ones(len(y)), y, y ** 2, each * np.exp(-self.t / k["tau"])[:, None]])

    def chi(self, W: A, y: A, cols: A) -> tuple[float, A]:
        M, v = self.weigh(W, self.block(cols)), self.weigh(W, self.block(y[:, None]))[:, 0]
        M = M / (np.linalg.norm(M, axis=0) + 1e-300)
        co = np.linalg.lstsq(M, v, rcond=1e-11)[0]
        return float(np.sum((v - M @ co) ** 2)), co

    def fit_base(self, data: dict[str, Any], c: str, W: A) -> tuple[float, float]:
        if c == B and F in self.w.responses:
            tau = self.fit_base(data, F, self.plain)[0]
            return tau, self.chi(W, data[c] - data[c].mean(), self.base(c, self.ctx(data, tau)))[0]
        cost = lambda lt: self.chi(W, data[c] - data[c].mean(), self.base(c, self.ctx(data, float(np.exp(lt)))))[0]
        g = np.log(self.w.p["tau"]) + np.linspace(-1.6, 1.6, 9)
        i = int(np.argmin([cost(v) for v in g]))
        s = minimize_scalar(cost, bounds=(g[max(i - 1, 0)], g[min(i + 1, 8)]), method="bounded", options={"xatol": 3e-4})
        return float(np.exp(s.x)), float(s.fun)

    def snr(self, data: dict[str, Any], c: str, chi: bool = True) -> tuple[float, float]:
        """(SNR of what the baseline cannot absorb, as the contract defines it; its whitened chi squared)."""
        tau, left = self.fit_base(data, c, self.plain)
        near = [self.base(c, self.ctx(data, tau * f)) for f in (1, 1.02)]
        M = np.column_stack(near[:1] + ([] if c == B and F in self.w.responses else [near[1] - near[0]]))
        nz = self.w.noise[c]
        M = M / (np.linalg.norm(M, axis=0) + 1e-300)
        rest = nz - M @ np.linalg.lstsq(M, nz, rcond=1e-9)[0]
        return float(np.sqrt(left / self.size[self.ok].sum()) / np.std(rest)), self.fit_base(data, c, self.whitener(c))[1] if chi else 0.0

    def rivals(self, c: str) -> Iterator[tuple[str, list[tuple[float, ...]], Callable[[dict[str, Any], tuple[float, ...]], list[A]], int]]:
        """name, grid of shapes, columns(ctx, shape), sign of the first coefficient (0 free)."""
        t, ta, run, R = self.t, self.ta, self.run, len(self.n)
        each = [(run == k).astype(float) for k in range(R)]
        has = lambda d: d in self.w.drives
        day = ta / 86400
        lg: Callable[[float, float, int], list[tuple[float, ...]]] = lambda a, b, n: [(float(v),) for v in np.geomspace(a, b, n)]
        path = F not in self.w.responses or c != B                     # thermal effects show in this response
        p = self.w.p
        law = {F: (p["a1"], 2 * p["a2"], 0.), Q: (p["q"][1], 2 * p["q"][2] / 30, 0.), B: (p["b"][0], 2 * p["b"][1] / 30, 3 * p["b"][2] / 900)}[c]
        sl: Callable[[dict[str, Any]], A] = lambda k: (law[0] + law[1] * k["x"] + law[2] * k["x"] ** 2) / abs(law[0])     # slope of the law
        if path:
            yield "second-lag", lg(30, 40000, 9), lambda k, s: [sl(k) * (self.lag(k["h"], min(s[0], 3e5)) - k["x"])], 0
            yield "thermometer-lag", [()], lambda k, s: [sl(k) * k["rate"]], 1
            yield "radiation", [()], lambda k, s: [sl(k) * self.lag((k4(k["h"]) - k4(k["x"])) - (k["h"] - k["x"]), k["tau"])], 1
            yield "thermometer-scale", [()], lambda k, s: [sl(k) * self.lag(k["h"] ** j / 30 ** j, k["tau"]) for j in (2, 3, 4)], 0
            for q in range(1, R):
                yield "thermometer-scale", [()], lambda k, s, q=q: [sl(k) * (run >= q), sl(k) * self.lag(k["h"] / 30, k["tau"]) * (run >= q)], 0
            for q in range(R):
                yield "clock-offset", [()], lambda k, s, q=q: [sl(k) * each[q] * k["rate"]], 0
            if has("drive"): yield "self-heating", [()], lambda k, s: [sl(k) * self.lag(k["d"]["drive"] ** 2, k["tau"])], 1
        if c == F:
            yield "curvature", [()], lambda k, s: [(2 * k["z"] - 1) ** j for j in (3, 4, 5, 6)], 0
            yield "curvature", [()], lambda k, s: [np.cos(np.pi * j * k["z"]) for j in range(3, 20)], 0
            if not self.w.reference: yield "clock-drift", [()], lambda k, s: [day], 0
            yield "rate-frequency", [()], lambda k, s: [k["rate"]], 0
            if has("drive"): yield "amplitude-frequency", [()], lambda k, s: [k["d"]["drive"] ** 2, k["d"]["drive"] ** 4], 0
            if has("volt"): yield "electrostatic-softening", [()], lambda k, s: [k["d"]["volt"] ** 2], -1
        if c == B:
            yield "rate-bias", [()], lambda k, s: [k["rate"], k["rate"] * k["x"]], 0
            yield "cross-damping", [()], lambda k, s: [(2 * k["z"] - 1) ** j for j in (4, 5, 6, 7)], 0
            yield "cross-damping", [()], lambda k, s: [np.cos(np.pi * j * k["z"]) for j in range(3, 12)], 0
            if has("quad"): yield "quadrature-leakage", [()], lambda k, s: [k["d"]["quad"], k["d"]["quad"] * k["x"]], 0
            if has("angle"):
                ang = lambda k, s: 4 * np.deg2rad(k["d"]["angle"] - s[0] * k["x"])
                yield "axis-rotation", [(v,) for v in (-.6, -.3, .05, .12, .2, .3, .4, .5)], lambda k, s: [np.sin(ang(k, s)), np.cos(ang(k, s))], 0
        if c != Q: yield "mounting-stress", lg(600, 2e5, 7), lambda k, s: [k["x"] - self.lag(k["x"], min(s[0], 1e6))], 0
        if c != B:
            f = (lambda v: [v / (1 + v * v), 1 / (1 + v * v)]) if c == F else (lambda v: [1 / (1 + v * v), v / (1 + v * v)])
            yield "activity-dip", [(T, d) for T in np.linspace(-45, 55, 41) for d in (.4, 1.5)], lambda k, s: f((k["x"] - s[0]) / min(max(s[1], .05), 2.5)), 0
        if c == Q:
            yield "loss-peak", [(T, d) for T in np.linspace(-45, 55, 13) for d in (5., 12., 25.)], lambda k, s: [1 / np.cosh((k["x"] - s[0]) / min(max(s[1], 2.5), 60.))], 1
            yield "leak", [(1e5,), (1e6,)], lambda k, s: [(1 - np.exp(-ta / s[0])) * np.sqrt(1 + k["x"] / 293)], 1
        for cont in (True, False):
            def play(k: dict[str, Any], s: tuple[float, ...], cont: bool = cont) -> list[A]:
                cols, idx = [], self.start
                for r in (s[0], s[0] / 2, s[0] / 4):
                    y, v, last = np.empty(len(idx)), k["x"][idx[0]], -1
                    for i, (q, u) in enumerate(zip(run[idx], k["x"][idx])):
                        if q != last and (not cont or last < 0): v = u
                        last = q; v = min(max(v, u - r), u + r); y[i] = v
                    cols.append(np.repeat(y, self.size.astype(int)))
                return cols
            yield "hysteresis", lg(.4, 20, 6), play, 0
            yield "hysteresis", lg(1, 10, 4), lambda k, s, f=play: [v * (2 * k["z"] - 1) ** j for v in f(k, s) for j in (0, 1, 2, 3)], 0
        for tt in (ta, t) if R > 1 else (ta,):
            yield "ageing", lg(600, 3e5, 6), lambda k, s, tt=tt: [np.log1p(tt / s[0]), np.exp(-tt / s[0])], 0
        yield "ageing", [()], lambda k, s: [day], 0
        for q in range(R):
            grid = [(float(v), 3000.) for v in np.linspace(0.02, .98, 24) * t[run == q].max()] + ([(-1., 3000.)] if q else [])
            yield "jump", grid, lambda k, s, q=q: [((run == q) & (t > s[0])) * 1., ((run == q) & (t > s[0])) * np.exp(-np.maximum(t - s[0], 0) / max(abs(s[1]), 60)), (run > q) * 1.], 0
        yield "periodic", lg(500, 30000, 70), lambda k, s: [g(2 * np.pi * ta / s[0]) for g in (np.sin, np.cos)], 0
        yield "periodic", lg(800, 30000, 50), lambda k, s: [e * g(2 * np.pi * t / s[0]) for e in each for g in (np.sin, np.cos)], 0

    def judge(self, data: dict[str, Any], c: str, own: str) -> dict[str, tuple[float, int, A]]:
        """Per rival: the whitened chi squared that it leaves, its number of coefficients, its fitted signal on rows."""
        W, y = self.whitener(c), data[c] - data[c].mean()
        tau0 = self.fit_base(data, c, W)[0]
        free = not (c == B and F in self.w.responses)
        base: list[tuple[float, dict[str, Any], A, A, A]] = []
        true = self.fit_base(simulate(self.w, []), c, self.plain)[0] / tau0 if free else 1.
        for f in (1., true, .75, 1.35, .87, 1.15, .6, 1.7) if free else (1.,):
            k = self.ctx(data, tau0 * f); M = W @ self.block(self.base(c, k))
            q = np.linalg.qr(M / np.linalg.norm(M, axis=0))[0]; v = W @ self.block(y[:, None])[:, 0]
            base.append((tau0 * f, k, q, v - q @ (q.T @ v), M))
        out: dict[str, tuple[float, int, A]] = {}
        whole = float(np.sum(base[0][3] ** 2))
        for name, grid, cols, sign in self.rivals(c):
            best: tuple[float, float, tuple[float, ...]] = (np.inf, tau0, grid[0])
            for tau, k, q, v, _ in base if len(grid) < 3 else base[:4 if len(grid) < 20 else 2]:
                for s in grid:
                    X = W @ self.block(np.column_stack(cols(k, s))); X = X / (np.linalg.norm(X, axis=0) + 1e-300); X = X - q @ (q.T @ X)
                    val = float(np.sum((v - X @ np.linalg.lstsq(X, v, rcond=1e-9)[0]) ** 2))
                    if val < best[0]: best = (val, tau, s)

            def cost(pv: A) -> float:
                k = self.ctx(data, tau0 * float(np.exp(np.clip(pv[0], -2.5, 2.)))) if free else base[0][1]
                return self.chi(W, y, np.column_stack([self.base(c, k), *cols(k, shape(pv))]))[0]
            s0 = np.array(best[2])
            shape = lambda pv: tuple(float(a) * float(np.exp(b)) if name not in ("activity-dip", "loss-peak") or j else float(a) + 3 * b for j, (a, b) in enumerate(zip(s0, pv[1:])))
            x0 = np.r_[np.log(best[1] / tau0), np.zeros(len(s0))]
            if best[0] < .4 * whole + 30 or len(grid) == 1 or name == own:
                sim = np.vstack([x0, x0 + np.diag(np.full(len(x0), .12))])
                r = minimize(cost, x0, method="Nelder-Mead", options={"maxfev": (35 + 25 * len(s0)) * (2 if name == own else 1), "initial_simplex": sim, "fatol": .05, "xatol": 1e-5})
                if r.fun < best[0] + 1: best, x0 = (float(r.fun), 0., ()), r.x
            k = self.ctx(data, tau0 * float(np.exp(np.clip(x0[0], -2.5, 2.)))) if free else base[0][1]
            b, ex = self.base(c, k), np.column_stack(cols(k, shape(x0)))
            all_ = np.column_stack([b, ex]); val, co = self.chi(W, y, all_)
            co = co / np.linalg.norm(W @ self.block(all_), axis=0).clip(1e-300)
            if sign and co[b.shape[1]] * sign < 0: continue
            if name not in out or val + 2 * ex.shape[1] < out[name][0] + 2 * out[name][1]:
                out[name] = (val, ex.shape[1], ex @ co[b.shape[1]:])
        return out

    def bias_chi(self, data: dict[str, Any], minus: A | float) -> float:
        k = {**self.ctx(data, self.w.p["tau"]), "minus": minus}
        return self.chi(self.whitener(B), data[B] - data[B].mean(), self.base(B, k))[0]


def k4(x: A) -> A:
    return (x + 293.15) ** 4 / (4 * 293.15 ** 3)


# ------------------------------------------------------------------ drawing a campaign
def draw_noise(w: World, c: str, kind: str, sigma: float) -> None:
    rng, T = w.rng, np.mean([r.t[-1] for r in w.runs])
    part = {"white": (1., 0., 0.), "flicker": (.5, .87, 0.), "random-walk": (.5, 0., .87), "mixed": (.75, .5, .43), "rounding": (.55, 0., 0.)}[kind]
    wh, fl, rw = (sigma * v for v in part)
    taus = np.geomspace(60, 2e5, 9)
    q = rw ** 2 / (T / 2)
    out = []
    for r in w.runs:
        n = len(r.t)
        ou = sum((lfilter([np.sqrt(1 - (e := np.exp(-G / s)) ** 2)], [1, -e], rng.normal(0, 1, n), zi=[rng.normal() * e])[0] for s in taus), np.zeros(n))
        g = fl / 3 * ou + np.cumsum(rng.normal(0, np.sqrt(q * G), n))
        out.append(np.interp(r.rows, r.t, g) + rng.normal(0, wh, len(r.rows)))
    w.noise[c], w.noise_kind[c], w.sigma[c] = np.concatenate(out), kind, sigma
    step = sigma * (2.9 if kind == "rounding" else .25)
    w.p["step"][c] = 10. ** np.floor(np.log10(step)) * max(v for v in (1, 2, 5) if v * 10. ** np.floor(np.log10(step)) <= step * 1.001)
    w.p["white"][c] = float(np.hypot(wh, w.p["step"][c] / np.sqrt(12)))
    w.cov[c] = lambda a, b: fl ** 2 / 9 * sum(np.exp(-np.abs(a - b) / s) for s in taus) + q * np.minimum(a, b)


def make_world(rng: np.random.Generator, responses: list[str], drives: list[str], reference: bool, tied: bool, min_runs: int) -> World:
    dated = bool(rng.random() < .5)
    nr = max(min_runs, int(rng.choice([1, 2, 3, 4, 5], p=[.2, .3, .25, .15, .1])))
    w = {"kp": rng.uniform(.004, .008), "ki": rng.uniform(4e-6, 1.2e-5), "umax": rng.uniform(.04, .12), "cycle": rng.uniform(180, 480),
         "ripple": rng.uniform(5e-4, 4e-3), "tau_h": rng.uniform(240, 700), "calm": rng.uniform(.4, .8), "tau_p": rng.uniform(3000, 9000)}
    lo, hi = rng.uniform(-40, 0), rng.uniform(40, 70)
    runs, start = [], 0.0
    for _ in range(nr):
        hours = rng.uniform(3, 10 if nr < 4 else 6.5)
        runs.append(chamber(rng, hours, float(rng.choice([20., 25., lo, hi], p=[.4, .3, .15, .15])), lo, hi, w, start))
        start += hours * 3600 + 3600 * (rng.uniform(1, 60) if dated else rng.uniform(.1, 1))
    total = sum(r.t[-1] for r in runs)
    dt = max(float(rng.choice([5, 10, 15, 20, 30, 60])), next(v for v in (5., 10, 15, 20, 30, 60) if total / v < 4200 or v == 60))
    holes = rng.random() < .33
    tau = float(np.exp(rng.uniform(np.log(350), np.log(1600))))
    for r in runs:
        n = int(r.t[-1] / dt) - 1
        rows = np.arange(n) * dt + rng.uniform(-.12, .12, n) * dt + dt * .2
        keep = rng.random(n) > rng.choice([0, .003, .01])
        if holes and (r is runs[0] or rng.random() < .3):
            cand = [(rng.uniform(.15, .8) * r.t[-1], rng.uniform(600, 2400)) for _ in range(12)]
            err = [np.abs(r.housing[(i := slice(int(a / G), int((a + b) / G)))] - np.linspace(r.housing[i][0], r.housing[i][-1], len(r.housing[i]))).mean() for a, b in cand]
            a, b = cand[int(np.argmin(err))]
            keep &= (rows < a) | (rows > a + b); r.hole_ends = [a + b]
        r.rows = np.round(rows[keep], 2); r.start_offset = float(rng.normal(0, .4)); r.jitter = rng.normal(0, 1, len(r.rows))
    amp_levels, volt_levels = np.linspace(1, 1 + rng.uniform(.4, 1.5), 3), np.linspace(40, 40 + rng.uniform(20, 80), 3)
    for r in runs:
        r.drives = {"drive": stepped(rng, r.t, amp_levels) + .01 * (r.housing - 20) / 40, "volt": stepped(rng, r.t, volt_levels),
                    "quad": .3 * stepped(rng, r.t, np.array([-1., 0, 1])) + .2 * (r.housing - 20) / 40 + np.cumsum(rng.normal(0, .004, len(r.t))),
                    "angle": stepped(rng, r.t, np.array([0., 22.5, 45., 67.5])[: int(rng.integers(2, 5))])}
        if tied: r.drives["drive"] = r.drives["volt"] / 40
    wt = np.r_[np.full(4, .02), np.linspace(.06, .25, 6)]; wt /= wt.sum()
    f0 = rng.uniform(3500, 9000); k = f0 * rng.uniform(60, 95) * 1e-6
    p: dict[str, Any] = {"tau": tau, "kappa": rng.uniform(15, 60), "sensor": rng.uniform(2, 12), "plate_share": .004, "f0": f0, "a1": k, "a2": -k * rng.uniform(2e-4, 3e-3),
                         "a3": k * rng.uniform(-1, 1) * 2e-5, "weights": wt, "b": rng.normal(0, 1, 3) * [4, 1.5, .5], "boff": rng.normal(0, .5, nr),
                         "q": np.array([1, rng.normal(0, .15), rng.uniform(0, .08)]) * rng.uniform(1e-7, 2e-6), "tq": float(rng.choice([.001, .002, 1 / 256, .005, .01])), "tn": .002, "step": {}, "white": {}}
    W = World(rng, runs, responses, drives, reference, dated, p)
    kinds = ["white", "flicker", "random-walk", "mixed", "rounding"]
    for c in responses:
        sig = {F: np.exp(rng.uniform(np.log(.003), np.log(.03))), B: np.exp(rng.uniform(np.log(.03), np.log(.3))), Q: p["q"][0] * np.exp(rng.uniform(np.log(.002), np.log(.01)))}[c]
        draw_noise(W, c, str(rng.choice(kinds, p=[.3, .2, .15, .2, .15])), float(sig))
    return W


def heal(w: World) -> dict[str, tuple[float, float]] | None:
    """Lump the device until the contract's baseline follows its healthy self to well within the noise."""
    j = Judge(w)
    for _ in range(9):
        data = simulate(w, [])
        if all(j.snr(data, c, False)[0] < .2 for c in w.responses):
            left = {c: j.snr(data, c) for c in w.responses}
            if all(x < 8 for _, x in left.values()): return left
        w.p["kappa"] *= 2; w.p["sensor"] /= 2; w.p["a3"] /= 2; w.p["plate_share"] /= 2; w.p["tq"] = max(w.p["tq"] / 2, .0005); w.p["tn"] /= 2
        w.p["b"][2] *= .7
    return None


START = {"second-lag": .1, "radiation": .3, "self-heating": .5, "thermometer-lag": 20., "thermometer-scale": .2, "clock-offset": 20.}
CAP = {"second-lag": .7, "radiation": 1., "self-heating": 20., "thermometer-lag": 900., "thermometer-scale": 6., "clock-offset": 900.}


def scale(w: World, j: Judge, e: Effect, target: float) -> tuple[float, float, str] | None:
    """Size the effect to the wanted SNR in the response where it shows most."""
    e.amp = START.get(e.name, w.sigma.get(e.response, 1.))
    for _ in range(6):
        data = simulate(w, [e])
        got = {c: j.snr(data, c, False) for c in w.responses if c == e.response or e.name in THERMAL}
        c = max(got, key=lambda v: got[v][0]); s, x = got[c]
        if abs(s / target - 1) < .03 or (e.amp >= CAP.get(e.name, np.inf) and s < target): break
        e.amp = min(e.amp * float(np.clip(target / max(s, 1e-9), 1e-3, 1e3)), CAP.get(e.name, np.inf))
    capped = e.amp >= CAP.get(e.name, np.inf) and s > .8
    return (s, j.snr(data, c)[1], c) if abs(s / target - 1) < .15 or capped else None


def accepted(w: World, j: Judge, e: Effect, c: str, alien: bool) -> tuple[list[str], list[str], float]:
    data = simulate(w, [e]); fits = j.judge(data, c, e.name); base = j.snr(data, c)[1]
    if alien: return [], [], min((v[0] for v in fits.values()), default=base) / base
    tot = {}
    for n, (x, k, s) in fits.items():
        if c == F and B in w.responses: x += j.bias_chi(data, 0. if n in THERMAL else s)
        tot[n] = x + 2 * k
    own = tot.get(e.name, 12.); left = own; own = min(own, .1 * base + 12)
    if e.name == "clock-drift" and w.reference: tot = {}            # the reference clock tells it from everything
    names = sorted((n for n in tot if n != e.name), key=lambda n: tot[n])
    return [e.name] + [n for n in names if tot[n] < own + 6], [n for n in names if own + 6 <= tot[n] < own + 30], left


INSEPARABLE = ["clock-drift", "thermometer-lag", "rate-frequency", "electrostatic-softening", "thermometer-scale", "jump", "ageing", "leak"]


def attempt(rng: np.random.Generator, kind: str, names: list[str], target: float) -> tuple[World, list[Effect], dict[str, Any]] | None:
    table = ALIENS if kind == "alien" else ACTS
    where = [str(rng.choice(table[n])) for n in names]
    ins = kind == "inseparable"
    if ins: where = [F if F in table[names[0]] else where[0]]
    extra = [] if ins and rng.random() < .8 else [c for c in (F, B, Q) if rng.random() < {F: .8, B: .4, Q: .3}[c]]
    resp = [c for c in (F, B, Q) if c in {*where, *extra}] or [F]
    need = {NEED[n] for n in names if n in NEED} | ({"drive"} if ins and names[0] == "electrostatic-softening" else set())
    drives = [d for d in DRIVES if d in need or rng.random() < .12]
    w = make_world(rng, resp, drives, F in resp and not ins and bool(rng.random() < .15), ins and names[0] == "electrostatic-softening",
                   2 if {*names} & {"clock-offset", "jump"} else 1)
    healthy = heal(w)
    if healthy is None: return None
    j = Judge(w); effects, hidden = [], []
    for n, c in zip(names, where):
        e = Effect(n, c, int(rng.integers(1 << 30)), between_runs=ins and n == "jump")
        got = scale(w, j, e, target)
        if got is None or got[1] < 25: return None
        acc, near, share = accepted(w, j, e, got[2], kind == "alien")
        if kind == "alien" and share < .25: return None
        if ins and len(acc) < 2: return None
        effects.append(e)
        hidden.append({"name": n, "response": got[2], "snr": round(got[0], 2), "accept": acc, "near": near, "amplitude": e.amp, "chi2": round(got[1], 1),
                       "own_family_leaves": round(share, 1)})
        if kind == "alien": hidden[-1] |= {"best_rival_leaves": round(share, 3), "weak": bool(got[1] * share < 60)}   # weak: hardly to be told from a library effect
    return w, effects, {"hidden": hidden, "healthy_left_over": {c: [round(s, 3), round(x, 1)] for c, (s, x) in healthy.items()}}


def write(out: Path, name: str, w: World, effects: list[Effect]) -> dict[str, float]:
    folder = out / "cases" / name; folder.mkdir(parents=True, exist_ok=True)
    data = simulate(w, effects); rng = w.rng; floor = {}
    rnd = lambda v, s: np.round(v / s) * s
    text: dict[str, list[str]] = {}
    fmt = lambda v, s: [f"{a:.{max(0, int(np.ceil(-np.log10(s) - 1e-9)))}f}" for a in rnd(v, s)]
    for c in w.responses:
        s = w.p["step"][c]; noisy = rnd(data[c] + w.noise[c], s); floor[c] = float(np.std(noisy - data[c]))
        text[c] = [f"{a:.6e}" for a in noisy] if c == Q else fmt(noisy, s)
    if w.reference: text["reference_frequency_Hz"] = fmt(data["ref"] + w.noise[F] + rng.normal(0, w.sigma[F] * .2, len(w.noise[F])), w.p["step"][F])
    for d in w.drives: text[DRIVES[d]] = [f"{a:.4f}" for a in data[d]]
    air = np.concatenate([np.interp(r.rows, r.t, r.setpoint) for r in w.runs])
    if rng.random() < .4: text["chamber_temperature_degC"] = [f"{a:.2f}" for a in air]
    temp = [f"{a:.5f}" for a in data["T"]]
    day, o = datetime(2025, int(rng.integers(1, 12)), int(rng.integers(1, 28)), 8, 30), 0
    for k, r in enumerate(w.runs):
        n = len(r.rows); head = ["# instrument: virtual gyro, hand A"]
        if w.dated: head.append(f"# start: {(day + timedelta(seconds=round(r.start_s))).isoformat()}")
        if any(v == "rounding" for v in w.noise_kind.values()): head += [f"# resolution {c}: {w.p['step'][c]:g}" for c in w.responses]
        rows = [",".join(["time_s", "housing_temperature_degC", *text])]
        rows += [",".join([f"{r.rows[i]:.2f}", temp[o + i], *(v[o + i] for v in text.values())]) for i in range(n)]
        (folder / f"run_{k}.csv").write_text("\n".join(head + rows) + "\n", encoding="utf-8"); o += n
    return floor


def plan(count: int, rng: np.random.Generator) -> list[tuple[str, list[str]]]:
    n = {"null": round(.15 * count), "alien": round(.15 * count), "pair": round(.08 * count), "inseparable": round(.07 * count)}
    deck = [str(v) for _ in range(9) for v in rng.permutation(list(ACTS))]; ali = [str(v) for _ in range(9) for v in rng.permutation(list(ALIENS))]
    cases: list[tuple[str, list[str]]] = [("single", [deck.pop(0)]) for _ in range(count - sum(n.values()))]
    for _ in range(n["pair"]):
        a = deck.pop(0); b = next(v for v in deck if v != a); deck.remove(b); cases.append(("pair", [a, b]))
    ins = [str(v) for _ in range(3) for v in rng.permutation(INSEPARABLE)]
    cases += [("inseparable", [ins[i]]) for i in range(n["inseparable"])] + [("alien", [ali[i]]) for i in range(n["alien"])] + [("null", [])] * n["null"]
    return [cases[i] for i in rng.permutation(len(cases))]


def main() -> None:
    ap = argparse.ArgumentParser(); ap.add_argument("out", type=Path); ap.add_argument("--count", type=int, default=100); ap.add_argument("--seed", type=int, default=0)
    a = ap.parse_args(); rng = np.random.default_rng(a.seed); truth: dict[str, Any] = {}; tries: Counter[str] = Counter()
    right = {"null": ["adequate"], "alien": ["unexplained"]}
    for i, (kind, names) in enumerate(plan(a.count, rng)):
        for k in range(40):
            target = float(rng.choice([1, 3, 6], p=[.25, .4, .35])) if k < 12 else 3.0
            got = attempt(np.random.default_rng([a.seed, i, k]), kind, names, target)
            tries["+".join(names)] += 1
            if got: break
        else:
            print("gave up", kind, names, flush=True); continue
        w, effects, info = got; name = f"case_{i:03d}"
        floor = write(a.out, name, w, effects)
        truth[name] = {"kind": kind, "card": False, "responses": w.responses, "noise": ", ".join(f"{c}: {v}" for c, v in w.noise_kind.items()), **info,
                       "right_verdicts": right.get(kind, ["explained", "not-identifiable"]), "noise_floor_rms": floor}
        print(i, kind, k + 1, [(h["name"], h["snr"], h["chi2"], h["own_family_leaves"], h["accept"]) for h in info["hidden"]], flush=True)
    (a.out / "truth.json").write_text(json.dumps(truth, indent=1)); print(dict(tries))


if __name__ == "__main__":
    main()
