"""dead_band.py OUT --count N --seed S: campaigns of vibratory gyros in temperature chambers, with a hidden truth.
World: a chamber (Peltier with PI and saturation, compressor with dead band and rest time, bimetal oven) drives a housing of two nodes;
behind it base, stem and shell rings exchange heat by conduction, gas and T^4 (lumped networks: Gilmore, Spacecraft Thermal Control Handbook). All is
computed every DT seconds and sampled at the logger's rows. SNR of a cause: rms of what a refitted baseline (contracts.md) leaves more with it than
without it, over the rms of the noise after the same projection."""
import argparse, copy, datetime, json, subprocess
from pathlib import Path
import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.optimize import minimize_scalar
from scipy.signal import fftconvolve, lfilter
DT, SB, K20, ZERO, PRE = 5.0, 5.670374e-8, 293.15, 273.15, 7200.0
HRG, F, B, Q = ["hrg"], "frequency_Hz", "bias_deg_per_h", "inverse_q"
AMP, POL, QUAD, ANG = "drive_amplitude_V", "electrode_bias_V", "quadrature_V", "pattern_angle_deg"
rms = lambda x: float(np.sqrt(np.mean(np.square(x))))
logu = lambda r, a, b: float(np.exp(r.uniform(np.log(a), np.log(b))))
low = lambda x, tau: lfilter([1 - np.exp(-DT / tau)], [1, -np.exp(-DT / tau)], x, zi=[x[0] * np.exp(-DT / tau)])[0]
ou = lambda r, n, tau: lfilter([np.sqrt(1 - np.exp(-2 * DT / tau))], [1, -np.exp(-DT / tau)], r.standard_normal(n), zi=[r.normal()])[0]
# ------------------------------------------------------------------------------------------------ chamber, housing, heat
def programme(r, length, lo, hi, soaked):
    """Corners (t, T) of the set point, intervals without power."""
    style = r.choice(["soaks", "ramps", "diurnal", "triangle", "cut"], p=[0.3, 0.25, 0.15, 0.15, 0.15])
    if style == "diurnal":
        t = np.arange(0, length + 600, 300.0)
        return t, (lo + hi) / 2 + (hi - lo) / 2 * r.uniform(0.6, 1) * np.sin(2 * np.pi * t / length * r.uniform(0.7, 1.6) + r.uniform(0, 6)), [], style
    t, T, off = (PRE + 900) * (r.random() < soaked), r.uniform(lo, hi), []     # soaked before the record starts
    c, levels = [(-1.0, T), (t, T)], list(r.permutation(np.linspace(lo, hi, int(r.integers(4, 7))))) * 9
    slope = {"soaks": 2.0, "cut": 1.5, "ramps": r.uniform(0.2, 1.0), "triangle": r.uniform(0.15, 0.5)}[style] / 60
    while t < length:
        T2 = levels.pop(0) if style in ("soaks", "cut") else (hi if T < (lo + hi) / 2 else lo) + r.uniform(-3, 3)
        hold = 1.0 if style == "triangle" else r.uniform(2400, 6000) if style == "ramps" else r.uniform(3600, 8500)
        t += abs(T2 - T) / slope + 1
        if style == "cut" and not off and t > 0.25 * length:
            off, hold = [(t + 0.6 * hold, t + 0.6 * hold + r.uniform(2500, 5500))], hold + 6000
        c += [(t, T2), (t + hold, T2)]
        t, T = c[-1]
    return *np.transpose(c), off, style
def chamber(r, kind, t, goal, off, lab):
    """Temperature of the air: heat and cool in K/s, losses to the laboratory with 1.5 h, turbulence of 40 s."""
    A, integ, mode, rest, bim = goal[0], 0.0, 0, 0.0, goal[0]
    heat, cool, band = r.uniform(1.6, 2.6) / 60, r.uniform(1.2, 2.0) / 60, r.uniform(0.25, 0.7)
    power, out = np.array([not any(a <= x < b for a, b in off) for x in t]), np.empty(len(t))
    for k in range(len(t)):
        e = goal[k] - A
        if kind == "peltier":       # PI, saturating, anti-windup
            s = min(max(0.35 * e + integ, -0.6), 1.0)
            integ, q = integ + 0.0008 * DT * e * (-0.6 < s < 1), s * heat
        elif kind == "compressor":  # dead band; the compressor rests 150 s between starts
            rest += DT
            want = 1 if e > band else -1 if e < -band else mode * (mode * e > 0)
            if want != mode and (want != -1 or rest > 150):
                rest, mode = 0.0 if mode == -1 else rest, want
            q = heat if mode == 1 else -cool if mode == -1 else 0.0
        else:                       # a bimetal with its own lag of 80 s switches the heater at +-1 K
            bim += DT / 80 * (A - bim)
            q = heat * (mode := 1 if goal[k] - bim > 1 else 0 if goal[k] - bim < -1 else mode)
        out[k] = A = A + DT * (q * power[k] + (lab - A) / 5400)
    return out + r.uniform(0.02, 0.15) * ou(r, len(t), 40)
def network(C, links, bound, rad, u, segs, power=0.0):
    """C dT/dt = -L T + g u + p, u linear between grid points, settled where a segment starts: exact by modes. rad: (node, node or -1
    for u, W/K at 20 C): Stefan-Boltzmann beyond its linear part joins p by Picard iteration. Returns T, time constants."""
    n = len(C)
    L, g = np.zeros((n, n)), np.zeros(n)
    for i, j, G in [*links, *(x for x in rad if x[1] >= 0)]:
        L[[i, j, i, j], [i, j, j, i]] += np.array([G, G, -G, -G])
    np.add.at(g, [i for i, *_ in bound] + [i for i, j, _ in rad if j < 0], [G for _, G in bound] + [k for _, j, k in rad if j < 0])
    L += np.diag(g)
    s = 1 / np.sqrt(C)
    lam, V = np.linalg.eigh(s[:, None] * L * s)
    W, x = V * s[:, None], np.exp(-lam * DT)
    b0, b1 = (1 - x) / (lam * DT) - x, 1 - (1 - x) / (lam * DT)
    T = np.tile(u, (n, 1)).astype(float)
    for _ in range(7 if rad else 1):
        p = g[:, None] * u + power
        for i, j, k in rad:
            b = u if j < 0 else T[j]
            q = k * (((b + ZERO) ** 4 - (T[i] + ZERO) ** 4) / (4 * K20**3) - (b - T[i]))
            p[i], p[j] = p[i] + q, p[j] - q * (j >= 0)
        w = (W.T @ p) / lam[:, None]
        z = np.hstack([[lfilter([b1[m], b0[m]], [1, -x[m]], w[m, s], zi=[w[m, s][0] * (1 - b1[m])])[0] for m in range(n)] for s in segs])
        T = W @ z
    return T, 1 / lam
