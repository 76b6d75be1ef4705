"""Campaigns of a foreign gyro in a foreign chamber (hand C), with what is hidden in them, written independently of the product.

    python pi_chamber.py OUT --count 40 --seed 90125      ->  OUT/truth.json, OUT/cases/cNNN/run_K.csv (, card.toml), unseen.csv

Chamber: PI controller with limited heater, compressor ripple, doors, setpoints changed by hand. Device: housing -> base -> (stem) -> shell,
solid paths, a gas path whose conductivity grows as T^0.7, radiation; everything integrated with 2 s steps.
SNR: e = the response with the effect minus without, on the recorded rows; e and one draw of the noise are averaged over 100 s, both are
projected off the tangent of a healthy model (an offset and a starting transient per run; T, T^2 and the lag's derivative for the frequency;
T, T^2, T^3 for the bias; T, T^2 for 1/Q), and SNR = rms(e) / rms(noise).
"""

import argparse, datetime as dt
import json
from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar

DT, K0, SIG = 2.0, 273.15, 5.67e-8
F, B, Q = "frequency_Hz", "bias_deg_per_h", "inverse_q"
DAY0 = dt.datetime(2026, 3, 2, 8, 0, 0)

# --- chamber and drive ---------------------------------------------------------------------------------------------------
def setpoints(rng, hours):
    """A list of (kind, value, seconds): ramps and soaks, some steps of the setpoint by hand."""
    n, out = int(hours * 3600 / DT), []
    value, low, high, sp, k = float(rng.uniform(15, 28)), -25.0, 60.0, np.empty(n), 0
    while k < n:
        if rng.random() < 0.75 or not out:
            target = float(np.clip(rng.uniform(low, high), value - 45, value + 45))
            rate = float(np.exp(rng.uniform(np.log(0.25), np.log(2.5)))) / 60.0 * DT
            steps = max(int(abs(target - value) / rate), 1)
            piece = np.linspace(value, target, steps)
        else:  # a hand turns the knob
            target = value + float(rng.choice([-1, 1]) * rng.uniform(3, 15))
            piece = np.array([target])
        soak = np.full(int(rng.uniform(600, 5400) / DT), target)
        piece = np.concatenate([piece, soak])[: n - k]
        sp[k : k + len(piece)] = piece
        k, value = k + len(piece), target
        out.append(target)
    return sp

def chamber(rng, sp):
    """Air temperature and heater effort (-1 ... 1) of a PI-controlled chamber with ripple and doors."""
    gain, reset = rng.uniform(0.25, 0.8), rng.uniform(250, 900)
    power, loss = rng.uniform(0.06, 0.12), 1 / rng.uniform(1500, 4000)  # K/s at full effort, 1/s
    period, depth = rng.uniform(150, 700), rng.uniform(0.0, 0.012) * (rng.random() < 0.7)
    doors = rng.uniform(0, len(sp) * DT, rng.integers(0, 3))
    room, air, wall, integral = 22.0, float(sp[0]), float(sp[0]), (sp[0] - 22.0) * loss / power * reset / gain
    t = np.arange(len(sp)) * DT
    door = np.zeros(len(sp))
    for d in doors: door[(t > d) & (t < d + rng.uniform(15, 90))] = 0.02
    ripple = depth * np.sign(np.sin(2 * np.pi * t / period) - 0.3)
    hum = 0.0008 * rng.standard_normal(len(sp))
    T, U = np.empty(len(sp)), np.empty(len(sp))
    for k in range(len(sp)):
        err = sp[k] - air
        u = gain * err + gain * integral / reset
        lim = min(max(u, -1.0), 1.0)
        if u == lim or u * err < 0: integral += err * DT
        air += DT * (power * lim + loss * (room - air) + door[k] * (room - air) + ripple[k] + hum[k] + (wall - air) / 400)
        wall += DT * (air - wall) / 900
        T[k], U[k] = air, lim
    return T, U

def lag(x, tau, start=None):
    y, a = np.empty(len(x)), 1 - np.exp(-DT / tau)
    s = float(x[0] if start is None else start)
    for k, v in enumerate(x):
        s += a * (v - s)
        y[k] = s
    return y

