"""Campaigns of an independent examiner ("E") for `hrg diagnose`.

World: five places. field (sun, clouds, wind, day and night), oven (forced air, axial gradient, door), bath (stirred fluid with
limited heater power), orbit (vacuum bell jar, cold shroud, heater lamps, T^4 balance of the housing), flight (climb, cruise, descent).
The gyro: a finite-element stem (4 cells) on the housing, a shell at its end, exchange by T^4, optional slow mass; exact matrix stepping.
Frequency = f0 sqrt(shear modulus), bias from a damping anisotropy that follows 1/Q, 1/Q thermo-elastic + constant.

SNR of an effect: d = clean(with it) - clean(without it, all else equal); n = noise; both averaged over 100 s, both projected on the
complement of the tangent space of the healthy baseline (frequency: offset per run, x, x^2, lag, initial state per run; bias: offset per
run, three powers of the change of frequency, or of the lagged temperature; 1/Q: offset per run, x, x^2; with a card: the card's prior
as ridge rows); snr = rms(P d)/rms(P n), the largest over the responses. Truth "snr2" is the same after a full non-linear refit.
"""
import argparse, json, pathlib
import numpy as np
from scipy.linalg import expm
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

DT, K0, SIG, KB = 10.0, 273.15, 5.67e-8, 8.617e-5
RESP = ["frequency_Hz", "bias_deg_per_h", "inverse_q"]
LIB = {  # name: (responses that show it, near names)
 "second-lag": ("f", ["rate-frequency", "mounting-stress", "thermometer-lag", "radiation"]), "rate-bias": ("b", ["mounting-stress"]),
 "hysteresis": ("fb", ["mounting-stress"]), "ageing": ("fbq", ["clock-drift", "leak"]), "jump": ("fbq", ["ageing"]), "activity-dip": ("fq", ["curvature", "loss-peak"]),
 "electrostatic-softening": ("f", []), "amplitude-frequency": ("f", ["self-heating"]), "curvature": ("f", ["thermometer-scale", "activity-dip"]),
 "cross-damping": ("b", []), "self-heating": ("f", ["amplitude-frequency"]), "loss-peak": ("q", ["activity-dip"]), "leak": ("q", ["ageing"]),
 "periodic": ("fbq", []), "radiation": ("f", ["second-lag", "mounting-stress", "rate-frequency"]), "clock-drift": ("f", ["ageing"]),
 "quadrature-leakage": ("b", []), "axis-rotation": ("b", ["cross-damping"]), "thermometer-scale": ("f", ["curvature"]),
 "mounting-stress": ("fb", ["second-lag", "rate-frequency", "rate-bias", "hysteresis", "thermometer-lag"]),
 "rate-frequency": ("f", ["second-lag", "thermometer-lag", "mounting-stress"]), "thermometer-lag": ("f", ["rate-frequency", "second-lag", "mounting-stress"]),
 "clock-offset": ("f", ["thermometer-lag", "rate-frequency"])}
ALIENS = {"telegraph": "b", "altitude-pressure": "fb", "sun-gradient": "b", "chirped-earth-rate": "b", "discharges": "fb", "outgassing": "q",
          "attitude-g": "b", "humidity": "f"}

def ou(r, n, tau):
    a = np.exp(-DT / tau)
    return lfilter([np.sqrt(1 - a * a)], [1, -a], r.normal(size=n), zi=[a * r.normal()])[0]

def lag(x, tau, x0=None, dt=DT):
    """First-order lag, input linear between the points."""
    a = np.exp(-dt / tau); g = (1 - a) * tau / dt; y0 = x[0] if x0 is None else x0
    return lfilter([1 - g, g - a], [1, -a], x, zi=[y0 - (1 - g) * x[0]])[0]