# ------------------------------------------------------------------------------------------------ the gyro: p its true values
def build(p):
    """(C, links, bound, rad), weights of the frequency, node that carries a second mass."""
    if p["card"] == "law":                     # base, resonator
        G = p["ratio"] / p["t1"]
        return (np.array([1, p["ratio"]]), [(0, 1, G * (1 - p["share"]))], [(0, 1 / p["t2"])], [(1, 0, G * p["share"])]), np.array([0, 1.0]), 1
    if p["card"] == "geometry":                # base, stem, 8 cells of the meridian; weights: bending energy after Rayleigh
        r, h, k, d = p["r"], p["h"], p["k"], np.pi / 16
        a = (np.arange(8) + 0.5) * d
        A, w = 2 * np.pi * r * r * (np.cos(a - d / 2) - np.cos(a + d / 2)), np.tan(a / 2) ** 4 / np.sin(a) ** 3
        g = k * 2 * np.pi * np.sin(a + d / 2)[:-1] * h / d
        C, G, kr = np.pi * p["rs"] ** 2 * p["ls"] * p["rho"] * p["c"], 2 * k * np.pi * p["rs"] ** 2 / p["ls"], 4 * SB * K20**3
        rad = [(2 + i, 0, kr * 2 * p["em"] * x) for i, x in enumerate(A)] + [(0, -1, kr * p["exch"])]
        links = [(0, 1, G), (1, 2, G)] + [(2 + i, 3 + i, x) for i, x in enumerate(g)]
        return (np.r_[p["Cb"], C, A * h * p["rho"] * p["c"]], links, [(0, p["Gm"])], rad), np.r_[0, 0, w / w.sum()], 0
    G = p["Cs"] / p["t1"]                      # base, stem, five rings; radiation and gas go straight to the housing
    links = [(0, 1, 2 * G * p["stem"]), (1, 2, 2 * G * p["stem"])] + [(2 + i, 3 + i, p["Cs"] / p["ti"]) for i in range(4)]
    rad = [(2 + i, -1, G * p["share"] / 5) for i in range(5) if p["share"]]
    bound = [(0, p["Cb"] / p["tb"])] + [(2 + i, G * p["gas"] / 5) for i in range(5)]
    return (np.r_[p["Cb"], 0.05 * p["Cs"], np.full(5, p["Cs"] / 5)], links, bound, rad), np.r_[0, 0, 0.02, 0.08, 0.2, 0.3, 0.4], 2
def gyro(r, card, rich, radiates):
    m = bool(card != "geometry" and r.random() < 0.45)      # Elinvar or fused silica
    p = {"card": card, "metal": m, "f0": r.uniform(2800, 9000), "a1": r.choice([-1, 1, 1]) * r.uniform(1.5e-5, 5e-5) if m else r.uniform(7.2e-5, 9.6e-5),
         "a2": r.normal(0, 5e-8) - 9e-8 * (not m),
         "q0": logu(r, 2e-5, 8e-5) if m else logu(r, 5e-8, 6e-7), "qs": r.normal(0.003, 0.002), "qc": r.normal(0, 1.5e-5), "ta": r.uniform(250, 900), "grad": r.uniform(2, 5), "lag": 0.0}
    if not card:        # plain: all but one time constant short; rich: slow rings, soft mount, radiation, residual gas, gradient of the housing
        p |= {"Cs": logu(r, 1.5, 9), "t1": logu(r, 400, 2200), "ti": r.uniform(0.5, 2), "Cb": 40.0, "tb": r.uniform(5, 15), "share": 0.0, "gas": 0.0}
        if rich:
            p |= {"ti": r.uniform(1, 10), "Cb": p["Cs"] * r.uniform(2, 8), "tb": r.uniform(20, 120), "share": r.uniform(0.01, 0.12), "gas": r.choice([0, 0.2]), "grad": r.uniform(3, 20)}
        return p | {"stem": 1 - p["share"] - p["gas"]}
    p |= {"lag": r.uniform(1.5, 5), "ratio": r.uniform(0.03, 0.3), "t1": logu(r, 500, 2000), "t2": r.uniform(50, 200), "share": 0.0 if radiates else float(np.clip(r.normal(0.05, 0.04), 0, 0.1))}
    s, x = r.uniform(0.8, 1.25), r.normal(size=4)
    p |= {"Gm": logu(r, 0.02, 0.09), "Cb": logu(r, 15, 40), "r": 15e-3 * s, "h": 0.8558e-3 * s, "rs": 2.5e-3 * s, "ls": 18.7e-3 * s, "rho": 2203.0, "k": 1.38 + 0.03 * x[0], "c": 740 + 30 * x[1],
          "em": 0.03 * np.exp(0.6 * x[2]), "exch": 1e-3 * np.exp(0.6 * x[3])}
    return p