# --- the device ----------------------------------------------------------------------------------------------------------
def network(P, H, off, heat=None, mass=(0.0, 1.0), share=0.0):
    """Base, stem and shell behind the housing H. heat: W into the shell; mass: (conductance over the mount's, time constant) of a part
    that hangs on the base; share: of the mount's and the stem's exchange that goes as T^4 instead."""
    b, m, s, x = H[0] + off[0], H[0] + off[1], H[0] + off[1], H[0] + off[0]
    Gm, Gs, Gg, Cb, Cm, Cs = P["Gm"], P["Gs"], P["Gg"], P["Cb"], P["Cm"], P["Cs"]
    Em, Ef, Gx, Gh = P["Em"] * SIG, P["Ef"] * SIG, mass[0] * Gm, P["Gh"]
    Cx, c3 = Gx * mass[1], 4 * 293.15**3
    S, Bs, sub = np.empty(len(H)), np.empty(len(H)), max(int(np.ceil(DT * (Gm + 2 * Gs) / Cb * 3)), 1)
    h = DT / sub
    for k in range(len(H)):
        w = H[k]
        for _ in range(sub):
            qm = Gm * (w - b) + Em * ((w + K0) ** 4 - (b + K0) ** 4)
            g = Gg * ((0.5 * (b + s) + K0) / 293.15) ** 0.7
            if share:
                qm = Gm * ((1 - share) * (w - b) + share * ((w + K0) ** 4 - (b + K0) ** 4) / c3)
                g *= 1 - share
                qs = Gs * (1 - share) * (b - s) + share * (Gs + Gg) * ((b + K0) ** 4 - (s + K0) ** 4) / c3
                q1, q2 = qs, qs
            elif Cm:
                q1, q2 = 2 * Gs * (b - m), 2 * Gs * (m - s)
                m += h * (q1 - q2) / Cm
            else: q1 = q2 = Gs * (b - s)
            qg = g * (b - s) + Ef * ((b + K0) ** 4 - (s + K0) ** 4)
            qh = Gh * ((0.5 * (w + s) + K0) / 293.15) ** 0.7 * (w - s)
            b += h * (qm - q1 - qg - Gx * (b - x)) / Cb
            s += h * (q2 + qg + qh + (heat[k] if heat is not None else 0.0)) / (Cs * (1 + P["cs"] * (s - 20)))
            if Gx: x += h * Gx * (b - x) / Cx
        S[k], Bs[k] = s, b
    return S, Bs

def draw_device(rng, card):
    """The device, and for a card campaign what its card says (values off by their stated widths)."""
    D = {"f0": rng.uniform(3000, 9000), "a1": rng.choice([8.4e-5, 7.9e-5, 9.2e-5, -4e-5, 1.2e-4]) * rng.uniform(0.9, 1.1)}
    D |= {"a2": rng.normal(-5e-8, 8e-8), "k": [rng.uniform(-2, 8), 0, 0, 0], "q0": 10 ** rng.uniform(-7.3, -6), "qs": rng.normal(4e-3, 2e-3)}
    D |= {"qc": rng.normal(0, 2e-5), "sensor_lag": 0.0, "hl": rng.uniform(200, 900)}
    Cs, tau = rng.uniform(1.5, 3.5), np.exp(rng.uniform(np.log(350), np.log(2200)))
    rich = not card and rng.random() < 0.3
    G, gas = Cs / tau, rng.uniform(0.05, 0.35) if rich else rng.uniform(0.002, 0.012)
    P = {"Cs": Cs, "Gs": G * (1 - gas), "Gg": G * gas, "Cb": 20.0, "Cm": 0.0, "Em": 0.0, "Ef": 0.0, "cs": 0.0, "Gh": 0.0}
    P["Gm"] = P["Cb"] / rng.uniform(1.5, 4)
    if rich: P |= {"Gm": P["Cb"] / rng.uniform(30, 250), "Gh": G * rng.uniform(0, 0.2), "cs": rng.uniform(0, 2e-3)}
    C = None
    if card == "law":
        P["Gm"] = P["Cb"] / rng.uniform(60, 400)
        C = {"lag": tau * np.exp(rng.normal(0, 0.2)), "second": P["Cb"] / P["Gm"] * np.exp(rng.normal(0, 0.3))}
    if card == "geometry":
        z = rng.uniform(0.85, 1.3)
        D["f0"], D["a1"], D["a2"] = 4432.07 / z * (1 + 2e-3 * rng.normal()), rng.normal(88.7e-6, 5e-6), rng.normal(-5e-8, 8e-8)
        A = 2 * np.pi * 0.015**2 * z**2
        P |= {"Cs": 1.93 * z**3 * rng.normal(1, 0.03), "Cm": 0.64 * z**3, "Gs": 1.35e-3 * z * rng.normal(1, 0.02), "Ef": 2 * A * 0.03 * rng.uniform(0.5, 1.6)}
        P |= {"Gg": 1.35e-3 * z * rng.uniform(0, 0.01), "Cb": rng.uniform(12, 30), "Gm": rng.uniform(0.02, 0.08), "Em": 1e-3 * rng.uniform(0.6, 1.5)}
        C = {"z": z, "Gm": P["Gm"] * np.exp(rng.normal(0, 0.2)), "Cb": P["Cb"] * np.exp(rng.normal(0, 0.2))}
        D["sensor_lag"] = rng.uniform(1, 4)
    span = abs(D["a1"]) * D["f0"] * 30
    D["k"][1:] = [rng.normal(0, 4) / span, rng.normal(0, 1.0) / span**2, rng.normal(0, 0.4) / span**3]
    D |= {"P": P, "rich": rich, "tau": tau if card != "geometry" else (P["Cs"] + 0.2) / (P["Gs"] + P["Gg"])}
    return D, C