# ---------------------------------------------------------------- places: temperature of the housing
def place(kind, r, n):
    t = np.arange(n) * DT; h = t / 3600; T = np.empty(n); extra = {}
    if kind == "field":
        ph = r.uniform(0, 24); air = r.uniform(0, 18) + r.uniform(6, 12) * np.sin(2 * np.pi * (h + ph - 9) / 24) + ou(r, n, 1500)
        cloud = 1 / (1 + np.exp(-3 * ou(r, n, 1200) - 1)); sun = 950 * np.clip(np.sin(2 * np.pi * (h + ph - 6) / 24), 0, 1) * cloud
        film = 9 * np.exp(0.4 * ou(r, n, 900)); C = r.uniform(9e3, 2e4); T[0] = air[0] + r.uniform(-12, 12)
        for i in range(n - 1):
            T[i + 1] = T[i] + DT / C * (film[i] * (air[i] - T[i]) + 0.45 * sun[i])
        extra["sun"] = sun / 950; cham = air
    elif kind in ("oven", "bath"):
        sp = np.empty(n); i = 0; v = r.uniform(15, 30); lo, hi = (-20, 65) if kind == "oven" else (-10, 60)
        while i < n:
            k = int(r.uniform(0.6, 2.6) * 3600 / DT); sp[i:i + k] = v; i += k; v = r.uniform(lo, hi)
        rate = (r.uniform(0.4, 2.5) if kind == "oven" else r.uniform(0.6, 3)) / 60; a = np.empty(n); a[0] = sp[0]; integ = 0
        for i in range(n - 1):
            e = sp[i] - a[i]; a[i + 1] = a[i] + DT * np.clip(e / (120 if kind == "oven" else 60), -rate * 0.7, rate)
        if kind == "oven":
            a = a + 0.25 * ou(r, n, 200)
            for _ in range(r.integers(0, 2)):
                k = r.integers(n // 5, n - 50); a[k:] -= 0.35 * (a[k] - 22) * np.exp(-(t[k:] - t[k]) / 400)
        grad = r.uniform(0, 0.04) if kind == "oven" else 0
        T = lag(a - grad * (a - 22), r.uniform(200, 600) if kind == "oven" else r.uniform(25, 60)); cham = a
    elif kind == "orbit":
        per, share = r.uniform(4800, 6200), r.uniform(0.45, 0.65); on = ((t / per + r.uniform()) % 1 < share) * 1.0
        lamp = r.uniform(330, 420) * np.repeat(r.uniform(0.5, 1.2, n // 1500 + 1), 1500)[:n]; C = r.uniform(6000, 14000); T[0] = r.uniform(-15, 25)
        shroud = 120 + 40 * np.exp(-t / 3000)
        for i in range(n - 1):
            T[i + 1] = T[i] + DT / C * (0.8 * lamp[i] * (0.25 + 1.35 * on[i]) + 0.7 * SIG * (shroud[i] ** 4 - (T[i] + K0) ** 4))
        cham = None
    else:
        alt = np.zeros(n); i, z = 0, 0.0
        while i < n:
            k = int(r.uniform(0.4, 1.6) * 3600 / DT); z2 = r.uniform(0, 11) if r.uniform() < .8 else 0; m = int(abs(z2 - z) / r.uniform(.15, .45) * 60 / DT)
            seg = np.r_[np.linspace(z, z2, m, endpoint=False), np.full(k, z2)]; e = min(n, i + len(seg)); alt[i:e] = seg[:e - i]; i, z = e, z2
        air = r.uniform(12, 28) - 6.0 * alt + 0.5 * ou(r, n, 600); film = 14 * np.exp(-alt / 8); C = r.uniform(8e3, 2e4); T[0] = air[0] + 5
        for i in range(n - 1):
            T[i + 1] = T[i] + DT / C * (film[i] * (air[i] - T[i]) + 60)
        extra["alt"] = alt; cham = air
    return T, cham, extra

# ---------------------------------------------------------------- the gyro
def heat(dev, Th, P, eps, mass, T0):
    """Stem of 4 cells from the housing to the shell; exact step of the linear part, T^4 exchange and heat as sources. -> T shell, flux."""
    m, Gs, Cs, C = 4, dev["G"] * 5, dev["Cstem"] / 4, dev["C"]; N = m + 2; A = np.zeros((N + 1, N + 1)); cap = np.r_[np.full(m, Cs), C, dev["Cm"]]
    def link(i, j, g):
        for p, q in ((i, j), (j, i)):
            if p < N: A[p, p] -= g / cap[p]; A[p, q] += g / cap[p]
    link(N, 0, Gs)
    for k in range(m): link(k, k + 1, Gs)
    link(m, m + 1, mass * dev["G"]); link(m + 1, N, dev["Gm"])
    M = expm(A * DT)[:N]; x = np.full(N, Th[0]); x[:m + 1] += T0; out, fl = np.empty(len(Th)), np.empty(len(Th)); s = DT / C; e = eps * SIG * dev["area"]
    for i, th in enumerate(np.append((Th[:-1] + Th[1:]) / 2, Th[-1])):
        out[i] = x[m]; fl[i] = x[m - 1] - x[m]; y = M @ np.append(x, th)
        y[m] += s * (e * ((th + K0) ** 4 - (x[m] + K0) ** 4) + P[i]); x = y
    return out, fl

def play(T, r):
    y = np.empty_like(T); c = T[0]
    for i, v in enumerate(T):
        c = min(max(c, v - r), v + r); y[i] = c
    return y

def laws(dev, T):
    x = T - 20; f = dev["f0"] * np.sqrt(1 + 2 * dev["a1"] * x + dev["g2"] * x * x)
    tk = T + K0; q = dev["q0"] * (dev["qc"] + (1 - dev["qc"]) * tk / 293.15 * (1 + dev["al"] * x) ** 2)
    return f, dev["D"] * (q / dev["q0"] - 1) + dev["D2"] * (x / 30) ** 2, q

def simulate(dev, runs, effects):
    """Clean columns of every run on the 10 s grid. effects: list of dict(name, a, resp, ...)."""
    E = {e["name"]: e for e in effects}; res = []; theta, left, pres, n0 = 1.0, None, 0.0, 0.0
    for k, R in enumerate(runs):
        Th, t = R["Th"], np.arange(len(R["Th"])) * DT; tc = R["start"] + t; g = lambda n: E.get(n)
        P = g("self-heating")["a"] * R["A"] ** 2 if g("self-heating") else np.zeros(len(t))
        Tr, fl = heat(dev, Th, P, dev["eps"] + (g("radiation")["a"] if g("radiation") else 0), g("second-lag")["a"] if g("second-lag") else 0, R["T0"])
        f, b, q = laws(dev, Tr); col = {"frequency_Hz": f, "bias_deg_per_h": b + R["b0"], "inverse_q": q}; x = Tr - 20; Ts = lag(Th, dev["sensor"]); tk = Tr + K0
        shift = 0.0
        for e in effects:
            n, a, S = e["name"], e["a"], None
            if n in ("rate-bias", "rate-frequency"): S = a * fl * (1 + e["u"] * x / 50)
            elif n == "hysteresis": S = a * sum(w * (play(Tr, p) - Tr) for w, p in zip(e["w"], e["p"]))
            elif n == "ageing": S = a * (np.log1p(tc / e["t0"]) + e["u"] * (1 - np.exp(-tc / (4 * e["t0"]))))
            elif n == "clock-drift": S = a * f * tc
            elif n == "jump": S = a * ((k > e["run"]) + (k == e["run"]) / (1 + np.exp(-np.clip((t - e["at"]) / 15, -50, 50))))
            elif n == "activity-dip":
                gam = 10.0; z = gam / e["w"] * (Tr - e["at"]); c2 = 2 * gam * abs(a); d = -(z + 1j * gam) / 2
                root = np.sqrt(d * d + c2 + 0j); root = np.where((root * np.conj(d)).real > 0, root, -root); lam = root - d
                col["frequency_Hz"] = f + lam.real; col["inverse_q"] = q + 2 * np.abs(lam.imag) / f * e.get("qs", 1)
            elif n == "electrostatic-softening": S = np.sqrt(f * f - 2 * f * a * R["V"] ** 2 * (1 + 3e-5 * x)) - f
            elif n == "amplitude-frequency": S = a * R["A"] ** 2 * (1 + 0.05 * R["A"] ** 2)
            elif n == "curvature": S = a * (np.logaddexp(0, (Tr - e["at"]) / e["w"]) * e["w"] if e["u"] > 0 else (x / 10) ** 3 - 0.1 * (x / 10) ** 4)
            elif n == "cross-damping": S = a / np.cosh(e["E"] / KB * (1 / tk - 1 / (e["at"] + K0))) * (1 + 0.002 * x)
            elif n == "loss-peak": S = a * dev["q0"] * np.mean([1 / np.cosh(E1 / KB * (1 / tk - 1 / (e["at"] + K0))) for E1 in e["E"] * np.linspace(.88, 1.12, 5)], 0)
            elif n == "leak":
                if k and R["start"] > n0: pres += (R["start"] - n0) * 1e-6
                p = pres + np.cumsum(DT * 1e-6 * np.sqrt(293 / (Th + K0))); pres, n0 = p[-1], tc[-1]; S = a * dev["q0"] * p * np.sqrt(tk / 293)
            elif n == "periodic": S = a * (np.sin(2 * np.pi * tc / e["per"] + 1) + .25 * np.sin(4 * np.pi * tc / e["per"]))
            elif n == "quadrature-leakage": S = a * R["Vq"] * np.sin(.02 + 2e-4 * e["u"] * x) / .02
            elif n == "axis-rotation": S = a * np.sin(np.radians(4 * (R["angle"] - 10 - .35 * x - 1e-3 * x * x)))
            elif n == "mounting-stress":
                rel = np.exp(-DT / (e["tau"] * np.exp(.25 / KB * (1 / tk - 1 / 293.15)))); s = np.zeros(len(t)); dT = np.diff(Tr)
                for i in range(len(t) - 1): s[i + 1] = (s[i] + dT[i]) * rel[i]
                S = a * s
            elif n == "thermometer-scale": y = (Th - 20) / 10; Ts = Ts - a * ((k >= e["run"]) * y if e["u"] > 0 else y ** 3 * .1 + .5 * y ** 2)
            elif n == "thermometer-lag": Ts = lag(Ts, max(abs(a), 1.0))
            elif n == "clock-offset": shift = a if k == e["run"] else 0.0
            elif n == "outgassing":
                S = np.empty(len(t)); p = 0.0
                if left is None: left = 1.0
                rate = np.exp(-.75 / KB * (1 / (Th + K0) - 1 / 313.15)) / 9000
                for i in range(len(t)):
                    d = left * (1 - np.exp(-rate[i] * DT)); left -= d; p += d - p * DT / 2400; S[i] = p
                S = a * dev["q0"] * S * np.sqrt(293 / tk)
            elif n in ALIENS:
                S = a * R["alien"]
                if n == "humidity":
                    S = np.zeros(len(t)); m = 0.0
                    for i in range(len(t)): m += DT * (R["alien"][i] - m) / (3000 * np.exp(.3 / KB * (1 / tk[i] - 1 / 293.15))); S[i] = a * m
            if S is not None: col[e["resp"]] = col[e["resp"]] + S
        if shift: Ts = np.interp(t - shift, t, Ts)
        res.append(dict(t=t, Ts=Ts, Tr=Tr, **col))
    return res

def alien_unit(name, r, R, tc, extra):
    n = len(tc)
    if name == "telegraph":
        s, i, v = np.empty(n), 0, 1.0
        while i < n: k = int(r.exponential(2400) / DT) + 12; s[i:i + k] = v; i += k; v = -v
        return s
    if name == "altitude-pressure": return 1 - (1 - np.clip(extra["alt"], 0, 11) / 44.3) ** 5.26 + .01 * ou(r, n, 7200)
    if name == "sun-gradient": return lag(extra["sun"], 240) - .15 * lag(extra["sun"], 2400)
    if name == "chirped-earth-rate": u = np.arange(n) / n; return np.cos(2 * np.pi * (r.uniform() + r.uniform(1, 2) * u + r.uniform(2.5, 5) * u ** 2))
    if name == "discharges":
        s, t = np.zeros(n), np.arange(n) * DT
        for at in r.uniform(0, t[-1], r.integers(4, 8)): s += (t > at) * r.uniform(.5, 1.5) * r.choice([-1, 1]) * np.exp(-np.clip(t - at, 0, None) / r.uniform(500, 2500))
        return s
    if name == "attitude-g":
        s, i = np.empty(n), 0
        while i < n: k = int(r.uniform(900, 5000) / DT); s[i:i + k] = r.normal(); i += k
        return lag(s, 40)
    return np.clip(.5 + .5 * ou(r, n, 9000), -1, 2)

# ---------------------------------------------------------------- measure: SNR
def bins(t, *v):
    i = (t // 100).astype(int); c = np.bincount(i); u = c > 0
    return [np.bincount(i, w)[u] / c[u] for w in v]

def tlag(run, tau): return lag(run["Ts"], tau)

def design(clean, rows, resp, tau, prior, dev):
    """Tangent of the healthy baseline on 100 s means; ridge rows from the prior: [(column, sd)]."""
    blocks, nr = [], len(clean)
    for k, c in enumerate(clean):
        tr = rows[k]; T, T2 = tlag(c, tau), tlag(c, tau * 1.05); x = (T - 20) / 10; off = np.zeros((len(T), nr)); off[:, k] = 1
        if resp == "frequency_Hz":
            sl = np.gradient(c["frequency_Hz"], T + 1e-9 * c["t"]); sl = dev["f0"] * (dev["a1"] + 2 * dev["a2e"] * (T - 20))
            cols = [x, x * x, sl * (T2 - T) / .05]; ini = np.zeros_like(off); ini[:, k] = np.exp(-c["t"] / tau) * sl
        else:
            z = (c["frequency_Hz"] - dev["f0"]) / (dev["f0"] * 8e-4) if resp[0] == "b" and dev["has_f"] else x
            cols = [z, z * z] + ([z ** 3] if resp[0] == "b" else []); ini = np.zeros((len(T), 0))
            if not dev["has_f"]:
                cols += [.3 * (T2 - T) / .05]; ini = off * np.exp(-c["t"] / tau)[:, None]
        D = np.column_stack([off, np.column_stack(cols), ini]); R = np.column_stack([np.interp(tr, c["t"], d) for d in D.T])
        blocks.append(np.column_stack(bins(tr, *R.T)))
    D = np.vstack(blocks)
    return D

def project(D, y, ridge=None):
    s = np.sqrt((D * D).mean(0)) + 1e-30; A, z = D / s, y
    if ridge is not None: A = np.vstack([A, np.diag(ridge / s)]); z = np.r_[y, np.zeros(D.shape[1])]
    c = np.linalg.lstsq(A, z, rcond=1e-9)[0]
    return y - (D / s) @ c

def best_lag(clean, rows, dev):
    """The lag with which the quadratic law fits clean frequency (of the device's own law when it is not recorded) best."""
    y = np.concatenate([bins(r, np.interp(r, c["t"], c["frequency_Hz"]))[0] for c, r in zip(clean, rows)])
    def loss(lt): D = design(clean, rows, "frequency_Hz", np.exp(lt), None, dev); return (project(D, y) ** 2).sum()
    o = minimize_scalar(loss, bounds=(np.log(100), np.log(8000)), method="bounded", options=dict(xatol=.01)); return np.exp(o.x), np.sqrt(o.fun / len(y))

def ridge_of(D, resp, nr, dev, noise100):
    if not dev["card"]: return None
    w = np.zeros(D.shape[1]); p = {"frequency_Hz": [dev["f0"] * dev["sd"]["a1"] * 10, dev["f0"] * dev["sd"]["a2"] * 100, .1], "bias_deg_per_h": [.05 * abs(dev["D"]) * .2, .05 * abs(dev["D"]) * .1, .02 * abs(dev["D"])],
         "inverse_q": [dev["q0"] * .004, dev["q0"] * .001]}[resp]
    for j, sd in enumerate(p): w[nr + j] = noise100 / sd
    return w

def snr(with_, without, rows, noise, resp, dev, tau):
    cat = lambda R: np.concatenate([bins(r, np.interp(r, c["t"], c[resp]))[0] for c, r in zip(R, rows)])
    D = design(without, rows, resp, tau, None, dev); n = np.concatenate([bins(r, v)[0] for r, v in zip(rows, noise[resp])]); rd = ridge_of(D, resp, len(rows), dev, n.std())
    dd = cat(with_) - cat(without)
    if any(np.abs(a["Ts"] - b["Ts"]).max() > 1e-9 for a, b in zip(with_, without)):  # a fault of the thermometer: the baseline predicts with the wrong one
        dd = -project(design(with_, rows, resp, tau, None, dev), cat(with_), None); dd = -dd; D = design(with_, rows, resp, tau, None, dev)
        dd = project(D, cat(with_)) - project(design(without, rows, resp, tau, None, dev), cat(without)); return np.sqrt((dd ** 2).mean()) / np.sqrt((project(D, n, rd) ** 2).mean())
    return np.sqrt((project(D, dd, rd) ** 2).mean()) / np.sqrt((project(D, n, rd) ** 2).mean())

def snr2(with_, rows, noise, resp, dev):
    """The other way: refit lag and all, on clean values; what is left over what is left of the noise."""
    tau, _ = best_lag(with_, rows, dev) if dev["has_f"] else (dev["tau"], 0); cat = np.concatenate([bins(r, np.interp(r, c["t"], c[resp]))[0] for c, r in zip(with_, rows)])
    D = design(with_, rows, resp, tau, None, dev); n = np.concatenate([bins(r, v)[0] for r, v in zip(rows, noise[resp])])
    return np.sqrt((project(D, cat) ** 2).mean() / (project(D, n) ** 2).mean())

def noise_series(r, kind, t, s):
    n = len(t); dt = np.median(np.diff(t)); w = s * r.normal(size=n); slow = s / np.sqrt(100 / dt)  # the level of a white 100 s mean
    if kind in ("flicker", "mixed"): w = w + sum(.45 * slow * np.interp(t, g := np.arange(0, t[-1] + 2 * DT, DT), ou(r, len(g), ta)) for ta in (100, 500, 2500, 12500))
    if kind in ("walk", "mixed"): w = w + np.cumsum(r.normal(size=n) * slow * .8 * np.sqrt(np.diff(t, prepend=t[0] - dt) / 10000))
    if kind == "hetero": w = w * (.6 + .8 * (np.sin(2 * np.pi * t / r.uniform(5000, 20000)) > 0))
    return w

# ---------------------------------------------------------------- one campaign
def campaign(r, kind, names, out, cid, card):
    for attempt in range(40):
        got = try_campaign(r, kind, names, out, cid, card)
        if got: return got
    raise RuntimeError(f"{cid} {names}: nothing after 40 attempts")

def try_campaign(r, kind, names, out, cid, card):
    nruns = int(r.integers(2, 7)); pk = r.choice(["field", "oven", "bath", "orbit", "flight"]); nm = [n for n in names if n in LIB]; al = [n for n in names if n in ALIENS]
    pk = {"altitude-pressure": "flight", "sun-gradient": "field"}.get(al[0] if al else "", pk)
    if set(nm) & {"activity-dip", "loss-peak", "cross-damping", "curvature", "radiation", "thermometer-scale"} and pk == "field": pk = "oven"
    code = {"f": RESP[0], "b": RESP[1], "q": RESP[2]}; where = {n: code[r.choice(list(LIB[n][0] if n in LIB else ALIENS[n]))] for n in names}
    resp = set(where.values()) | {x for x in RESP if r.uniform() < .55} or {RESP[0]}; resp = [x for x in RESP if x in resp]
    C, G = r.uniform(2, 4), r.uniform(1.5e-3, 4e-3); f0 = r.uniform(4200, 7800); a1 = r.uniform(72e-6, 88e-6)
    dev = dict(C=C, G=G, Cstem=r.uniform(.02, .08), area=3e-3, eps=r.uniform(0, .001), Cm=r.uniform(15, 45), Gm=r.uniform(8e-3, 2e-2), f0=f0, a1=a1, g2=r.uniform(-2e-7, -.5e-7), q0=10 ** r.uniform(-7.3, -6.5), qc=r.uniform(.4, .8),
               al=r.uniform(1e-3, 3e-3), D=r.uniform(3, 15) * r.choice([-1, 1]), D2=r.uniform(-1, 1), sensor=r.uniform(1, 5), has_f=RESP[0] in resp, card=card, sd=dict(a1=4e-7, a2=1e-8))
    dev["a2e"] = (dev["g2"] - a1 ** 2) / 2; dev["tau"] = (C + .5 * dev["Cstem"]) / G; runs, start = [], 0.0
    drive = {"electrostatic-softening": "V", "amplitude-frequency": "A", "self-heating": "A", "quadrature-leakage": "Vq", "axis-rotation": "angle"}; cols = {drive[n] for n in nm if n in drive}
    if r.uniform() < .25: cols.add(r.choice(["V", "A", "Vq"]))
    rowdt, known = r.choice([5, 8, 10, 15, 20, 30, 60]), r.uniform() < .7
    for k in range(nruns + 1):
        n = int(r.uniform(3, 12) * 360); T, cham, extra = place(pk, r, n); t = np.arange(n) * DT
        steps = lambda lo, hi, m: np.repeat(r.uniform(lo, hi, n // m + 1), m)[:n]
        R = dict(Th=T, cham=cham, start=start, T0=r.uniform(-3, 3), b0=r.normal() * .5, V=steps(40, 120, 700) if "V" in cols else 0, A=steps(.6, 1.4, 600) if "A" in cols else np.ones(n),
                 Vq=steps(-1, 1, 900) + .3 * ou(r, n, 4000) if "Vq" in cols else 0, angle=np.full(n, [0., 11.25, 22.5, 33.75, 45., 7., 30.][k]), extra=extra)
        if al: R["alien"] = alien_unit(al[0], r, R, start + t, extra)
        runs.append(R); start += n * DT + 3600 * 10 ** r.uniform(0, 1.5)
    rows, full = [], []
    for k, R in enumerate(runs):
        end = (len(R["Th"]) - 1) * DT; dt = rowdt if r.uniform() < .7 else r.choice([10, 20, 30, 60]); dt = max(dt, np.ceil(end / 6000)); t = np.arange(0, end, dt) + r.uniform(0, .2, len(np.arange(0, end, dt))) * (r.uniform() < .4)
        if r.uniform() < .3: at, wd = r.uniform(.2, .8) * end, r.uniform(600, 2400); t = t[(t < at) | (t > at + wd)]
        t = t[r.uniform(size=len(t)) > r.choice([0, .01, .03])]; rows.append(np.round(t, 1))
    nk = r.choice(["white", "flicker", "walk", "hetero", "quantised", "mixed"]); lev = {RESP[0]: 10 ** r.uniform(-2.7, -1.5), RESP[1]: 10 ** r.uniform(-1.7, -.5), RESP[2]: dev["q0"] * 10 ** r.uniform(-2.7, -1.9)}
    noise = {x: [noise_series(r, nk, t, lev[x]) for t in rows] for x in RESP}; Tmin, Tmax = min(R["Th"].min() for R in runs[:-1]), max(R["Th"].max() for R in runs[:-1])
    if Tmax - Tmin < 12 or Tmax > 85 or Tmin < -55: return None
    fit = slice(0, nruns); clean0 = simulate(dev, runs, []); tau, rest = best_lag(clean0[fit], rows[fit], dev); nf = {x: noise[x][fit] for x in RESP}
    world = {x: snr2(clean0[fit], rows[fit], nf, x, dev) for x in resp}
    if max(world.values()) > (.35 if kind in ("null", "alien") else .8) or (card and rest > 2e-3 and kind == "null"): return None
    effects, hidden = [], []
    for n in names:
        mid = r.uniform(Tmin + .3 * (Tmax - Tmin), Tmax - .3 * (Tmax - Tmin)); e = dict(name=n, resp=where[n], u=r.choice([-1, 1]) * r.uniform(.3, 1), at=mid, w=r.uniform(2, 5), E=r.uniform(.25, .6), run=int(r.integers(0, nruns)), per=r.uniform(900, 4000), tau=r.uniform(3000, 12000), t0=10 ** r.uniform(3.3, 4.7), p=r.uniform(1, 8, 8), a=1e-2)
        e["w"] = r.uniform(.5, 1.5, 8) / 8 if n == "hysteresis" else e["w"]
        if n == "jump": e["at"] = r.uniform(.25, .75) * rows[e["run"]][-1]
        if n == "thermometer-scale": e["run"] = int(r.integers(1, nruns))
        if n == "activity-dip": e["a"] = 1e-4
        if n in ("thermometer-lag", "clock-offset"): e["a"] = 60.
        if n in ("ageing", "jump", "periodic", "hysteresis", "outgassing") or n in ALIENS: e["a"] = lev[e["resp"]] * r.choice([-1, 1]) if n != "outgassing" else .1
        if n == "clock-drift": e["a"] = 1e-12
        target = np.exp(r.uniform(np.log(2.5 if n in ALIENS else .7), np.log(12)))
        for _ in range(7):
            w = simulate(dev, runs, effects + [e])
            ss = {x: snr(w[fit], clean0[fit] if not effects else base[fit], rows[fit], nf, x, dev, tau) for x in resp}; s = max(ss.values())
            if abs(s / target - 1) < .05: break
            e["a"] *= np.clip(target / max(s, 1e-6), 1e-3, 1e3)
            if n == "second-lag": e["a"] = min(e["a"], 1.2)
            if n == "radiation": e["a"] = min(e["a"], .25)
            if n in ("thermometer-lag", "clock-offset"): e["a"] = min(e["a"], 240.)
            if n == "self-heating": e["a"] = min(e["a"], 1e-2)
        if s < (2.4 if n in ALIENS else .65) or s > 16: return None
        top = max(ss, key=ss.get); effects.append(e); base = w
        hidden.append(dict(name=n if n in LIB else "alien:" + n, response=top, snr=round(s, 3), snr2=round(snr2(w[fit], rows[fit], nf, top, dev), 3), accept=[n] if n in LIB else [], near=LIB[n][1] if n in LIB else [], size=float(e["a"])))
    clean = simulate(dev, runs, effects); d = out / "cases" / cid; d.mkdir(parents=True); floor = {x: [] for x in resp}
    useboth, hres = r.uniform() < .35, r.choice([.001, .01]); outl = r.choice([0, 0, .001, .003])
    for k, (R, c, t) in enumerate(zip(runs, clean, rows)):
        q = lambda v: np.interp(t, c["t"], v); tab = {"time_s": [f"{v:.1f}" for v in t]}; sen = q(c["Ts"]) + .004 * r.normal(size=len(t)); tab["housing_temperature_degC"] = [f"{v:.4f}" for v in np.round(sen / hres) * hres]; keep = {}; head = []
        if useboth and R["cham"] is not None: tab["chamber_temperature_degC"] = [f"{v:.3f}" for v in q(R["cham"]) + .01 * r.normal(size=len(t))]
        for x in resp:
            cl = q(c[x]); keep[x] = cl; y = cl + noise[x][k]
            if nk == "quantised":
                step = lev[x] * 2.0; step = float(f"{step:.1e}"); y = np.round(y / step) * step; head.append(f"# resolution {x}: {step:g}")
            if k < nruns: floor[x].append((y - cl) - (y - cl).mean())
            bad = r.uniform(size=len(t)) < outl; y = y + bad * lev[x] * r.choice([-1, 1], len(t)) * r.uniform(6, 15, len(t))
            tab[x] = [(f"{v:.7f}" if x[0] == "f" else f"{v:.6f}" if x[0] == "b" else f"{v:.6e}") for v in y]
            if r.uniform() < .2: tab[x] = ["" if u < .02 else v for u, v in zip(r.uniform(size=len(t)), tab[x])]
        for key, name, fm in (("V", "electrode_bias_V", ".3f"), ("A", "drive_amplitude_V", ".4f"), ("Vq", "quadrature_V", ".4f"), ("angle", "pattern_angle_deg", ".3f")):
            if key in cols: tab[name] = [format(v, fm) for v in (R[key][np.clip((t / DT).astype(int), 0, len(R[key]) - 1)] if key != "Vq" else q(R[key]))]
        if known: head.insert(0, f"# start: {np.datetime64('2026-03-02T06:00:00') + np.timedelta64(int(R['start']), 's')}")
        text = "\n".join(head + [",".join(tab)] + [",".join(v) for v in zip(*tab.values())]) + "\n"
        (d / ("unseen.csv" if k == nruns else f"run_{k}.csv")).write_text(text)
        if k == nruns: np.savez(d / "unseen_clean.npz", t=t, **keep)
    if card: write_card(r, d / "card.toml", dev, lev, rowdt, clean0, Tmin, Tmax, tau, resp)
    verd = {"null": ["adequate"], "alien": ["unexplained"]}.get(kind, ["explained", "not-identifiable"] + (["adequate"] if max([h["snr"] for h in hidden], default=9) < 2 else []))
    return dict(kind=kind, card="card.toml" if card else "", hidden=hidden, right_verdicts=verd, tolerated=["second-lag", "rate-frequency"] if max(world.values()) > .4 else [], world=world,
                noise_floor_rms={x: float(np.sqrt(np.mean(np.concatenate(v) ** 2))) for x, v in floor.items()}, responses=resp, runs=nruns, noise=str(nk), place=str(pk), start_known=bool(known), outliers=float(outl), range=[float(Tmin), float(Tmax)])

def write_card(r, path, dev, lev, dt, clean0, lo, hi, tau, resp):
    T = np.linspace(lo, hi, 200); x = T - 20; f, b, q = laws(dev, T); df = f - laws(dev, np.array([20.]))[0]
    fc = np.polynomial.polynomial.polyfit(x, f / dev["f0"] - 1, 3); bc = np.polynomial.polynomial.polyfit(df, b, 3); qp = np.polynomial.polynomial.polyfit(x, q, 2)
    v = lambda x, sd: f"{{ value = {x + sd * r.normal():.8g}, sd = {sd:.3g} }}"; rel = lambda x, s: f"{{ value = {x * np.exp(s * r.normal()):.5g}, relative_sd = {s} }}"
    span = np.abs(df).max(); D = abs(dev["D"]); sd = dev["sd"]
    path.write_text(f"""schema = "hrg.card/1"
name = "examiner-e"
note = "Law, bias and loss from an acceptance test; the lag from one step."
reference_temperature_degC = 20.0
[law]
f0_Hz = {v(dev["f0"], dev["f0"] * 1e-5)}
a1_per_K = {v(fc[1], sd["a1"])}
a2_per_K2 = {v(fc[2], sd["a2"])}
a3_per_K3 = {v(fc[3], 2e-11)}
lag_s = {rel(dev["tau"], .08)}
[bias]
offset_deg_per_h = {v(bc[0], 1.0)}
damping_anisotropy = {{ value = 0.0, sd = 0.0 }}
k1_deg_per_h_per_Hz = {v(bc[1], .02 * D / span)}
k2_deg_per_h_per_Hz2 = {v(bc[2], .01 * D / span ** 2)}
k3_deg_per_h_per_Hz3 = {v(bc[3], .01 * D / span ** 3)}
[loss]
inverse_q = {rel(qp[0], .02)}
slope_per_K = {v(qp[1] / qp[0], 4e-4)}
curvature_per_K2 = {v(qp[2] / qp[0], 1e-5)}
[noise]
frequency_white_Hz = {lev[RESP[0]] * dt ** .5:.3g}
bias_white_deg_per_rt_h = {lev[RESP[1]] * (dt / 3600) ** .5:.3g}
bias_turn_on_deg_per_h = 0.5
inverse_q_white = {lev[RESP[2]] / dev["q0"] * dt ** .5:.3g}
housing_white_K = {.004 * dt ** .5:.3g}
housing_lag_s = {{ value = 2.5, relative_sd = 0.4 }}
""")

def main():
    ap = argparse.ArgumentParser(); ap.add_argument("out"); ap.add_argument("--count", type=int, default=40); ap.add_argument("--seed", type=int, default=1); a = ap.parse_args()
    out = pathlib.Path(a.out); r = np.random.default_rng(a.seed); n = a.count; kinds = ["effect"] * round(.45 * n) + ["null"] * round(.2 * n) + ["pair"] * round(.15 * n); kinds += ["alien"] * (n - len(kinds))
    lib, ali = list(r.permutation(list(LIB))), list(r.permutation(list(ALIENS))); order = r.permutation(n); truth, il, ia = {}, 0, 0; cards = set(r.permutation(n)[: round(n / 3)])
    for i, o in enumerate(order):
        kind = kinds[o]; names = []
        if kind == "alien": names = [ali[ia % len(ali)]]; ia += 1
        for _ in range({"effect": 1, "pair": 2}.get(kind, 0)): names.append(lib[il % len(lib)]); il += 1
        cid = f"e{i:03d}"; truth[cid] = campaign(np.random.default_rng([a.seed, i]), kind, [str(x) for x in names], out, cid, i in cards)
        print(cid, kind, [(h["name"], h["response"][:4], h["snr"], h["snr2"]) for h in truth[cid]["hidden"]], truth[cid]["place"], {k: round(v, 2) for k, v in truth[cid]["world"].items()}, flush=True)
        (out / "truth.json").write_text(json.dumps(truth, indent=1))

if __name__ == "__main__":
    main()