def write_card(r, p, name, path, radiates):
    """Every stated value is the truth plus its stated sd times N(0, 1)."""
    num = lambda v, sd: f"{{ value = {v + sd * r.normal():.7g}, sd = {sd:.3g} }}"
    rel = lambda v, sd: f"{{ value = {v * np.exp(sd * r.normal()):.6g}, relative_sd = {sd} }}"
    mm = lambda k: f"{1e3 * p[k]:.6g}"
    s = f'schema = "hrg.card/1"\nname = "{name}"\nreference_temperature_degC = 20.0\n'
    if p["card"] == "law":
        t = np.sort(network(*build(p)[0], np.full(9, 20.0), [slice(0, 9)])[1])
        s += f"[law]\nf0_Hz = {num(p['f0'], p['f0'] * 2e-4)}\na1_per_K = {num(p['a1'], 2.5e-6)}\na2_per_K2 = {num(p['a2'], 4e-8)}\na3_per_K3 = 0.0\nlag_s = {rel(t[1], 0.2)}\nsecond_lag_s = {rel(t[0], 0.3)}\n"
        s += (f"radiated_share = {num(p['share'], 0.06)}\n" if not radiates else "") + f"chamber_lag_s = {rel(p['ta'], 0.3)}\n"
    else:
        s += f'[resonator]\nshape = "hemisphere"\nradius_mm = {mm("r")}\nthickness_mm = {mm("h")}\nsupport = "stem"\n'
        s += f'[resonator.stem]\nradius_mm = {mm("rs")}\nend_mm = {-p["r"] / 3e-3:.6g}\nside = "inner"\nfillet_mm = {p["rs"] * 200:.5g}\n[material]\nname = "fused-silica"\n[thermal]\n'
    s += "" if p["card"] == "law" else f"cells = 8\nmount_conductance_W_per_K = {rel(p['Gm'], 0.25)}\nbase_heat_capacity_J_per_K = {rel(p['Cb'], 0.25)}\n"
    s += f"[bias]\noffset_deg_per_h = {num(p['kb'][0], 2.0)}\ndamping_anisotropy = {{ value = 0.0, sd = 0.0 }}\n"
    s += "".join(f"k{j}_deg_per_h_per_Hz{'' if j == 1 else j} = {num(p['kb'][j], p['kbsd'][j])}\n" for j in (1, 2, 3))
    s += f"[loss]\ninverse_q = {rel(p['q0'], 0.15)}\nslope_per_K = {num(p['qs'], 0.0015)}\ncurvature_per_K2 = {num(p['qc'], 2e-5)}\n[noise]\nhousing_lag_s = {num(p['lag'], 0.3)}\n"
    path.write_text(s)
def law(p, T):
    base, a, b = (CubicSpline(*p["tcf"])(T) * (1 + p["d0"]), p["d1"], p["d2"]) if "tcf" in p else (p["f0"], p["a1"], p["a2"])
    return base * (1 + a * (T - 20) + b * (T - 20) ** 2)
def card_law(r, p, path, _):
    """f(T) of a geometry card by `hrg tcf`; the device departs from it by a draw within the material's stated spread."""
    x = json.loads(subprocess.run([*HRG, "tcf", str(path), "--from", "-50", "--to", "80", "--step", "10", "--json"], capture_output=True, check=True).stdout)["points"]
    p |= {"tcf": ([y["temperature_degC"] for y in x], [y["frequency_Hz"] for y in x]), "d0": r.normal(0, 0.003), "d1": r.normal(0, 4e-6), "d2": r.normal(0, 7e-8)}
    p["f0"], p["a1"] = float(law(p, 20.0)), float((law(p, 21.0) - law(p, 19.0)) / 2 / law(p, 20.0))
# ------------------------------------------------------------------------------------------------ hidden causes
# Each gets the world w and its constants c, and returns its additions in units w.unit; the network's own (None) are in World.forward.
segwise = lambda w, fn, x: np.concatenate([fn(x[s]) for s in w.segs])
own = lambda w, c, y: {c["resp"]: c["sign"] * y * w.unit[c["resp"]]}
def hysteresis(w, c):   # Preisach relays, Gaussian in place and width [Mayergoyz], or Duhem with unlike widths up and down [Coleman, Hodgdon]
    r, y = np.random.default_rng(c["rng"]), np.zeros(len(w.Ts))
    at, wide = r.normal(c["T"], 1.6 * c["w"], 300), np.abs(r.normal(0, c["w"], 300))
    for s in w.segs:
        relay = np.where(w.Ts[s.start] > at + wide / 2, 1.0, -1.0)
        for k in range(s.start + 1, s.stop):
            d = w.Ts[k] - w.Ts[k - 1]
            relay[w.Ts[k] > at + wide], relay[w.Ts[k] < at] = 1.0, -1.0
            y[k] = relay.mean() if c["u"] < 0.5 else y[k - 1] + (d - abs(d) * y[k - 1]) / (c["w"] * (1.3 if d > 0 else 0.7))
    return own(w, c, y)
def dip(w, c):          # a spurious mode crosses: two damped coupled modes [Novotny, Am. J. Phys. 78, 1199] or a Fano line [Phys. Rev. 124, 1866]
    z, k = (w.Ts - c["T"]) / (0.3 * c["w"]) - 1j, 0.45
    s = np.sqrt(z * z + 4 * k * k)                          # coupling below the damping: the mode stays the same one
    shift = (np.where((np.conj(z) * s).real < 0, -s, s) - z) / (2 * k * k) if c["u"] < 0.5 else np.exp(1j * (2 * c["u"] - 1.5)) / z
    return {F: c["sign"] * shift.real * w.unit[F], Q: shift.imag * w.unit[F] * 2 / w.p["f0"]}
ageing = lambda w, c: own(w, c, -10 * np.exp(-np.sqrt((w.t - w.t[0] + c["age"]) / (20 * c["age"]))))  # ageing: stretched exponential since manufacture [Kohlrausch]
jump = lambda w, c: own(w, c, (w.t > c["tj"]) * (1 - 0.2 * np.exp(-np.maximum(w.t - c["tj"], 0) / 600)))  # jump: a crack or a slip, four fifths at once, the rest crawls behind
def rate_bias(w, c):    # heat flow through the stem, or the housing's gradient behind 3 min [HRG paper, eq. 22], a tenth of it quadratic
    q = (w.Tin - w.Ts) / 5 if c["u"] < 0.6 else segwise(w, lambda H: low(np.gradient(H, DT), 180), w.H) * 400
    return own(w, c, q / np.abs(q).max() + 0.1 * (q / np.abs(q).max()) ** 2)
def creep(w, c):        # mismatch stress of a bond after each change of temperature relaxes by a power law [Findley; adhesives n = 0.3 ... 0.8]
    kern = (1 + np.arange(len(w.t)) * DT / (0.05 * c["tau"])) ** -(0.3 + 0.5 * c["u"])
    return own(w, c, segwise(w, lambda T: fftconvolve(np.diff(T, prepend=T[0]), kern[: len(T)])[: len(T)], w.Tin) / 10)
def periodic(w, c):     # an on/off thermostat in the electronics charges and discharges an RC; its period wanders a little
    x, d = (w.t / c["per"] + 0.02 * np.sin(w.t / (1.8 * c["per"]))) % 1, 0.25 + 0.5 * c["u"]
    return own(w, c, np.where(x < d, 1 - np.exp(-1.5 * x / d), (np.exp(-1.5 * (x - d) / (1 - d)) - np.exp(-1.5)))  / (1 - np.exp(-1.5)) - 0.5)