def card_text(D, C, rng, name):
    fr = lambda x: f"{x:.6g}"
    k, span = D["k"], abs(D["a1"]) * D["f0"] * 30
    off = lambda v, sd: f"{{ value = {v + sd * rng.normal():.6g}, sd = {sd:.6g} }}"
    txt = f'schema = "hrg.card/1"\nname = "{name}"\nreference_temperature_degC = 20.0\n'
    if "lag" in C:
        txt += f"[law]\nf0_Hz = {off(D['f0'], 2e-4 * D['f0'])}\na1_per_K = {off(D['a1'], 3e-6)}\na2_per_K2 = {off(D['a2'], 5e-8)}\na3_per_K3 = 0.0\n"
        txt += f"lag_s = {{ value = {fr(C['lag'])}, relative_sd = 0.25 }}\nsecond_lag_s = {{ value = {fr(C['second'])}, relative_sd = 0.4 }}\n"
        txt += f"radiated_share = {{ value = 0.05, sd = 0.1 }}\nchamber_lag_s = {{ value = {fr(D['hl'] * 1.1)}, relative_sd = 0.3 }}\n"
    else:
        z = C["z"]
        txt += f'[resonator]\nshape = "hemisphere"\nradius_mm = {15 * z:.5f}\nthickness_mm = {0.8558278 * z:.6f}\nsupport = "stem"\n'
        txt += f'[resonator.stem]\nradius_mm = {2.5 * z:.5f}\nend_mm = {-5 * z:.5f}\nside = "inner"\nfillet_mm = {0.5 * z:.5f}\n[material]\nname = "fused-silica"\n'
        txt += f"[thermal]\ncells = 1\nmount_conductance_W_per_K = {{ value = {fr(C['Gm'])}, relative_sd = 0.25 }}\n"
        txt += f"base_heat_capacity_J_per_K = {{ value = {fr(C['Cb'])}, relative_sd = 0.25 }}\n"
    txt += f"[bias]\noffset_deg_per_h = {off(k[0], 2.0)}\ndamping_anisotropy = {{ value = 0.0, sd = 0.0 }}\n"
    txt += f"k1_deg_per_h_per_Hz = {off(k[1], 2 / span)}\nk2_deg_per_h_per_Hz2 = {off(k[2], 0.6 / span**2)}\nk3_deg_per_h_per_Hz3 = {off(k[3], 0.4 / span**3)}\n"
    txt += f"[loss]\ninverse_q = {{ value = {D['q0'] * np.exp(rng.normal(0, 0.1)):.6g}, relative_sd = 0.15 }}\nslope_per_K = {off(D['qs'], 1.5e-3)}\ncurvature_per_K2 = {off(D['qc'], 2e-5)}\n"
    return txt + f"[noise]\nhousing_lag_s = {{ value = {2.5 if 'z' in C else 0.5}, sd = {1.0 if 'z' in C else 0.5} }}\n"

def healthy(D, S):
    x = S - 20.0
    df = D["f0"] * (D["a1"] * x + D["a2"] * x**2)
    k = D["k"]
    return {F: D["f0"] + df, B: k[0] + k[1] * df + k[2] * df**2 + k[3] * df**3, Q: D["q0"] * (1 + D["qs"] * x + D["qc"] * x**2)}

# --- noise ---------------------------------------------------------------------------------------------------------------
def markov(rng, t, tau):
    y = np.empty(len(t))
    y[0] = rng.standard_normal()
    for k in range(1, len(t)):
        a = np.exp(-(t[k] - t[k - 1]) / tau)
        y[k] = a * y[k - 1] + np.sqrt(1 - a * a) * rng.standard_normal()
    return y