duffing = lambda w, c: own(w, c, (lambda a: a**2 + 0.1 * a**4)(segwise(w, lambda v: low(v, 20), w.drive[AMP])))  # amplitude-frequency: cubic and quintic stiffness; the amplitude follows its command in 20 s
curvature = lambda w, c: own(w, c, (lambda z: np.logaddexp(0, 70 * z / c["w"]) if c["u"] < 0.6 else z**3 + 0.5 * z**4)((w.Ts - c["T"]) / 35))  # curvature: knee of a coating at its glass transition, or cubic with quartic
loss_peak = lambda w, c: {Q: w.unit[Q] * 2 * np.imag((lambda z: z / (1 + z))((1j * np.exp(-72000 / c["w"] * (1 / (w.Ts + ZERO) - 1 / (c["T"] + ZERO)))) ** 0.8))}  # loss-peak: Cole-Cole line of an activated relaxation [J. Chem. Phys. 9, 341], exponent 0.8
def leak(w, c):         # outgassing by Arrhenius' law through runs and the time between; molecular damping ~ p / sqrt(T)
    gap = np.diff(w.t, prepend=w.t[0])
    return {Q: w.unit[Q] * np.cumsum(np.where(gap > 2 * DT, gap, DT * np.exp((w.H - 20) / 25))) / 1e4 * np.sqrt(K20 / (w.Ts + ZERO))}
clock = lambda w, c: own(w, c, (lambda x: x + (2 * c["u"] - 1) * x * x)((w.t - w.t[0]) / (w.t[-1] - w.t[0])))  # clock-drift: quadratic, and the external clock does not share it
rotation = lambda w, c: own(w, c, np.sin(4 * np.radians(w.drive[ANG] - 40 * c["u"] - c["sign"] * (0.3 + 0.5 * c["u"]) * (w.Ts - 20))))  # axis-rotation: the axis of damping turns with temperature, bias ~ sin 4(theta - theta_tau(T))
softening = lambda w, c: {F: -w.unit[F] * ((w.drive[POL] + 1.5) / 100) ** 2 / (1 + 2e-5 * (w.Ts - 20)) ** 3}  # electrostatic-softening: parallel plates with a contact potential; the gap grows with temperature
cross_damping = lambda w, c: own(w, c, (lambda z: 1 / np.cosh(z) if c["u"] < 0.6 else np.tanh(z))((w.Ts - c["T"]) / (0.6 * c["w"])))  # cross-damping: a relaxation line in one mode only, or a bond that softens under it [theory.md, 2]
quad_leak = lambda w, c: own(w, c, w.drive[QUAD] * (1 + 0.003 * (w.H - 20)))  # quadrature-leakage: through a demodulation phase that follows the temperature of the electronics a little
def spur(w, c):         # alien: pulled by a fixed emitter; a beat whose pitch is the distance to it, strongest near it [Adler 1946]
    return own(w, c, np.sin(2 * np.pi * np.cumsum(w.Ts - c["T"]) * DT * 5e-4) / (1 + ((w.Ts - c["T"]) / (1.5 * c["w"])) ** 2))
table_index = lambda w, c: own(w, c, np.cos(np.random.default_rng(c["rng"]).uniform(0, 6.3, 99999)[((w.t - w.t[0]) / 2700).astype(int)]))  # alien: the table under the chamber is turned every 45 min, the earth's rate
def charging(w, c):     # alien: discharges in the gap at random times, each leaks away in half an hour
    r, n = np.random.default_rng(c["rng"]), len(w.t)
    return own(w, c, lfilter([1], [1, -np.exp(-DT / 1800)], (r.random(n) < DT / 6000) * r.choice([-1.0, 0.6, 1.0], n)))
drive_rate = lambda w, c: own(w, c, (w.drive[AMP] - 0.8) * segwise(w, lambda H: low(np.gradient(H, DT), 60), w.H) * 3e3)  # alien: gradient times drive, neither acts alone
def agc_ringing(w, c):  # alien: each step of the drive sets off a slow loop, damped swings of some ten minutes
    x = np.arange(4000) * DT
    return own(w, c, segwise(w, lambda v: fftconvolve(np.sign(np.diff(v, prepend=v[0])), np.exp(-x / 2500) * np.sin(2 * np.pi * x / (500 + 500 * c["u"])))[: len(v)], w.drive[AMP]))
def bursts(w, c):       # alien: trains of magnetic swings, 20 to 50 min each, at no fixed hour
    r, y = np.random.default_rng(c["rng"]), 0.0
    for x in np.cumsum(np.r_[w.t[0], r.exponential(5000, int((w.t[-1] - w.t[0]) / 4000))]):
        m, P, n = w.t - x, r.uniform(350, 900), r.uniform(1200, 3000)
        y = y + (m > 0) * (m < n) * np.sin(2 * np.pi * m / P) * np.sin(np.pi * m / n)
    return own(w, c, y)
def stick_slip(w, c):   # alien: strain of a joint grows with temperature until it slips, each time at another load
    r, y, lim, d = np.random.default_rng(c["rng"]), np.zeros(len(w.t)), 1.0, np.diff(w.Ts, prepend=w.Ts[0]) / (0.5 * c["w"])
    for k in range(1, len(y)):
        y[k] = y[k - 1] + d[k] * (w.t[k] - w.t[k - 1] < 2 * DT)
        if abs(y[k]) > lim:
            y[k], lim = y[k] * r.uniform(-0.3, 0.3), r.uniform(0.3, 1.7)
    return own(w, c, y)
CAUSES = {  # name: function, responses, drive that must vary, further names accepted, neighbours
    "second-lag": (None, [F], None, [], ["mounting-stress", "radiation", "ageing"]), "radiation": (None, [F], None, [], ["second-lag", "thermometer-scale"]),
    "self-heating": (None, [F], AMP, [], ["amplitude-frequency"]),
    "thermometer-scale": (None, [F], None, [], ["curvature"]), "hysteresis": (hysteresis, [F, B, Q], None, [], ["mounting-stress"]), "ageing": (ageing, [F, Q], None, [], ["leak"]), "jump": (jump, [F, B, Q], None, [], []),
    "activity-dip": (dip, [F, Q], None, [], ["loss-peak", "curvature"]), "electrostatic-softening": (softening, [F], POL, [], []), "amplitude-frequency": (duffing, [F], AMP, [], ["self-heating"]),
    "curvature": (curvature, [F], None, [], ["thermometer-scale"]), "cross-damping": (cross_damping, [B], None, [], []), "loss-peak": (loss_peak, [Q], None, [], ["activity-dip"]),
    "leak": (leak, [Q], None, ["ageing"], []),
    "periodic": (periodic, [F, B, Q], None, [], []), "clock-drift": (clock, [F], None, [], ["ageing"]), "quadrature-leakage": (quad_leak, [B], QUAD, [], []), "rate-bias": (rate_bias, [B], None, [], ["mounting-stress"]),
    "axis-rotation": (rotation, [B], ANG, [], ["cross-damping"]), "mounting-stress": (creep, [F, B], None, [], ["second-lag", "rate-bias", "hysteresis", "ageing"])}
ALIENS = {"spur-crossing": (spur, [F], None), "table-index": (table_index, [B], None), "charging": (charging, [F, B], None), "stick-slip": (stick_slip, [F, B], None),
          "drive-times-rate": (drive_rate, [B], AMP), "agc-ringing": (agc_ringing, [B, Q], AMP), "field-bursts": (bursts, [B], None)}
# ------------------------------------------------------------------------------------------------ a campaign
NATURAL = {"second-lag": 0.4, "radiation": 0.6}     # largest share of the shell's heat capacity, of its exchange: the noise is chosen with them
PRIORS = {"law": {"a1": 2.5e-6, "a2": 4e-8, "t1": 0.2, "t2": 0.3, "share": 0.06}, "geometry": {"Gm": 0.25, "Cb": 0.25, "em": 0.6, "exch": 0.6, "k": 0.02, "c": 0.04, "d1": 4e-6, "d2": 7e-8}}
ABSOLUTE = {"a1", "a2", "share", "d1", "d2", "qs", "qc"}
class World:
    def __init__(w, r, card, rich, radiates, name, folder):
        w.p, w.card, w.rich, w.kind, w.style = gyro(r, card, rich, radiates), card, rich, str(r.choice(["peltier", "compressor", "oven"])), []
        lab, w.segs, cols, start, n0, w.only_air = r.uniform(18, 27), [], [], 0.0, 0, bool(rich and r.random() < 0.25)
        ta, grad = (r.uniform(15, 60), 3.0) if w.only_air else (w.p["ta"], w.p["grad"])      # without a sensor on it, a light housing in forced air
        lo, hi = {"peltier": (r.uniform(-20, -5), r.uniform(42, 58)), "compressor": (r.uniform(-40, -20), r.uniform(45, 68)), "oven": (lab + 7, r.uniform(55, 72))}[w.kind]
        for _ in range(int(r.integers(2, 6))):
            n = int(r.uniform(5, 12) * 3600 / DT) + int(PRE / DT)
            t, (ct, cT, off, style) = np.arange(n) * DT, programme(r, n * DT, lo, hi, 1.0 if card else 0.7)
            goal = np.interp(t, ct, cT)
            air = chamber(r, w.kind, t, goal, off, lab)         # housing: node 0 with the sensor, node 1 with the mount; grad: lag between them in s
            case = lambda u: network(np.ones(2), [(0, 1, 0.5 / grad)], [(0, 1.5 / ta), (1, 0.5 / ta)], [], u, [slice(0, len(u))])[0]
            if not card and not rich and not w.segs:            # a potted sensor as slow as all that stands between it and the shell's one lag
                h, (net, wt, _) = case(np.arange(20000) * DT), build(w.p)
                T, taus = network(*net, h[1], [slice(0, 20000)])
                w.p["lag"] = max(0.0, float((h[0] - wt @ T)[-1] - taus.max()))
            H = case(air)
            cols.append((t + start - PRE, H[1], low(H[1 if card else 0], w.p["lag"] + 1e-9), air, goal))
            w.segs.append(slice(n0, n0 + n))
            n0, start, w.style = n0 + n, start + n * DT + logu(r, 1500, 3e5), [*w.style, str(style)]
        w.t, w.H, w.sensor, w.air, w.goal = map(np.concatenate, zip(*cols))
        w.offset, w.drive = np.empty(n0), {k: np.empty(n0) for k in (AMP, POL, QUAD, ANG)}
        for s in w.segs:
            held = lambda a, b, v: np.repeat(r.choice(v, 999), (r.uniform(a, b, 999) / DT).astype(int))[: s.stop - s.start]
            w.drive[AMP][s], w.drive[ANG][s] = held(1500, 5400, [0.6, 0.7, 0.8, 0.9, 1.0]), held(3000, 9000, [0.0, 22.5, 45.0, 67.5])
            w.offset[s], w.drive[POL][s] = r.normal(0, 0.2), held(3000, 9000, [80.0, 90.0, 100.0, 110.0]) - 6e-5 * np.arange(s.stop - s.start)
            w.drive[QUAD][s] = 0.004 * (w.H[s] - 20) + 0.15 * ou(r, s.stop - s.start, 2500) + held(4000, 9000, [-0.2, 0.0, 0.2])
        w.p["kb"], w.p["kbsd"], path = [0.0] * 4, [1.0] * 4, folder / "card.toml"
        if card == "geometry":
            card_law(r, w.p, path, write_card(r, w.p, name, path, radiates))    # this card for its law, the next to keep
        x = abs(w.p["f0"] * w.p["a1"]) * 25             # Hz: bias coefficients such that each term makes a few deg/h
        w.p["kb"], w.p["kbsd"] = [r.normal(0, 2)] + [float(r.normal(0, a) / x**j) for j, a in ((1, 3), (2, 0.7), (3, 0.3))], [2.0] + [a / x**j for j, a in ((1, 1.5), (2, 0.4), (3, 0.15))]
        if card:
            write_card(r, w.p, name, path, radiates)
        w.rows(r)
        w.unit, _ = {F: 1e-6 * w.p["f0"], B: 0.05, Q: 0.02 * w.p["q0"]}, card and w.tangents()
    def static(w, T, p=None):
        p, x, f = p or w.p, T - 20, law(p or w.p, T)
        return {F: f, B: sum(k * (f - p["f0"]) ** j for j, k in enumerate(p["kb"])), Q: p["q0"] * (1 + p["qs"] * x + p["qc"] * x * x)}
    def forward(w, hidden=(), H=None, **change):
        v, p = copy.copy(w), {**w.p, **change}
        by = {h["name"]: h for h in hidden}
        p |= {"share": by["radiation"]["A"], "stem": 1 - by["radiation"]["A"] - p.get("gas", 0)} if "radiation" in by else {}
        (C, links, bound, rad), wt, hub = build(p)
        if "second-lag" in by:                          # a mass (ring of cement, getter) on the base or on the shell's foot, 1200 to 3000 s away
            m = by["second-lag"]["A"] * C[hub:].sum()
            C, links, wt = np.r_[C, m], [*links, (hub, len(C), m / (0.15 * by["second-lag"]["c"]["tau"]))], np.r_[wt, 0]
        power = np.outer(wt, w.drive[AMP] ** 2) * by["self-heating"]["A"] if "self-heating" in by else 0.0
        T, v.taus = network(C, links, bound, rad, w.H if H is None else H, w.segs, power)
        v.Ts, v.Tin = wt @ T, T[0]
        out = (lambda x: {F: x[F], B: x[B] + w.offset, Q: x[Q], "Ts": v.Ts, "taus": v.taus, "reference": x[F]})(w.static(v.Ts, p))
        for h in hidden:
            for k, y in (h["fn"](v, h["c"]) if h["fn"] else {}).items():
                out[k] = out[k] + h["A"] * y
                out["reference"] = out["reference"] + (h["A"] * y if k == F and h["name"] != "clock-drift" else 0)
        return out
    def rows(w, r):
        """Times of the logger: even, jittered, with losses, or slower when nothing moves; holes; a restart cuts a run into two files."""
        row = float(max(r.choice([10, 15, 20, 30, 60]), np.ceil(len(w.t) * DT / 7000)))
        how, ch, seg, cut = str(r.choice(["even", "jitter", "lossy", "event"])), [], [], r.random() < 0.2
        for i, s in enumerate(w.segs):
            x = np.arange(w.t[s][0] + PRE, w.t[s][-1] - 40, row)
            x = x + r.uniform(0, min(0.6 * row, 30), len(x)) * (how == "jitter")
            keep = (r.random(len(x)) > 0.12 * (how == "lossy")) & ((how != "event") | (np.arange(len(x)) % 3 == 0) | (np.abs(np.interp(x, w.t[s], np.gradient(w.sensor[s], DT))) > 8e-4))
            a = r.uniform(x[0] + 3600, x[-1] - 7200)
            keep &= (x < a) | (x > a + r.uniform(1500, 5000)) | (r.random() > 0.2)
            for j, y in enumerate(np.split(x[keep], [int(len(x[keep]) * r.uniform(0.35, 0.65))] if cut and i == 0 else [])):
                ch, seg = [*ch, y[int(r.integers(180, 900) / row) * (j > 0):]], [*seg, i]
        w.tr, w.cid, w.sampling = np.concatenate(ch), np.repeat(np.arange(len(ch)), [len(y) for y in ch]), {"row": row, "kind": how, "restart": bool(cut)}
        w.rseg, w.pos = np.array(seg)[w.cid], np.interp(w.tr, w.t, np.arange(len(w.t)))
        w.first = np.flatnonzero((np.diff(w.tr, prepend=-1e9) > 600) | (np.diff(w.cid, prepend=-1) > 0))
        w.sid = np.cumsum(np.isin(np.arange(len(w.tr)), w.first)) - 1
    at = lambda w, x: np.interp(w.pos, np.arange(len(x)), x)
    def driver(w, read):
        return np.concatenate([np.interp(w.t[s] + w.p["lag"] * bool(w.card), w.tr[w.rseg == i], read[w.rseg == i]) for i, s in enumerate(w.segs)])
    def states(w, taus):
        return np.array([np.where(w.sid == k, np.exp((w.tr[w.first][w.sid] - w.tr) / tau), 0) for tau in taus for k in range(len(w.first))])
    def tangents(w):
        """Of a card's simulation, per stated standard deviation, at the truth."""
        sd = {**PRIORS[w.card], "q0": 0.15, "qs": 0.0015, "qc": 2e-5}
        base, grad = w.forward(), lambda y: w.at(np.gradient(y, DT)) * 0.3
        moved = [w.forward(**{k: w.p[k] + 0.2 * v * (1 if k in ABSOLUTE else w.p[k])}) for k, v in sd.items()]
        moved += [w.forward(kb=[k + 0.2 * w.p["kbsd"][i] * (i == j) for i, k in enumerate(w.p["kb"])]) for j in (1, 2, 3)]
        w.tan, w.lags = {k: np.array([w.at(m[k] - base[k]) / 0.2 for m in moved] + [grad(base[k])]) for k in (F, B, Q)}, np.sort(base["taus"])[::-1][:3]
    def left(w, k, y, read, f, sigma, also=None):
        """What the refitted baseline leaves of y (response k at the rows, temperature read, frequency f or None); also: projected alike."""
        one, drv, soft, solve = [(w.cid == i) * 1.0 for i in range(w.cid[-1] + 1)], w.driver(read), [], lambda A, e: np.linalg.lstsq(A.T, e, rcond=None)[0]
        if w.card:                                      # the card's simulation, unknown states at each start, values within their priors
            T, E, soft = w.at(w.forward(H=drv)["Ts"]), w.states(w.lags), w.tan[k]
            for _ in range(4):
                pred = w.static(T)[k]
                A = np.array(one + list((w.static(T + 0.01)[k] - pred) / 0.01 * E))
                T = T + solve(np.vstack([A, soft]), y - pred)[len(one) : len(A)] @ E
            y = y - pred
        elif k == B and f is not None:                  # cubic in the measured frequency
            A = np.array(one + [((f - f.mean()) / np.ptp(f)) ** j for j in (1, 2, 3)])
        else:                                           # polynomial law behind one lag, unknown temperature at each start
            n, level = 4 if k == B else 3, one if k == B else [np.ones(len(y))]
            def columns(lt):
                x, E, slope = (w.at(network(np.ones(1), [], [(0, np.exp(-lt))], [], drv, w.segs)[0][0]) - 20) / 30, w.states([np.exp(lt)]), 1.0
                for _ in range(3):
                    A = np.array([x**j for j in range(1, n)] + level + list(slope * E))
                    c = solve(A, y - y.mean())
                    slope = sum(j * c[j - 1] * x ** (j - 1) for j in range(1, n)) / c[0]
                    x = x + c[len(A) - len(E):] / c[0] @ E
                return A, c
            lt = minimize_scalar(lambda lt: rms(y - y.mean() - (lambda A, c: c @ A)(*columns(lt))), bounds=(np.log(60), np.log(9000)), method="bounded", options={"xatol": 1e-4}).x
            A = (lambda A, c: np.vstack([A, c @ (columns(lt + 0.02)[0] - A) / 0.02]))(*columns(lt))
        n = len(soft)
        A = np.vstack([A / np.linalg.norm(A, axis=1)[:, None], *(x[None] / sigma for x in soft)]).T
        M = np.vstack([A, np.eye(A.shape[1])[A.shape[1] - n:]])
        proj = lambda e: e - sigma * A @ np.linalg.lstsq(M, np.r_[e / sigma, np.zeros(n)], rcond=None)[0]
        return proj(y) if also is None else (proj(y), proj(also))