def noise(rng, kind, tau, t):
    """Of unit size, roughly one rms; the white part never vanishes."""
    w = rng.standard_normal(len(t))
    if kind in ("white", "quantised"): return w * (1.0 if kind == "white" else 0.4)
    walk = np.concatenate([[0.0], np.cumsum(rng.standard_normal(len(t) - 1) * np.sqrt(np.diff(t)))]) / 60.0  # 1 after 1 h
    pink = sum(markov(rng, t, x) for x in 8.0 * 2.5 ** np.arange(9)) / 3.0
    if kind == "flicker": return 0.3 * w + 0.9 * pink
    if kind == "markov": return 0.5 * w + 0.85 * markov(rng, t, tau)
    return 0.8 * w + 0.7 * walk if kind == "walk" else 0.6 * w + 0.5 * pink + 0.3 * walk

# --- effects: additive shapes of unit size on the fine grid, or changes of the network --------------------------------------
BIAS, FREQ, LOSS = (B,), (F,), (Q,)
KNOWN = {
    "second-lag": FREQ, "rate-bias": BIAS, "hysteresis": (F, B, Q), "ageing": (F, B, Q), "jump": (F, B, Q), "activity-dip": (F,),
    "electrostatic-softening": FREQ, "amplitude-frequency": FREQ, "curvature": FREQ, "cross-damping": BIAS, "self-heating": FREQ,
    "loss-peak": LOSS, "leak": LOSS, "periodic": (F, B, Q), "radiation": FREQ, "clock-drift": FREQ, "quadrature-leakage": BIAS,
    "axis-rotation": BIAS, "thermometer-scale": FREQ, "mounting-stress": (F, B),
}  # fmt: skip
ALIEN = {"telegraph": (F, B), "frost": (F, B), "chirp": (B, F), "pulses": (F, B), "heater-crosstalk": (B, F), "dead-zone": BIAS}
NETWORK = ("second-lag", "self-heating", "radiation", "thermometer-scale")
SIZE = {"second-lag": 0.02, "self-heating": 1e-5, "radiation": 0.05, "thermometer-scale": 0.02}
TOP = {"second-lag": 3.0, "self-heating": 1.0, "radiation": 0.95, "thermometer-scale": 30.0}

def draw_shape(rng, name, runs):
    """Random constants of an effect, once a campaign."""
    low, high = np.percentile(np.concatenate([r["S"] for r in runs]), [12, 88])
    c = {"T": rng.uniform(low, high), "w": rng.uniform(4, 12), "tau": rng.uniform(3000, 20000), "per": np.exp(rng.uniform(np.log(300), np.log(5000)))}
    c |= {"sign": float(rng.choice([-1, 1])), "u": rng.random(), "run": int(rng.integers(len(runs))), "rng": int(rng.integers(2**31)), "age": rng.uniform(3, 60) * 3600}
    if name == "activity-dip": c["w"] = rng.uniform(0.4, 1.8)
    return c

def additive(name, D, c, r, k, resp):
    """Return {response: shape} of an effect on the fine grid of run r, number k."""
    S, t, T = r["S"], r["t"], r["abs"] + r["t"]
    rng, x, dS = np.random.default_rng(c["rng"] + k), S - 20.0, np.gradient(S, DT)
    if name == "rate-bias": y = dS
    elif name == "hysteresis":  # Dahl's friction
        y, z = np.empty(len(S)), 0.0
        for i, d in enumerate(np.diff(S, prepend=S[0])):
            z += d / c["w"] * (1 - z * np.sign(d))
            y[i] = z
    elif name in ("ageing", "clock-drift", "leak"):
        y = 1 - np.exp(-((T / c["age"]) ** (0.65 if name == "ageing" else 1.0)))
        y = np.log1p(T / c["age"] * 20) if name != "leak" and c["u"] < 0.5 else y
        y = y * np.sqrt((S + K0) / 293.15) if name == "leak" else y
    elif name == "jump":
        at = (0.15 + 0.7 * c["u"]) * t[-1]
        y = np.ones(len(t)) if k > c["run"] else np.zeros(len(t)) if k < c["run"] else np.clip((t - at) / 30.0, 0, 1)
    elif name == "activity-dip":  # a damped mode that the temperature drives across ours; kappa below the hop
        d = (c["sign"] * (S - c["T"]) + 1j * c["w"]) / 2
        root = np.sqrt(d**2 + (0.3 * c["w"]) ** 2)
        lam = np.where(np.abs(d - root) < np.abs(d + root), d - root, d + root)
        return {F: lam.real, Q: 2 * np.abs(lam.imag) / D["f0"]}
    elif name == "electrostatic-softening": y = -(r["electrode_bias_V"] ** 2)
    elif name == "amplitude-frequency": y = r["drive_amplitude_V"] ** 2
    elif name == "curvature": y = x**3 / 3e4 if c["u"] < 0.5 else np.logaddexp(0, (S - c["T"]) / (0.5 * c["w"]))
    elif name == "cross-damping": y = np.tanh((S - c["T"]) / c["w"]) if c["u"] < 0.5 else np.exp(c["sign"] * x / 9.0)
    elif name == "loss-peak": y = 1 / np.cosh(0.5 / 8.617e-5 * (1 / (S + K0) - 1 / (c["T"] + K0)))
    elif name == "periodic":
        ph = 2 * np.pi * T / c["per"] + 6 * c["u"]
        y = np.sin(ph) + 0.2 * np.sin(2 * ph + 1)
    elif name == "quadrature-leakage": y = r["quadrature_V"]
    elif name == "axis-rotation":
        psi = np.deg2rad(4 * (r["pattern_angle_deg"] - 30 * c["u"]))
        y = np.sin(psi - np.deg2rad(4 * 0.15 * c["sign"] * x)) - np.sin(psi)
    elif name == "mounting-stress":  # a bond whose relaxation is activated
        y, z = np.empty(len(S)), 0.0
        for i, d in enumerate(np.diff(S, prepend=S[0])):
            z += d - z * DT / (c["tau"] * np.exp(4000 * (1 / (S[i] + K0) - 1 / 293.15)))
            y[i] = z
    elif name == "telegraph":
        flips = np.cumsum(rng.exponential(1500 + 3000 * c["u"], 40))
        y = (np.searchsorted(flips, t) % 2).astype(float)
    elif name == "frost":
        y, z = np.empty(len(S)), 0.0
        for i, h in enumerate(r["H"]):
            z = z + DT * (1 - z) / 3000 if h < 4 else z * np.exp(-DT / 60) if h > 12 else z
            y[i] = z
    elif name == "chirp": y = np.sin(2 * np.pi * (t / 2500 + (t / t[-1]) ** 2 * t[-1] / 2500))
    elif name == "pulses":
        y = np.zeros(len(t))
        for at, a in zip(rng.uniform(0, t[-1], 6), rng.uniform(0.4, 1.5, 6), strict=True):
            y += np.where(t > at, a * np.exp(-np.maximum(t - at, 0) / (150 + 500 * c["u"])), 0)
    elif name == "heater-crosstalk": y = lag(r["U"], 60.0) ** 2 * np.where(r["U"] > 0, 1.0, -0.4)
    elif name == "dead-zone":  # output locks to one value within a band, a fraction of the range
        b = healthy(D, S)[B]
        mid, half = np.percentile(r["band"], [35 + 30 * c["u"]])[0], 0.06 * np.ptp(r["band"])
        y = np.where(np.abs(b - mid) < half, mid - b, 0.0)
    return {resp: y * c["sign"]}

def changed(name, D, c, r, p):
    """Return the shell's temperature, and the housing as read, of a network changed by size p."""
    P, H, off = D["P"], r["H"], r["off"]
    if name == "second-lag": return network(P, H, off, mass=(p, c["tau"] * 0.6))[0], H
    if name == "self-heating": return network(P, H, off, heat=p * r["drive_amplitude_V"] ** 2)[0], H
    if name == "radiation": return network(P, H, off, share=p)[0], H
    g = (H - 20) / 25
    g = c["sign"] * (g**3 - g if c["u"] < 0.5 else np.sin(2 * np.pi * H / (18 + 2 * c["w"])))
    return r["S"], H + p * g

# --- what a healthy smooth model follows ------------------------------------------------------------------------------------
def columns(resp, tau, runs):
    out = []
    for k, r in enumerate(runs):
        t, S = r["rows"], np.interp(r["rows"], r["t"], r["S"])
        x, dS = (S - 20) / 25, np.interp(t, r["t"], lag(np.gradient(r["S"], DT), tau)) * 300
        own = [x, x**2] + ([x**3] if resp == B else [dS] if resp == F else [])
        mine = np.zeros((len(t), 2 * len(runs)))
        mine[:, 2 * k], mine[:, 2 * k + 1] = 1.0, np.exp(-t / tau)
        out.append(np.column_stack([mine, *own]))
    return out

def blocks(r, y):
    key = np.unique((r["rows"] / 100).astype(int), return_inverse=True)[1]
    n = np.bincount(key)
    return np.column_stack([np.bincount(key, c) / n for c in np.atleast_2d(y.T if y.ndim > 1 else y)])

def left(resp, tau, runs, ys):
    """Rms in 100 s means of what the healthy model's tangent leaves of ys (one array a run)."""
    A = np.vstack([blocks(r, c) for r, c in zip(runs, columns(resp, tau, runs), strict=True)])
    y = np.concatenate([blocks(r, v)[:, 0] for r, v in zip(runs, ys, strict=True)])
    return float(np.sqrt(np.mean((y - A @ np.linalg.lstsq(A, y, rcond=None)[0]) ** 2)))