def noise(r, fam, w, tau):
    """Unit rms at the rows: oscillator noise from filtered processes, with some white in each."""
    n, white = len(w.t), r.standard_normal(len(w.tr))
    flicker = sum(ou(r, n, 10 * 4.0**j) for j in range(8)) / 8**0.5
    walk = np.concatenate([np.cumsum(r.standard_normal(s.stop - s.start)) * (DT / 14000) ** 0.5 for s in w.segs])
    slow = {"flicker": flicker, "walk": walk, "markov": ou(r, n, tau), "mixed": 0.5 * flicker + 0.35 * walk}.get(fam, 0 * walk)
    x = white * (1 + 3 * (w.at(ou(r, n, 700)) > 1.2)) if fam == "bursts" else 0.6 * white + w.at(slow)
    return x / rms(x)
def sigmas(e, unit):
    """Matched filter in coloured noise: d^2 = sum |E|^2 / S over frequency, S from projected noise."""
    S = np.convolve(np.pad(np.mean([np.abs(np.fft.rfft(u)) ** 2 for u in unit], axis=0), 8, "reflect"), np.ones(17) / 17, "valid")
    return float(np.sqrt(2 * np.sum(np.abs(np.fft.rfft(e)) ** 2 / S)))
def campaign(r, name, kind, names, card, folder):
    table = CAUSES | {k: (*v, [], []) for k, v in ALIENS.items()}
    card = "" if "axis-rotation" in names or ("radiation" in names and card == "geometry") else card       # these cards hold the pattern, and T^4, themselves
    folder.mkdir(parents=True)
    w, hidden = World(r, card, not card and r.random() < 0.35, "radiation" in names, name, folder), []
    lo, hi = np.percentile(w.at(w.forward()["Ts"]), [2, 98])
    inner = w.tr[(w.tr - w.tr[w.first][w.sid] > 5400) & (np.roll(w.sid, -int(5400 / w.sampling["row"])) == w.sid)]      # far from starts and holes
    for n in sorted(names, key=lambda n: n not in NATURAL):
        fn, resp, _, accept, near = table[n]
        c = {"resp": Q if n == "activity-dip" and len(names) > 1 else str(r.choice(resp)), "T": r.uniform(0.75 * lo + 0.25 * hi, 0.25 * lo + 0.75 * hi), "w": (hi - lo) * r.uniform(0.1, 0.25),
             "tau": logu(r, 8000, 20000), "u": r.random(), "sign": float(r.choice([-1, 1])), "per": max(logu(r, 500, 4000), 12 * w.sampling["row"]), "age": logu(r, 2e4, 3e5),
             "rng": int(r.integers(2**31)), "tj": float(r.choice(inner)), "knots": list(r.normal(0, 1, 14))}
        A = {**NATURAL, "self-heating": 1e-3, "thermometer-scale": 0.05}.get(n, 1.0)
        hidden.append({"name": n, "response": c["resp"], "fn": fn, "c": c, "A": A, "target": logu(r, 0.5, 12), "accept": [n, *accept], "near": near})
    resp = {F, B, Q} if r.random() < 0.55 else set(map(str, r.choice([F, B, Q], 2, replace=False))) if r.random() < 0.7 else {F}
    resp |= {h["response"] for h in hidden} | ({F} if r.random() < 0.8 else set())
    resp -= {Q} if [(h["name"], h["response"]) for h in hidden] == [("activity-dip", F)] else set()        # a crossing would show first in 1/Q
    drives = {table[n][2] for n in names} - {None} | ({str(r.choice([AMP, POL, QUAD]))} if r.random() < 0.2 else set())
    only_air, q_read, fam, tau = w.only_air, float(r.choice([0.001, 0.002, 0.01])), str(r.choice(["white", "flicker", "walk", "markov", "mixed", "bursts", "quantised"])), logu(r, 30, 1500)
    thermometer = r.normal(0, r.uniform(0.001, 0.003), len(w.tr))
    def reading(hs):
        x = w.at(w.air if only_air else w.sensor)
        for h in (h for h in hs if h["name"] == "thermometer-scale"):       # error table of the sensor, a knot every 14 K
            x = x + h["A"] * PchipInterpolator(-70 + 14 * np.arange(14), h["c"]["knots"])(x)
        return np.round((x + thermometer) / q_read) * q_read
    def rest(k, hs, level, also=None):
        o = w.forward(hs)
        return w.left(k, w.at(o[k]), reading(hs), w.at(o[F]) if F in resp else None, level, also)
    units, level, own_world, unit_floor, most = {k: noise(r, fam, w, tau) for k in sorted(resp)}, {}, {}, {}, logu(r, 1.5, 8) if w.rich else 0.3
    for k in sorted(resp, reverse=True):            # F, then 1/Q, then bias
        size = {F: abs(w.p["f0"] * w.p["a1"]) * logu(r, 8e-3 if card else 3e-4, 2e-2), B: logu(r, 0.004, 0.06), Q: w.p["q0"] * logu(r, 5e-4, 1e-2)}[k]
        if k == B and F in resp:                    # frequency noise through the bias polynomial stays small
            x = [w.static(np.linspace(lo, hi, 9) + d) for d in (0, 0.01)]
            size = max(size, 3 * level[F] * np.abs((x[1][B] - x[0][B]) / (x[1][F] - x[0][F])).max())
        for _ in range(3):                          # healthy departure below 0.3 of the noise, of a rich device below 1.5 ... 8
            dep, nf = map(rms, rest(k, [], size, size * units[k]))
            level[k], own_world[k], unit_floor[k], size = size, dep / nf, nf / size, size * max(1.0, dep / nf / most)
    for i, h in enumerate(hidden):
        k, before = h["response"], rest(h["response"], hidden[:i], level[h["response"]])
        for _ in range(5):
            e = rms(rest(k, hidden[: i + 1], level[k]) - before)
            x = h["target"] * level[k] * unit_floor[k] / e
            h["A"] = min(h["A"] * x, NATURAL.get(h["name"], np.inf))
        if h["name"] in NATURAL:                    # not so much of it in nature: a quieter instrument, within the limit above
            level[k] *= max(min(1, 1 / x), own_world[k] / most, 1.0 if card else 0.0)
    clean, read = w.forward(hidden), reading(hidden)
    columns, recorded, res, floor, wild = {("chamber" if only_air else "housing") + "_temperature_degC": read}, {}, {}, {}, r.random(len(w.tr)) < (0.003 if r.random() < 0.25 else 0)
    columns |= {"chamber_temperature_degC": np.round(w.at(w.goal), 2)} if not only_air and r.random() < 0.3 else {}
    for k in [x for x in (F, B, Q) if x in resp]:
        step = level[k] / 0.38 if fam == "quantised" else 10 ** np.floor(np.log10(level[k] / 10))
        res[k] = float(f"{step:.1e}") if fam == "quantised" else step
        y = w.at(clean[k]) + units[k] * level[k] * (0.25 / 0.38 if fam == "quantised" else 1)
        recorded[k] = np.round((y + wild * r.choice([-1, 1], len(y)) * r.uniform(8, 40, len(y)) * level[k]) / res[k]) * res[k]
        floor[k] = np.where(wild, 0, recorded[k] - w.at(clean[k]))
    reference = F in resp and r.random() < (0.7 if "clock-drift" in names else 0.05)
    columns |= recorded | ({"reference_frequency_Hz": np.round(recorded[F] + w.at(clean["reference"] - clean[F]) + 0.1 * level[F] * r.standard_normal(len(w.tr)), 6)} if reference else {})
    columns |= {k: np.round(w.at(w.drive[k]), 4) for k in sorted(drives)}
    final = {k: rest(k, hidden, level[k], floor[k]) for k in recorded}
    for h in hidden:
        e = {k: final[k][0] - rest(k, [g for g in hidden if g is not h], level[k]) for k in recorded}
        h["snrs"], k = {k: rms(e[k]) / rms(final[k][1]) for k in recorded}, h["response"]
        h["snr"], h["size"], others = round(h["snrs"][k], 3), rms(e[k]), [noise(np.random.default_rng(s), fam, w, tau) * level[k] for s in range(6)]
        h["sigma"] = sigmas(e[k], [rest(k, hidden, level[k], x)[1] for x in others])
    dated, begin, digits = r.random() < 0.85 or {"ageing", "leak", "clock-drift"} & set(names), datetime.datetime(2026, 5, 11, 7, 30), {F: 6, B: 5, Q: 14}
    for i in range(w.cid[-1] + 1):
        m, t0 = w.cid == i, float(np.floor(w.tr[w.cid == i][0]))
        head = [f"# start: {(begin + datetime.timedelta(seconds=t0)).isoformat()}"] * bool(dated) + [f"# resolution {k}: {v:.2g}" for k, v in res.items() if fam == "quantised"]
        cells = [[f"{x:.3f}" for x in w.tr[m] - t0]] + [[f"{x:.{digits.get(k, 4)}g}" if k == Q else f"{x:.{digits.get(k, 4)}f}" for x in v[m]] for k, v in columns.items()]
        (folder / f"run_{i}.csv").write_text("\n".join([*head, ",".join(["time_s", *columns]), *map(",".join, zip(*cells))]) + "\n")
    rich = w.rich and max(own_world.values()) > 0.33
    right = {"null": ["adequate"] + ["explained", "not-identifiable"] * rich, "alien": ["unexplained"]}.get(kind, ["explained", "not-identifiable"])
    for h in hidden:
        h["accept"], h["near"] = h["accept"] + ["ageing"] * (h["name"] == "clock-drift" and not reference), h["near"] + ["clock-drift"] * (h["name"] == "ageing" and h["response"] == F)
        h["constants"], h["amplitude"], _ = h.pop("c"), h.pop("A"), h.pop("fn")
    return {"kind": kind, "noise": fam, "noise_tau_s": tau, "card": card, "rich": rich, "own_world_snr": max(own_world.values()), "own_world": own_world,
            "tolerated": ["second-lag", "radiation", "thermometer-lag", "mounting-stress"] if rich else [], "hidden": hidden,
            "right_verdicts": right + ["adequate"] * (bool(hidden) and max(h["sigma"] for h in hidden) < 5), "responses": sorted(recorded), "runs": int(w.cid[-1]) + 1,
            "style": {**w.sampling, "chamber": w.kind, "profiles": w.style, "rows": len(w.tr), "only_air": only_air, "dated": bool(dated)}, "outliers": bool(wild.any()), "reference": reference,
            "drives": sorted(drives), "noise_floor_rms": {k: rms(v[1]) for k, v in final.items()}, "size": {k: rms(v) for k, v in floor.items()}, "tau_s": float(w.forward()["taus"].max()), "device": w.p}
def main():
    a = argparse.ArgumentParser(description=__doc__)
    for k, kind, v in (("out", Path, None), ("--count", int, 40), ("--seed", int, 1), ("--only", int, None)):
        a.add_argument(k, type=kind, default=v)
    a = a.parse_args()
    r, n, a.out = np.random.default_rng(a.seed), a.count, a.out.resolve()
    kinds = r.permutation([["effect", "pair", "null", "alien"][np.searchsorted([0.5, 0.62, 0.82], (i + 0.5) / n)] for i in range(n)])
    cards = r.permutation((["law", "law", "geometry", "geometry", "law"] * n)[: round(n * 0.36)] + [""] * (n - round(n * 0.36)))
    deck = lambda names: iter([x for _ in range(n) for x in r.permutation(list(names))])
    single, double, foreign, truth = deck(CAUSES), deck(CAUSES), deck(ALIENS), {}
    for i in range(n):
        name, names = f"d{i:03d}", [next(d) for d in {"effect": [single], "pair": [double, double], "null": [], "alien": [foreign]}[kinds[i]]]
        if a.only in (None, i):
            truth[name] = campaign(np.random.default_rng([a.seed, i]), name, str(kinds[i]), [str(x) for x in names], str(cards[i]), a.out / "cases" / name)
            print(name, kinds[i], cards[i], [(h["name"], h["response"], h["snr"], round(h["sigma"])) for h in truth[name]["hidden"]], {k: round(v, 2) for k, v in truth[name]["own_world"].items()}, flush=True)
            (a.out / "truth.json").write_text(json.dumps(truth, indent=1, default=lambda x: x.tolist() if hasattr(x, "tolist") else str(x)))
if __name__ == "__main__":
    main()