def own_residual(D, runs):
    """What the contract's cardless baseline (one lag behind the housing, quadratic law) leaves of the healthy frequency."""
    def rest(shift):
        A, y, tau = [], [], D["tau"] * np.exp(shift)
        for k, r in enumerate(runs):
            x = (lag(r["H"], tau) - 20) / 25
            mine = np.zeros((len(x), len(runs)))
            mine[:, k] = np.exp(-r["t"] / tau)
            A.append(np.column_stack([np.ones(len(x)), x, x**2, mine])[::25])
            y.append(healthy(D, r["S"])[F][::25] - D["f0"])
        A, y = np.vstack(A), np.concatenate(y)
        return float(np.sqrt(np.mean((y - A @ np.linalg.lstsq(A, y, rcond=None)[0]) ** 2)))

    return minimize_scalar(rest, bounds=(-0.3, 0.6), method="bounded", options={"xatol": 1e-4}).fun

# --- a campaign -------------------------------------------------------------------------------------------------------------
def make_run(rng, D, k, at, drives):
    hours = rng.uniform(3.0, 6.5)
    air, U = chamber(rng, setpoints(rng, hours))
    H = lag(air, D["hl"]) + 0.0
    off = (0.0, 0.0) if rng.random() < 0.5 else tuple(rng.uniform(-4, 4, 2))
    S, base = network(D["P"], H, off)
    t = np.arange(len(H)) * DT
    r = {"t": t, "H": H, "S": S, "air": air, "U": U, "off": off, "abs": at}
    steps = lambda levels, pause: np.array(levels)[rng.integers(len(levels), size=200)][np.searchsorted(np.cumsum(rng.uniform(0.4, 1.6, 200) * pause), t)]
    if "electrode_bias_V" in drives: r["electrode_bias_V"] = steps([100.0, 104.0, 92.0, 110.0], 2400)
    if "drive_amplitude_V" in drives: r["drive_amplitude_V"] = steps([1.0, 1.25, 0.8, 1.5], 3000)
    if "pattern_angle_deg" in drives: r["pattern_angle_deg"] = np.full(len(t), [0.0, 22.5, 11.0, 36.0, 5.0][k % 5])
    if "quadrature_V" in drives:
        wander = np.interp(t, t[::300], np.cumsum(rng.standard_normal(len(t[::300]))) * 0.02)
        r["quadrature_V"] = 0.4 + 0.004 * (S - 20) + wander + 0.05 * np.sin(S / 6.0)
    return r

def sample(rng, t, style):
    row = float(style["row"])
    n = int((t[-1] - 5) / row)
    rows = np.arange(n) * row + rng.uniform(0, 3)
    if style["kind"] == "decimated": rows = np.round(rows) + rng.integers(0, 3, n) * 0.001
    if style["kind"] == "uneven": rows = rows + rng.uniform(-0.3, 0.3, n) * row
    if style["kind"] == "dropped": rows = rows[rng.random(n) > 0.05]
    if rng.random() < style["hole"]:
        a = rng.uniform(0.1, 0.8) * t[-1]
        rows = rows[(rows < a) | (rows > a + rng.uniform(300, 1300))]
    return rows[(rows >= 0) & (rows < t[-1] - 2)]

def need(name):
    return {"electrostatic-softening": "electrode_bias_V", "amplitude-frequency": "drive_amplitude_V", "self-heating": "drive_amplitude_V",
            "axis-rotation": "pattern_angle_deg", "quadrature-leakage": "quadrature_V"}.get(name)  # fmt: skip

def make_case(folder, seed, i):
    rng = np.random.default_rng([seed, i])
    kind = "SNSPASNSPASN"[i % 12]
    card = ["law", "geometry"][(i // 3) % 2] if (i + i // 12) % 3 == 2 else ""
    order = [str(n) for n in np.random.default_rng([seed, 7, i // 20]).permutation(list(KNOWN))]
    names = {"S": [order[i % 20]], "P": [order[i % 20], order[(i + 7) % 20]], "A": [list(ALIEN)[(i // 5 + seed) % 6]], "N": []}[kind]
    resp = [str(rng.choice({**KNOWN, **ALIEN}[n])) for n in names]
    drives = {need(n) for n in names} - {None} | {d for d in ("electrode_bias_V", "drive_amplitude_V", "quadrature_V") if rng.random() < 0.12}
    has = set(resp) | {x for x in (F, B, Q) if rng.random() < (0.9 if x == F else 0.75)} or {F}
    D, C = draw_device(rng, card)
    noises = ["white", "flicker", "markov", "walk", "quantised", "mixed"]
    nk, ntau = noises[(i * 5 + i // 6) % 6], float(np.exp(rng.uniform(np.log(20), np.log(3000))))
    style = {"row": rng.choice([10, 15, 20, 30]), "kind": str(rng.choice(["even", "decimated", "uneven", "dropped"])), "hole": 0.35 * (rng.random() < 0.5)}
    count, at, runs = int(rng.integers(2, 6)), 0.0, []
    for k in range(count + 1):  # the last one stays unseen
        runs.append(make_run(rng, D, k, at, drives))
        at += runs[-1]["t"][-1] + rng.uniform(0.3, 12) * 3600
        runs[-1]["rows"] = sample(rng, runs[-1]["t"], style)
    for r in runs: r["band"] = np.concatenate([healthy(D, q["S"])[B] for q in runs])
    seen = runs[:count]
    size = {F: abs(D["a1"] * D["f0"]) * np.exp(rng.uniform(np.log(1e-3), np.log(1e-2))), B: 10 ** rng.uniform(-2, -0.8), Q: D["q0"] * 10 ** rng.uniform(-3, -2)}
    unit = {x: [noise(rng, nk, ntau, r["rows"]) for r in runs] for x in (F, B, Q)}
    own = own_residual(D, seen) / (size[F] * left(F, D["tau"], seen, unit[F][:count])) if not card else None
    limit = 6.0 if D["rich"] else 0.3
    if own and own > limit: size[F], own = size[F] * own / limit, limit
    floor = {x: size[x] * left(x, D["tau"], seen, unit[x][:count]) for x in (F, B, Q)}
    add = [{x: np.zeros(len(r["t"])) for x in (F, B, Q)} for r in runs]
    read, hidden = [r["H"] for r in runs], []
    for name, x in zip(names, resp, strict=True):
        c, snr = draw_shape(rng, name, seen), float(np.exp(rng.uniform(np.log(0.5), np.log(10))))
        if name in NETWORK:
            base, p = [healthy(D, r["S"]) for r in runs], SIZE[name]
            zero = [changed(name, D, c, r, 1e-12) for r in runs] if name == "radiation" else None
            for turn in range(4):
                now = [changed(name, D, c, r, p) for r in runs]
                if name == "thermometer-scale":  # what the device would do if the reading were true
                    e = [{y: b[y] - v[y] for y in v} for b, v in ((base[k], healthy(D, network(D["P"], h, r["off"])[0])) for k, (r, (_, h)) in enumerate(zip(runs, now, strict=True)))]
                else:
                    ref = [healthy(D, z[0]) for z in zero] if zero else base
                    e = [{y: v[y] - b[y] for y in v} for b, v in ((ref[k], healthy(D, s)) for k, (s, _) in enumerate(now))]
                got = left(F, D["tau"], seen, [np.interp(r["rows"], r["t"], d[F]) for r, d in zip(seen, e, strict=False)]) / floor[F]
                if turn == 3 or abs(got / snr - 1) < 0.05: break
                p = min(p * snr / max(got, 1e-9), TOP[name])
            for k, (s, h) in enumerate(now):
                if name == "thermometer-scale": read[k] = read[k] + h - runs[k]["H"]
                else:
                    for y in (F, B, Q): add[k][y] += healthy(D, s)[y] - base[k][y]
            snrs = {F: got}
        else:
            e = [additive(name, D, c, r, k, x) for k, r in enumerate(runs)]
            ones = {y: left(y, D["tau"], seen, [np.interp(r["rows"], r["t"], d[y]) for r, d in zip(seen, e, strict=False)]) / floor[y] for y in e[0] if y in has}
            x = max(ones, key=ones.get)
            p = snr / max(ones[x], 1e-12)
            snrs = {y: v * p for y, v in ones.items()}
            for k, d in enumerate(e):
                for y, v in d.items(): add[k][y] += p * v
        hidden.append({"name": name, "response": x, "snr": round(snrs[x], 3), "snrs": snrs, "size": p, "constants": c})
    reference = "clock-drift" in names and rng.random() < 0.6
    both, res = rng.random() < 0.4, {F: 1e-4, B: 1e-3, Q: 1e-11, "T": 1e-3}
    if nk == "quantised": res |= {x: float(f"{2.0 * size[x]:.1g}") for x in (F, B, Q)}
    wild = 0.002 * (rng.random() < 0.35)
    folder.mkdir(parents=True, exist_ok=True)
    turn_on = [rng.normal(0, 2 * size[B]) for _ in runs]
    for k, r in enumerate(runs):
        rows = r["rows"]
        on = lambda y: np.interp(rows, r["t"], y)
        hs = lag(read[k], D["sensor_lag"]) if D["sensor_lag"] else read[k]
        out = {"time_s": np.round(rows, 3), "housing_temperature_degC": on(hs) + 0.001 * rng.standard_normal(len(rows))}
        if both: out["chamber_temperature_degC"] = on(r["air"]) + 0.01 * rng.standard_normal(len(rows))
        clean = {x: on(healthy(D, r["S"])[x] + add[k][x]) for x in (F, B, Q)}
        clean[B] = clean[B] + turn_on[k]
        for x in (F, B, Q):
            if x in has:
                bad = (rng.random(len(rows)) < wild) * rng.choice([-1, 1], len(rows)) * rng.uniform(15, 40, len(rows))
                out[x] = np.round((clean[x] + size[x] * (unit[x][k] + bad)) / res[x]) * res[x]
        if reference: out["reference_frequency_Hz"] = np.round(on(healthy(D, r["S"])[F]) + size[F] * noise(rng, "white", 1, rows), 4)
        for d in sorted(drives): out[d] = on(r[d]) if d == "quadrature_V" else r[d][np.minimum((rows / DT).astype(int), len(r["t"]) - 1)]
        head = f"# start: {(DAY0 + dt.timedelta(seconds=r['abs'])).isoformat(timespec='seconds')}\n"
        head += "".join(f"# resolution {x}: {res[x]:g}\n" for x in (F, B, Q) if x in has) if rng.random() < 0.5 or nk == "quantised" else ""
        digits = {F: "%.5f", B: "%.5f", Q: "%.6e", "time_s": "%.3f"}
        lines = [",".join(out)] + [",".join((digits.get(n, "%.4f") % v[j]) for n, v in out.items()) for j in range(len(rows))]
        (folder / (f"run_{k}.csv" if k < count else "unseen.csv")).write_text(head + "\n".join(lines) + "\n")
        if k == count: np.savez(folder / "unseen_clean.npz", t=rows, **{x: clean[x] for x in has})
    if card: (folder / "card.toml").write_text(card_text(D, C, rng, folder.name))
    equal = {"ageing": ["clock-drift"], "clock-drift": [] if reference else ["ageing"], "leak": ["ageing"]}
    near = {"second-lag": ["mounting-stress", "radiation"], "radiation": ["second-lag"], "mounting-stress": ["second-lag", "ageing"], "curvature": ["thermometer-scale"],
            "thermometer-scale": ["curvature"], "ageing": ["leak"], "rate-bias": ["mounting-stress"], "self-heating": ["amplitude-frequency"]}  # fmt: skip
    for h in (rank := sorted(hidden, key=lambda h: -h["snr"])):
        h["accept"] = [h["name"], *(e for e in equal.get(h["name"], []) if e != "clock-drift" or h["response"] == F)]
        h["near"] = near.get(h["name"], [])
    word = {"S": "effect", "N": "null", "P": "pair", "A": "alien"}[kind]
    right = {"null": ["adequate"], "alien": ["unexplained"]}.get(word, ["explained", "not-identifiable"])
    tol = ["second-lag", "radiation", "thermometer-lag"] if own and own > 0.3 else []
    rms = lambda x: float(np.sqrt(np.mean(np.concatenate([v - v.mean() for v in unit[x][:count]]) ** 2)) * size[x])
    return {"kind": word, "noise": nk, "noise_tau_s": ntau, "card": card, "rich": D["rich"], "own_world_snr": own, "tolerated": tol, "hidden": rank, "right_verdicts": right,
            "responses": sorted(has), "runs": count, "style": {k: str(v) for k, v in style.items()}, "outliers": bool(wild), "reference": reference, "drives": sorted(drives),
            "noise_floor_rms": {x: rms(x) for x in has}, "size": {x: size[x] for x in has}, "tau_s": D["tau"], "device": {k: v for k, v in D.items() if k != "P"} | D["P"]}  # fmt: skip

if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("out", type=Path)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=90125)
    given = parser.parse_args()
    truth = {}
    for i in range(given.count):
        t = truth[f"c{i:03d}"] = make_case(given.out / "cases" / f"c{i:03d}", given.seed, i)
        (given.out / "truth.json").write_text(json.dumps(truth, indent=1, default=float))
        print(i, t["kind"], t["card"], t["noise"], [(h["name"], h["response"], h["snr"]) for h in t["hidden"]], t["own_world_snr"], flush=True)
