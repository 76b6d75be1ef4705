"""Examiner F: campaigns of a gyro on a bench, a vibration table, a fast screening chamber, in storage, on a rate table.
    python stations.py OUT --count N --seed S
SNR: the effect's part that a refitted healthy baseline cannot absorb (columns: offset a run; T, T² (bias: T³ too); derivative
to the lag; exp(-t/lag) a run; with a card instead its constants with their stated widths as penalties), rms, over the rms of the noise
after the same projection; both averaged over max(100 s, run/250). sigma: the same signal's significance by generalised least
squares with the true covariance of the noise. A name is accepted besides the true one when its best template with the baseline leaves less than
3.5 sigma of the signal. An alien's best single template leaves more than 0.45 of its rms.
"""
import argparse, json, os, shutil, numpy as np
from scipy.signal import lfilter
from scipy.linalg import solve_triangular
SB, STEM_M = 5.670374e-8, 18e-3
OU_S = np.array([60.0, 300.0, 1500.0, 7500.0])      # flicker: equal variances, time constants in octaves of five
def lag(u, g, tau, start=None):
    """First-order lag of samples u at step g, exact for input linear between samples."""
    a = np.exp(-g / tau); k = tau / g * (1 - a); b0, b1 = 1 - k, k - a; y0 = u[0] if start is None else start
    return lfilter([b0, b1], [1, -a], u, zi=[y0 - b0 * u[0]])[0]
def smooth(u, g, s): return lag(lag(u, g, s / 2), g, s / 2)
def course(scene, r, k, rng_dev):
    """Air and housing temperature of run k: time step of rows dt, grid g, arrays."""
    if scene == "bench":
        dt, n = 30.0, int(r.integers(3000, 5500)); g = 10.0; t = np.arange(0, n * dt, g); d = t / 86400
        mean = r.uniform(8, 32); amp = r.uniform(3, 7); p = r.uniform(0, 1); slow = np.interp(d, np.arange(0, 6, 0.7), r.normal(0, 2.0, 9))
        air = mean + slow + amp * (np.sin(2*np.pi*(d+p)) + 0.3*np.sin(4*np.pi*(d+p)+r.uniform(0, 6)))
        for _ in range(r.integers(1, 4)):                       # a window is opened
            a = r.uniform(0.05, 0.9) * t[-1]; air = air - r.uniform(2, 8) * ((t > a) & (t < a + r.uniform(1200, 7200)))
        air = smooth(air, g, 900); house = lag(air, g, 1100.0) + 4.0
    elif scene == "vibe":
        dt, n = float(r.choice([2.0, 3.0])), int(r.integers(3000, 5500)); g = 1.0; t = np.arange(0, n * dt, g)
        amb = r.uniform(16, 26); edges = np.cumsum(r.uniform(1200, 3600, 20)); power = r.choice([0.15, 0.6, 1.0, 1.4], 21); p = power[np.searchsorted(edges, t)]
        if k % 2: p = p * (t < 0.65 * t[-1])                    # switched off, cools
        rise = 18 * lag(p, g, 900.0, 0) + 10 * lag(p, g, 4000.0, 0); air = amb + 0.0*t; house = amb + rise
    elif scene == "screen":
        dt, n = float(r.choice([4.0, 5.0])), int(r.integers(3000, 5500)); g = 2.0; t = np.arange(0, n * dt, g)
        pts, now, T, hot = [(0, 23.0)], 600.0, 23.0, bool(k % 2); pts.append((now, T))
        while now < t[-1]:
            nxt = float(r.choice([85, 70, 60]) if hot else r.choice([-40, -30, -20])); hot = not hot
            if r.random() < 0.25: nxt = 23.0
            now += abs(nxt - T) / 5 * 60; pts.append((now, nxt)); now += r.uniform(1200, 3600); pts.append((now, nxt)); T = nxt
        air = smooth(np.interp(t, *zip(*pts)), g, 40); air = air + 0.3*np.sin(2*np.pi*t/ (90+20*k)); house = lag(air, g, rng_dev["case_s"])
    elif scene == "storage":
        dt, n = float(r.choice([200.0, 300.0])), int(r.integers(1500, 2600)); g = 50.0; t = np.arange(0, n * dt, g)
        edges = np.cumsum(r.uniform(0.4, 1.5, 40)) * 86400; lev = r.choice([5, 15, 25, 40, 55], 41).astype(float)
        air = lag(smooth(lev[np.searchsorted(edges, t)] + 1.2*np.sin(2*np.pi*t/86400), g, 9000), g, 5400.); house = lag(air, g, 2400.0)
    else:                                                        # ratetable: cold starts, a heated cover
        dt, n = float(r.choice([3.0, 4.0])), int(r.integers(2200, 4200)); g = 1.0; t = np.arange(0, n * dt, g)
        amb = [21.0, 5.0, 38.0, 28.0, 12.0][k % 5] + r.uniform(-3, 3); edges = np.cumsum(r.uniform(1500, 4500, 12)); lev = np.r_[0, r.uniform(-12, 18, 12)]
        air = amb + smooth(lev[np.searchsorted(edges, t)], g, 200); house = lag(air, g, 700.0) + r.uniform(7, 14) * lag(np.ones_like(t), g, 1300.0, 0)
    return dt, n, g, t, air, house
class Plain:
    """No card: fused silica behind one exchange with the housing."""
    def __init__(self, r):
        self.tau = r.uniform(250, 1800); self.f0, self.a, self.b = r.uniform(3800, 7200), r.uniform(70, 95)*1e-6, r.uniform(-2.5, -0.3)*1e-7
        self.q0, self.q1, self.q2 = r.uniform(0.5, 4)*1e-7, r.uniform(0, 6)*1e-3, r.uniform(0, 3)*1e-5
        self.k = r.normal(0, [4, 0.12, 6e-4, 4e-6]); self.k[0] *= 2
    def warm(self, house, g, start=None): return lag(house, g, self.tau, start)              # the contract's healthy resonator without a card: one lag
    def chain(self, house, g, start, frac):
        """What a real mount does: the main lag, then a diffusing stem (constants 1/i²)."""
        y = lag(house, g, self.tau, start)
        for i in range(1, 6): y = lag(y, g, self.tau*frac/i**2, start)
        return y
    def answer(self, T):
        x = T - 20.0
        return {"frequency_Hz": self.f0 * (1 + self.a*x + self.b*x*x), "inverse_q": self.q0 * (1 + self.q1*x + self.q2*x*x),
                "bias_deg_per_h": self.k[0] + self.k[1]*x + self.k[2]*x**2 + self.k[3]*x**3}
class Card:
    """The device of the shipped card hrg-30mm with every value drawn from its stated width; own network of 26 nodes."""
    SD = {"film_emissivity": ("log", 0.83), "base_C": ("log", 0.47), "mount_G": ("log", 0.47), "mount_A": ("log", 0.83),
          "k": ("rel", 0.022), "c": ("rel", 0.041), "sensor_s": ("log", 0.47), "share": ("half", 0.3)}
    MEAN = {"film_emissivity": 0.03, "base_C": 25.0, "mount_G": 0.01181, "mount_A": 1e-3, "k": 1.38, "c": 740.0, "sensor_s": 10.0,
            "share": 0.0}
    def __init__(self, r):
        z = lambda: float(np.clip(r.normal(), -1.6, 1.6)); self.p = {n: self.move(n, self.MEAN[n], z()) for n in self.SD}
        self.f = 4432.089 * (1 + 0.0032*z()), 88.7e-6 + 6.3e-6*z(), -4.75e-8 + 1.1e-7*z(), 0.0
        self.q0, self.q1, self.q2 = 1e-7*np.exp(0.83*z()), 0.004 + 0.004*z(), 1.2e-5*abs(z())
        self.off, self.A = 10*z(), 0.01*np.exp(0.83*z())*np.sin(np.radians(4*(22.5 - 26*z()))); self.kk = 1.0*0.3*z(), 0.1*0.1*z(), 0.01*0.03*z()
        self.tau = 2000.0
    @classmethod
    def move(cls, n, v, s):
        kind, sd = cls.SD[n]
        return v*np.exp(sd*s) if kind == "log" else v*(1+sd*s) if kind == "rel" else abs(sd*s) if kind == "half" else v + sd*s
    def warm(self, house, g, start=None, p=None, cells=24):
        p = p or self.p; R, h, rs = 15e-3, 0.8558278e-3, 2.5e-3; L = STEM_M; rho = 2203.0
        edge = np.linspace(np.arcsin(rs/R), np.pi/2, cells + 1); mid = 0.5*(edge[1:]+edge[:-1])
        area = 2*np.pi*R*R*(np.cos(edge[:-1]) - np.cos(edge[1:])); n = cells + 2; C = np.r_[p["base_C"], rho*p["c"]*np.pi*rs*rs*L, rho*p["c"]*area*h]
        A = np.zeros((n, n))
        def join(i, j, G):
            A[i, i] -= G/C[i]; A[i, j] += G/C[i]; A[j, j] -= G/C[j]; A[j, i] += G/C[j]
        Gs = p["k"]*np.pi*rs*rs/(L*1.067/2); join(0, 1, Gs); first = R*(mid[0]-edge[0])/(p["k"]*h*2*np.pi*rs); join(1, 2, 1/(1/Gs + first))
        for i in range(cells - 1): join(i+2, i+3, p["k"]*h*2*np.pi*R*np.sin(edge[i+1])/(R*(mid[i+1]-mid[i])))
        A[0, 0] -= p["mount_G"]/C[0]; T = np.full(n, house[0] if start is None else start) + 273.15; H = house + 273.15
        m = max(1, int(np.ceil(5.0/g)));                         # steps of at most 5 s
        idx = np.arange(0, len(house), m); dtm = g*m; Lft = np.linalg.inv(np.eye(n) - dtm/2*A); Rgt = Lft @ (np.eye(n) + dtm/2*A); Ldt = Lft*dtm
        w = np.r_[0, 0, np.tan(mid/2)**4/np.sin(mid)**3]; w /= w.sum()
        rad = 2*p["film_emissivity"]*SB*area/C[2:]; back = 2*p["film_emissivity"]*SB*area/C[0]; share = p["share"]
        out = np.empty(len(idx)); old = None; last = H[idx[0]]
        for j, i in enumerate(idx):
            if j:
                T = Rgt @ T + Ldt @ (1.5*q - 0.5*(old if old is not None else q)); old = q
            out[j] = w @ T; q = np.zeros(n); T4 = T**4; Hn = H[min(i + m//2, len(H)-1)] if m > 1 else 0.5*(H[i] + H[min(i+1, len(H)-1)])
            ex = (1-share)*(T4[0]-T4[2:]) + share*(Hn**4 - T4[2:]); q[2:] = rad*ex
            q[0] = (p["mount_G"]*Hn + p["mount_A"]*SB*(Hn**4 - T4[0]))/C[0] - (back*(1-share)*(T4[0]-T4[2:])).sum()
        return np.interp(np.arange(len(house)), idx, out) - 273.15
    def answer(self, T):
        x = T - 20.0; f0, a, b, c = self.f; f = f0*(1 + a*x + b*x*x + c*x**3); q = self.q0*(1 + self.q1*x + self.q2*x*x); d = f - f0
        return {"frequency_Hz": f, "inverse_q": q,
                "bias_deg_per_h": self.off + 0.5*self.A*np.pi*f*q*206265*0.5/0.277 + self.kk[0]*d + self.kk[1]*d*d + self.kk[2]*d**3}
class Run: pass
def play(x, w, m0):
    y = np.empty_like(x); p = m0
    for i, v in enumerate(x):
        p = v - w if p < v - w else v + w if p > v + w else p; y[i] = p
    return y
class Campaign:
    def __init__(self, r, scene, dev, runs, responses):
        self.r, self.scene, self.dev, self.resp = r, scene, dev, responses; self.runs, when = [], 0.0; dev_c = {"case_s": r.uniform(90, 260)}; gate = {}
        for k in range(runs):
            u = Run(); u.dt, u.n, u.g, u.t, u.air, u.house = course(scene, r, k, dev_c); u.when = when; when += len(u.t)*u.g + r.uniform(0.3, 2.5)*86400
            cold = u.air[0] if scene in ("vibe", "ratetable") else None; u.T = dev.warm(u.house, u.g, cold); u.cold = cold; self.runs.append(u)
        dt = self.runs[0].dt; gate = min(dt, 10.0)
        self.white = {"frequency_Hz": r.uniform(2, 6)*1e-3/np.sqrt(gate), "bias_deg_per_h": r.uniform(0.6, 2.5)/np.sqrt(dt),
                      "inverse_q": (dev.q0*r.uniform(0.004, 0.012))/np.sqrt(gate)}
        self.flick = {q: s*r.uniform(0.08, 0.22) for q, s in self.white.items()}           # of each OU part
        self.walk = {q: s*r.uniform(0.1, 0.5)/np.sqrt(2e4) for q, s in self.white.items()}  # a second^½
        if scene in ("bench", "storage"): self.walk = {q: v*0.3 for q, v in self.walk.items()}
        self.block = max(100.0, max(len(u.t)*u.g for u in self.runs)/250); self.base_cache = {}; self.scale_error = []
        self.mK, self.res_T = r.uniform(.001, .010), float(r.choice([.001, .005, .01])); tau = 2000. if isinstance(dev, Card) else dev.tau
        self.through = .36*np.hypot(self.mK, self.res_T/3.46)*np.sqrt(min(dt/2/tau, .4))      # thermometer noise behind the lag, Hz
        self.range = np.percentile(np.concatenate([u.T for u in self.runs]), [5, 95])
    def noise(self, q, u, r):
        n = len(u.ts); g = np.diff(u.ts, prepend=u.ts[0]-u.dt); out = r.normal(0, self.white[q], n); grid = np.arange(0, u.ts[-1]+2*u.g, u.g)
        for s in OU_S:
            a = np.exp(-u.g/s); e = r.normal(0, self.flick[q]*np.sqrt(1-a*a), len(grid)); e[0] = r.normal(0, self.flick[q])
            out += np.interp(u.ts, grid, lfilter([1], [1, -a], e))
        return out + np.cumsum(r.normal(0, self.walk[q], n)*np.sqrt(np.maximum(g, 0)))
    def blocks(self, arrays):
        """Fine-grid arrays (one a run) averaged over blocks, all runs in one vector."""
        out = []
        for u, y in zip(self.runs, arrays):
            m = int(round(self.block/u.g)); k = len(y)//m; out.append(y[:k*m].reshape(k, m).mean(1))
        return np.concatenate(out)
    def white_matrix(self, q):
        if ("L", q) not in self.base_cache:
            parts = []
            for u in self.runs:
                m = int(round(self.block/u.g)); k = len(u.t)//m; t = (np.arange(k)+.5)*self.block; d = abs(t[:, None]-t)
                K = np.eye(k)*self.white[q]**2*max(u.dt/self.block, 1e-9)
                for s in OU_S: K += self.flick[q]**2*min(1, 2*s/self.block)*np.exp(-d/s)
                if q == 'frequency_Hz': K += self.through**2*min(1, 2*self.dev.tau/self.block)*np.exp(-d/self.dev.tau)
                K += self.walk[q]**2*np.minimum(t[:, None], t); parts.append(np.linalg.cholesky(K))
            self.base_cache["L", q] = parts
        return self.base_cache["L", q]
    def whiten(self, q, M):
        out, i = [], 0
        for L in self.white_matrix(q): out.append(solve_triangular(L, M[i:i+len(L)], lower=True)); i += len(L)
        return np.concatenate(out)
    def baseline(self, q):
        if q in self.base_cache: return self.base_cache[q]
        R, cols, pen = self.runs, [], []; T = [u.T for u in R]; slope = [(self.dev.answer(u.T+.05)[q]-self.dev.answer(u.T-.05)[q])/.1 for u in R]
        for k, u in enumerate(R):
            for tau in ([self.dev.tau] if isinstance(self.dev, Plain) else [700., 2000.]):
                cols.append([np.exp(-v.t/tau)*(v is u) for v in R]); pen.append(0)
            cols.append([1.0*(v is u)+0*v.t for v in R]); pen.append(0)
        for p in (1, 2) if q != "bias_deg_per_h" else (1, 2, 3): cols.append([((x-20)/30)**p for x in T]); pen.append(0)
        if isinstance(self.dev, Plain):
            cols.append([s*lag(np.gradient(x, u.g), u.g, self.dev.tau)*100 for s, x, u in zip(slope, T, R)]); pen.append(0)
        else:
            for n in Card.SD:
                if n == "sensor_s": d = [0.47*self.dev.p[n]*np.gradient(x, u.g) for x, u in zip(T, R)]
                else:
                    p = dict(self.dev.p); p[n] = Card.move(n, p[n], 0.3) if n != "share" else p[n] + 0.09
                    d = [(self.dev.warm(u.house, u.g, u.cold, p)-u.T)/0.3 for u in R]
                cols.append([s*x for s, x in zip(slope, d)]); pen.append(1)
        B = np.array([self.blocks(c) for c in cols]).T; sc = np.where(np.array(pen) > 0, 1.0, np.sqrt((B**2).mean(0)) + 1e-30)
        self.base_cache[q] = B/sc, np.array(pen, float); return self.base_cache[q]
    def left(self, q, s, extra=None, gls=True):
        """Residual of block signal s after baseline (and extra columns): (sigma, residual in blocks)."""
        B, pen = self.baseline(q)
        if extra is not None:
            e = np.atleast_2d(extra.T).T; e = e/(np.sqrt((e**2).mean(0))+1e-300); B = np.hstack([B, e]); pen = np.r_[pen, np.zeros(e.shape[1])]
        W, y = self.whiten(q, B), self.whiten(q, s); W, y = np.vstack([W, np.diag(pen)]), np.r_[y, np.zeros(len(pen))]
        c = np.linalg.norm(W, axis=0) + 1e-300; beta = np.linalg.lstsq(W/c, y, rcond=1e-11)[0]/c
        return float(np.linalg.norm(y - W @ beta)), s - B @ beta
    def noise_after(self, q):
        if ("n", q) not in self.base_cache:
            r = np.random.default_rng(5); acc = []
            for _ in range(6):
                e = np.concatenate([L @ r.normal(0, 1, len(L)) for L in self.white_matrix(q)]); acc.append(np.mean(self.left(q, e)[1]**2))
            self.base_cache["n", q] = np.sqrt(np.mean(acc))
        return self.base_cache["n", q]
    def snr(self, q, s): return float(np.sqrt(np.mean(self.left(q, s)[1]**2))/self.noise_after(q))
    # -------- templates of every listed name, own reading: for accepting rivals and as an ideal detector
    def families(self, q):
        if ("fam", q) in self.base_cache: return self.base_cache["fam", q]
        R, F = self.runs, {}; T = [u.T for u in R]; H = [u.house for u in R]; x = [(v-20)/30 for v in T]
        slope = [(self.dev.answer(v+.05)[q]-self.dev.answer(v-.05)[q])/.1 for v in T]; B = lambda c: self.blocks(c)
        add = lambda name, *cols: F.setdefault(name, []).append(np.array([B(c) for c in cols]).T)
        dT = [np.gradient(v, u.g) for v, u in zip(T, R)]; tc = [u.t+u.when for u in R]; tot = max(v[-1] for v in tc)
        lags = lambda s, V: [lag(v, u.g, s) for v, u in zip(V, R)]
        for w in (0.3, 1, 2, 4, 8): 
            for m in (-1, 1, 0): add("hysteresis", [play(v[::k], w, v[0]+m*w).repeat(k)[:len(v)]-v for v, k in zip(T, [max(1, int(20/u.g)) for u in R])])
        for s in (600, 5e3, 5e4, 5e5):
            add("ageing", [np.log1p(v/s) for v in tc]); add("ageing", [1-np.exp(-v/s) for v in tc]); add("ageing", [np.log1p(u.t/s) for u in R])
        add("ageing", tc); edge = [(k, a) for k, u in enumerate(R) for a in np.linspace(0.01, 0.99, 60)*u.t[-1]]
        for k, a in edge: add("jump", [(j == k)*(u.t > a)*1.0 for j, u in enumerate(R)], [(j == k)*(u.t > a)*np.exp(-(u.t-a).clip(0)/self.dev.tau) for j, u in enumerate(R)])
        per = np.geomspace(200, tot, 400) if tot < 1e6 else np.geomspace(3e3, tot, 400)
        for p in list(per)+[86400., 43200.]: add("periodic", *[[f(2*np.pi*v/p) for v in tc] for f in (np.sin, np.cos)])
        if q == "frequency_Hz":
            for s in (20, 60, 150, 400, 1000, 3000, 8000, 20000, 60000): add("second-lag", [a*(l-v) for a, l, v in zip(slope, lags(s, H), T)])
            add("rate-frequency", dT); add("clock-drift", tc); add("thermometer-lag", dT); add("thermometer-lag", [a*(h-v) for a, h, v in zip(slope, H, T)])
            add("curvature", *[[v**p for v in x] for p in (3, 4, 5, 6)])
            sens = [[self.dev.warm((h-20)**p/30**p, u.g) if isinstance(self.dev, Plain) else lag(lag((h-20)**p/30**p, u.g, 1400.), u.g, 900.)
                     for h, u in zip(H, R)] for p in (2, 3, 4)]
            add("thermometer-scale", *[[a*v for a, v in zip(slope, c)] for c in sens])
            for k in range(1, len(R)): add("thermometer-scale", [(j >= k)*v for j, v in enumerate(x)], [(j >= k)*1.0+0*v for j, v in enumerate(x)])
            if isinstance(self.dev, Plain): add("radiation", [a*v for a, v in zip(slope, [radiated(self.dev.tau, u, 0.3)-lag(u.house, u.g, self.dev.tau, u.cold) for u in R])])
            for Td in np.linspace(min(v.min() for v in T)+1, max(v.max() for v in T)-1, 40):
                for w in (0.3, 0.8, 2): add("activity-dip", [(v-Td)/w/(1+((v-Td)/w)**2) for v in T])
            if "drive_amplitude_V" in R[0].drive:
                A2 = [u.drive["drive_amplitude_V"]**2 for u in R]; add("amplitude-frequency", A2); add("self-heating", [lag(v, u.g, self.dev.tau) for v, u in zip(A2, R)])
            if "electrode_bias_V" in R[0].drive: add("electrostatic-softening", [u.drive["electrode_bias_V"]**2 for u in R])
        if q in ("frequency_Hz", "bias_deg_per_h"):
            for s in (600, 2000, 6000, 20000, 60000, 200000): add("mounting-stress", [v-l for v, l in zip(T, lags(s, T))], [h-v for v, h in zip(T, H)] if q == "frequency_Hz" else [v-l for v, l in zip(T, lags(s/3, T))])
            for k in range(len(R)): add("clock-offset", [(j == k)*v for j, v in enumerate(dT)])
        if q == "bias_deg_per_h":
            add("rate-bias", dT, [a*b for a, b in zip(dT, x)]); add("cross-damping", *[[v**p for v in x] for p in (4, 5, 6, 7)])
            if "quadrature_V" in R[0].drive: add("quadrature-leakage", [u.drive["quadrature_V"] for u in R], [u.drive["quadrature_V"]*v for u, v in zip(R, x)])
            if "pattern_angle_deg" in R[0].drive:
                an = [np.radians(4*u.drive["pattern_angle_deg"]) for u in R]
                add("axis-rotation", *[[f(a)*v**p for a, v in zip(an, x)] for p in (0, 1) for f in (np.sin, np.cos)])
        if q == "inverse_q":
            add("leak", tc); add("leak", [v**.5 for v in tc])
            for Tp in np.linspace(-40, 80, 13):
                for w in (5, 10, 20, 40): add("loss-peak", [1/np.cosh((v-Tp)/w) for v in T])
        self.base_cache["fam", q] = F; return F
    def best(self, q, s):
        """name -> least sigma left by that name beside the baseline, and the residual's rms share."""
        full = np.sqrt(np.mean(self.left(q, s)[1]**2)); out = {}
        for name, cands in self.families(q).items():
            out[name] = min(((lambda z: (z[0], np.sqrt(np.mean(z[1]**2))/full))(self.left(q, s, c)) for c in cands), key=lambda z: z[0])
        return out
def radiated(tau, u, share):
    """One node behind the housing, `share` of the exchange at 20 °C radiated (T⁴), the rest conducted."""
    H = u.house+273.15; T = H[0] if u.cold is None else u.cold+273.15; T0 = 293.15; out = np.empty(len(H)); m = 1
    rate = lambda h, x: ((1-share)*(h-x) + share*(h**4-x**4)/(4*T0**3))/tau
    for i in range(len(H)): out[i] = T; h2 = H[min(i+1, len(H)-1)]; k1 = rate(H[i], T); T = T + u.g/2*(k1 + rate(h2, T+u.g*k1))
    return out-273.15
def preisach(T, r, width):
    """Relays with scattered thresholds: loop of a bond of many small patches."""
    c = r.normal(0, 15, 60)+np.mean(T[0]); h = width*np.exp(r.normal(0, .5, 60)); out = []; st = None
    for v in T:
        k = max(1, len(v)//4000); w = v[::k]; y = np.empty(len(w)); st = np.where(w[0] > c, 1.0, -1.0) if st is None else st
        for i, a in enumerate(w): st = np.where(a > c+h, 1.0, np.where(a < c-h, -1.0, st)); y[i] = st.mean()
        out.append(y.repeat(k)[:len(v)])
    return out
def effect(name, q, C, r):
    R, dev = C.runs, C.dev; T = [u.T for u in R]; H = [u.house for u in R]; tc = [u.t+u.when for u in R]
    slope = [(dev.answer(v+.05)[q]-dev.answer(v-.05)[q])/.1 for v in T]; sg = r.choice([-1, 1]); lo, hi = C.range
    if name == "second-lag" and isinstance(dev, Plain) and r.random() < .5: return [a*(dev.chain(h, u.g, u.cold, .05)-v) for a, h, v, u in zip(slope, H, T, R)]
    if name == "second-lag": s = dev.tau*r.choice([.12, .2, 4, 7]); return [a*(lag(h, u.g, s)-v) for a, h, v, u in zip(slope, H, T, R)]
    if name == "rate-bias": c = .4*r.normal(); return [sg*np.gradient(v, u.g)*(1+c*(v-20)/50) for v, u in zip(T, R)]
    if name == "rate-frequency": return [sg*np.gradient(v, u.g) for v, u in zip(T, R)]
    if name == "hysteresis": return [sg*v for v in preisach(T, r, r.uniform(.05, .15)*(hi-lo))]
    if name == "ageing": s = r.uniform(2e3, 2e4) if R[0].dt < 10 else r.uniform(1e4, 1e5); return [sg*np.log1p(v/s) for v in tc]
    if name == "jump":
        k = r.integers(len(R)); a = R[k].t[-1]*r.uniform(.2, .8); return [sg*(1.0*(u.t > a) if j == k else (j > k)+0*u.t) for j, u in enumerate(R)]
    if name == "activity-dip":
        Td, w = r.uniform(lo+.2*(hi-lo), hi-.2*(hi-lo)), r.uniform(.4, 1.8); z = [(v-Td)/w for v in T]
        return [sg*v/(1+v*v) for v in z] if q == "frequency_Hz" else [1/(1+v*v) for v in z]
    if name == "electrostatic-softening": return [-u.drive["electrode_bias_V"]**2 for u in R]
    if name == "amplitude-frequency": return [sg*u.drive["drive_amplitude_V"]**2 for u in R]
    if name == "self-heating":
        P = [u.drive["drive_amplitude_V"]**2 for u in R]; return [a*(.85*lag(v, u.g, dev.tau)+.15*lag(v, u.g, 30.)) for a, v, u in zip(slope, P, R)]
    if name == "curvature": m, w = r.uniform(lo+.3*(hi-lo), hi-.3*(hi-lo)), .3*(hi-lo); return [sg*np.tanh((v-m)/w) for v in T]
    if name == "cross-damping": m, w = r.uniform(lo+.35*(hi-lo), hi-.35*(hi-lo)), .22*(hi-lo); return [sg*np.tanh((v-m)/w) for v in T]
    if name == "periodic":
        span = min(len(u.t)*u.g for u in R); P = span/r.uniform(5, 14); return [np.sin(2*np.pi*v/P+1)+.3*np.sin(4*np.pi*v/P) for v in tc]
    if name == "clock-drift": return [sg*v for v in tc]
    if name == "thermometer-scale": 
        p, m = r.choice([2, 3]), (lo+hi)/2; C.scale_error = e = [((h-m)/20)**p for h in H]
        return [a*dev.warm(v, u.g) if isinstance(dev, Plain) else a*lag(lag(v, u.g, 1400.), u.g, 900.) for a, v, u in zip(slope, e, R)]
    if name == "mounting-stress": s = dev.tau*r.uniform(5, 15); return [sg*(v-lag(v, u.g, s)) for v, u in zip(T, R)]
    if name == "quadrature-leakage": return [sg*u.drive["quadrature_V"]*(1+.03*(v-20)/10) for v, u in zip(T, R)]
    if name == "axis-rotation":
        a = r.uniform(2, 5); return [np.sin(np.radians(4*(u.drive["pattern_angle_deg"]-a*(v-20)/10))) for v, u in zip(T, R)]
    if name == "loss-peak":
        Tp, E = r.uniform(lo+.25*(hi-lo), hi-.25*(hi-lo))+273.15, r.uniform(.25, .7); lt = [E/8.617e-5*(1/(v+273.15)-1/Tp) for v in T]; return [1/np.cosh(v) for v in lt]
    if name == "radiation": return [a*(radiated(dev.tau, u, .3)-radiated(dev.tau, u, 0.)) for a, u in zip(slope, R)]
    if name == "leak": return [v*np.sqrt((x+273.15)/293.15)/86400 for v, x in zip(tc, T)]
    # ---- causes on no list
    if name == "telegraph contact":
        out = []
        for u in R:
            e = np.cumsum(r.exponential(u.t[-1]/9, 60)); out.append(1.0*(np.searchsorted(e, u.t) % 2))
        return out
    if name == "irregular pulses of a crane":
        out = []
        for u in R:
            y = 0*u.t
            for a in r.uniform(.03, .95, 7)*u.t[-1]: y += np.exp(-.5*((u.t-a)/(u.t[-1]*.012))**2)*r.uniform(.6, 1.4)
            out.append(y)
        return out
    if name == "chirp of two clocks": return [np.sin(2*np.pi*(3*(u.t/u.t[-1])+r.uniform(5, 9)*(u.t/u.t[-1])**2+.37*j)) for j, u in enumerate(R)]
    if name == "neighbour's heat":
        out = []
        for u, a in zip(R, slope):
            e = np.cumsum(r.exponential(u.t[-1]/10, 60)); out.append(a*lag(1.0*(np.searchsorted(e, u.t) % 2), u.g, 0.4*dev.tau))
        return out
    if name == "battery sawtooth":
        out = []
        for u in R:
            e = np.r_[0, np.cumsum(u.t[-1]*r.uniform(.05, .25, 40))]; i = np.searchsorted(e, u.t, "right")-1; out.append((u.t-e[i])/(.15*u.t[-1]))
        return out
    raise KeyError(name)
NEED = {"electrostatic-softening": "electrode_bias_V", "amplitude-frequency": "drive_amplitude_V", "self-heating": "drive_amplitude_V",
        "quadrature-leakage": "quadrature_V", "axis-rotation": "pattern_angle_deg"}
WHERE = {"second-lag": "frequency_Hz", "rate-bias": "bias_deg_per_h", "rate-frequency": "frequency_Hz", "hysteresis": "any", "ageing": "any", "jump": "any",
         "activity-dip": "frequency_Hz", "electrostatic-softening": "frequency_Hz", "amplitude-frequency": "frequency_Hz", "self-heating": "frequency_Hz",
         "curvature": "frequency_Hz", "cross-damping": "bias_deg_per_h", "periodic": "any", "clock-drift": "frequency_Hz", "thermometer-scale": "frequency_Hz",
         "mounting-stress": "frequency_Hz", "quadrature-leakage": "bias_deg_per_h", "axis-rotation": "bias_deg_per_h", "loss-peak": "inverse_q", "leak": "inverse_q", "radiation": "frequency_Hz"}
ALIENS = ["telegraph contact", "irregular pulses of a crane", "chirp of two clocks", "neighbour's heat", "battery sawtooth"]
TIMED = {"ageing", "jump", "periodic", "clock-drift", "leak"}; SCENES = ["bench", "vibe", "screen", "storage", "ratetable"]
CYCLE = ["null", "effect", "alien", "effect", "pair", "effect", "effect", "null"]*3 + \
        ["effect", "alien", "null", "effect", "effect", "pair", "effect", "alien", "effect", "null", "effect", "inseparable"]*2
PAIRS = [("jump", "rate-bias"), ("second-lag", "periodic"), ("ageing", "quadrature-leakage"), ("loss-peak", "hysteresis"), ("electrostatic-softening", "jump"),
         ("activity-dip", "leak"), ("self-heating", "cross-damping"), ("amplitude-frequency", "periodic")]
THERMAL = {"second-lag", "self-heating", "radiation", "neighbour's heat"}
def drives(C, r, wanted):
    """Commanded voltages and azimuth: steps at times of their own; some stand there although nothing depends on them."""
    names = set(wanted)
    if r.random() < 0.4: names.add(str(r.choice(["drive_amplitude_V", "electrode_bias_V"])))
    levels = {"drive_amplitude_V": [.85, 1.0, 1.1, 1.2], "electrode_bias_V": [80., 100., 110., 120.], "pattern_angle_deg": [0., 11., 22.5, 34.]}
    for u in C.runs:
        u.drive = {}
        for n in sorted(names):
            e = np.cumsum(r.uniform(.06, .2, 30))*u.t[-1]; i = np.searchsorted(e, u.t)
            u.drive[n] = r.choice(levels[n], 31)[i] if n in levels else r.normal(0, .25, 31)[i] + .5 + .004*(u.T-20)
def place(C, r, name, q, snr):
    """The signal scaled to its SNR, what it means, its significance; None where it cannot be there."""
    state = r.bit_generator.state; s = effect(name, q, C, r); s0 = C.snr(q, C.blocks(s)); k = snr/s0; share = 0.0
    if name == "radiation":
        share = .3*k
        if not .02 < share < .9: return None
        slope = [(C.dev.answer(u.T+.05)[q]-C.dev.answer(u.T-.05)[q])/.1 for u in C.runs]
        s, k = [a*(radiated(C.dev.tau, u, share)-radiated(C.dev.tau, u, 0.)) for a, u in zip(slope, C.runs)], 1.0
    s = [k*v for v in s]; b = C.blocks(s); span = np.ptp(C.blocks([u.T for u in C.runs]))
    if name in THERMAL and np.ptp(b)/(C.dev.f0 if isinstance(C.dev, Plain) else C.dev.f[0])/8e-5 > .5*span: return None
    return {"name": name, "q": q, "size": k, "state": state, "share": share, "signal": s, "snr": C.snr(q, b), "sigma": C.left(q, b)[0]}
def write(C, r, hidden, folder, start, files, label, only=None):
    """Rows as a logger writes them: stamps that jitter, holes, empty cells, outliers, rounding."""
    floor = {q: [] for q in C.resp}
    for k, u in enumerate(C.runs):
        ts = np.arange(u.n)*u.dt + (r.normal(0, .03*u.dt, u.n).clip(-.1*u.dt, .1*u.dt) if C.jitter else 0); ts = np.sort(ts - ts[0]); keep = np.ones(u.n, bool)
        for _ in range(C.holes): a = r.integers(u.n//10, u.n-u.n//8); keep[a:a+int(u.n*r.uniform(.005, .03))] = False
        u.ts = ts = ts[keep]; true = ts + r.normal(0, .01, len(ts)); at = lambda y: np.interp(true, u.t, y)
        T, house, add = u.T.copy(), u.house.copy(), {q: 0*u.t for q in C.resp}
        for h in hidden:
            s, q = h["signal"][k], h["q"]
            if h["name"] in THERMAL: T = T + s/((C.dev.answer(u.T+.05)[q]-C.dev.answer(u.T-.05)[q])/.1)
            elif h["name"] == "thermometer-scale": house = house - h["size"]*C.scale_error[k]
            else: add[q] = add[q] + s
        if isinstance(C.dev, Card): house = lag(house, u.g, C.dev.p["sensor_s"])
        ans = C.dev.answer(T); cols = {"time_s": np.round(ts, 3)}
        cols["housing_temperature_degC"] = np.round((at(house) + r.normal(0, C.mK, len(ts)))/C.res["T"])*C.res["T"]
        if C.chamber: cols["chamber_temperature_degC"] = np.round(at(u.air) + r.normal(0, .03, len(ts)), 2)
        for q in C.resp:
            e = C.noise(q, u, r); floor[q].append(e-e.mean()); y = at(ans[q]+add[q]); clean = y.copy(); y = y + e
            if C.outliers: y = y + (r.random(len(ts)) < 5e-4)*r.choice([-1, 1], len(ts))*r.uniform(10, 30, len(ts))*C.white[q]
            y = np.round(y/C.res[q])*C.res[q]; y[r.random(len(ts)) < C.empty] = np.nan; cols[q] = y
            if label == "unseen": cols["clean "+q] = clean
        for n, v in u.drive.items(): cols[n] = v[np.minimum((ts/u.g+.5).astype(int), len(v)-1)].round(3)
        name = f"{label}_{k+1}.csv" if label == "run" else f"{label}.csv"
        head = f"# instrument: {C.scene}-device\n" + (f"# start: {np.datetime_as_string(start+np.timedelta64(int(u.when), 's'))}\n" if C.dated else "")
        if C.tell: head += "".join(f"# resolution {q}: {C.res[q]:.3g}\n" for q in C.resp)
        clean = {n: v for n, v in cols.items() if n.startswith("clean ")}; cols = {n: v for n, v in cols.items() if n not in clean}
        with open(os.path.join(folder, name), "w") as f:
            f.write(head + ",".join(cols) + "\n"); fm = ["%.3f", "%.4f"] + ["%.12g"]*(len(cols)-2)
            for row in zip(*cols.values()): f.write(",".join("" if np.isnan(v) else m % v for m, v in zip(fm, row)) + "\n")
        if clean: np.savetxt(os.path.join(folder, "unseen_truth.txt"), np.c_[ts, np.array(list(clean.values())).T], header="time_s "+" ".join(C.resp), fmt="%.12g")
        files.append(name)
    return {q: float(np.hypot(np.sqrt(np.mean(np.concatenate(v)**2)), C.through if q == "frequency_Hz" else 0)) for q, v in floor.items()}
def campaign(seed, kind, number, turn, OUT):
    """Draw until the truth is fair."""
    for attempt in range(40):
        r = np.random.default_rng([seed, number, attempt]); card = turn["card"]; wish = turn["names"]; snr = turn["snr"]
        scene = str(r.choice([s for s in SCENES if not (card and s == "screen") and not (kind == "inseparable" and s not in ("bench", "storage"))]))
        dev = Card(r) if card else Plain(r); where = []
        for n in wish: where.append(WHERE[n] if WHERE.get(n, "any") != "any" else str(r.choice(["frequency_Hz", "bias_deg_per_h", "frequency_Hz", "inverse_q"][:3 if n in ALIENS or n == "hysteresis" else 4])))
        if "neighbour's heat" in wish: where = ["frequency_Hz"]
        resp = ["frequency_Hz"] + [q for q, p in (("bias_deg_per_h", .75), ("inverse_q", .45)) if q in where or r.random() < p]
        C = Campaign(r, scene, dev, int(r.integers(2, 5)) if scene != "storage" else int(r.integers(2, 4)), resp)
        drives(C, r, [NEED[n] for n in wish if n in NEED]); hidden = []
        for n, q in zip(wish, where):
            h = place(C, r, n, q, snr); hidden.append(h)
        if any(h is None or h["sigma"] < 6.5 for h in hidden): continue
        ok = True
        for h in hidden:
            b = C.best(h["q"], C.blocks(h["signal"])); h["rivals"] = {n: [round(float(v[0]), 2), round(float(v[1]), 3)] for n, v in b.items()}
            h["accept"] = [] if kind == "alien" else [h["name"]] + [n for n, v in b.items() if v[0] < 3.5 and n != h["name"]]
            if kind == "alien" and min(v[1] for v in b.values()) < .45: ok = False
            if kind == "inseparable" and len(h["accept"]) < 2: ok = False
        if not ok: continue
        C.jitter, C.holes, C.empty = r.random() < .5, int(r.integers(0, 3)), float(r.choice([0, 0, .01])); C.outliers = r.random() < .33
        C.chamber = not card and r.random() < .25; C.res = {"T": C.res_T, **{q: float(f"{C.white[q]*r.uniform(.1, .8):.1g}") for q in resp}}
        C.dated = r.random() < .5 or any(h["name"] in TIMED for h in hidden); C.tell = r.random() < .5
        ident = f"f{number:03d}"; folder = os.path.join(OUT, "cases", ident); os.makedirs(folder); files = []; start = np.datetime64("2024-03-04T08:00:00")
        floor = write(C, r, hidden, folder, start, files, "run")
        if card: open(os.path.join(folder, "card.toml"), "w").write(CARD)
        unseen = turn["unseen"] and not any(h["name"] in TIMED or kind == "alien" for h in hidden)
        if unseen: unseen_run(C, r, hidden, folder, start, scene, dev)
        many = any(len(h["accept"]) > 1 for h in hidden)
        verdicts = {"null": ["adequate"], "alien": ["unexplained"], "inseparable": ["not-identifiable"]}.get(kind) or (
            ["explained", "not-identifiable"] if many or snr < 3 else ["explained"])
        return {"id": ident, "kind": "effect" if kind == "inseparable" else kind, "hidden": [{"effect": h["name"], "accept": h["accept"], "snr": round(h["snr"], 2),
                "response": h["q"], "sigma": round(h["sigma"], 1), "size": float(h["size"]), "rivals": h["rivals"]} for h in hidden], "verdicts": verdicts,
                "tolerated": sorted({n for h in hidden for n in h["accept"][1:]}), "card": card, "noise_floor_rms": floor, "inseparable": kind == "inseparable",
                "files": [f"cases/{ident}/{n}" for n in files] + ([f"cases/{ident}/card.toml"] if card else []), "scene": scene, "unseen": unseen,
                "device": vars(dev), "attempt": attempt}
    raise SystemExit(f"no fair campaign for {kind} {turn}")
CARD = """schema = "hrg.card/1"\nname = "hand-f"\nreference_temperature_degC = 20.0
[resonator]\nshape = "hemisphere"\nradius_mm = 15.0\nthickness_mm = 0.8558278\nsupport = "stem"
stem = { radius_mm = 2.5, end_mm = -5.0, side = "inner", fillet_mm = 0.5 }
[material]\nname = "fused-silica"\n[thermal]\nmount_conductance_W_per_K = 0.01181\n"""
def unseen_run(C, r, hidden, folder, start, scene, dev):
    """Another run later, in another course; the same causes with the same parameters."""
    old, n = C.runs, len(C.runs); u = Run(); u.dt, u.n, u.g, u.t, u.air, u.house = course(scene, r, n+1, {"case_s": 150.0})
    u.when = old[-1].when + len(old[-1].t)*old[-1].g + 86400.; u.cold = u.air[0] if scene in ("vibe", "ratetable") else None; u.T = dev.warm(u.house, u.g, u.cold)
    keep = {m: old[0].drive[m] for m in old[0].drive}; u.drive = {m: np.resize(v, len(u.t)) for m, v in keep.items()}; C.runs = old + [u]; both = []
    for h in hidden:
        r2 = np.random.default_rng(); r2.bit_generator.state = h["state"]; y = effect(h["name"], h["q"], C, r2)[-1]*h["size"]
        if h["name"] == "radiation": y = (C.dev.answer(u.T+.05)[h["q"]]-C.dev.answer(u.T-.05)[h["q"]])/.1*(radiated(dev.tau, u, h["share"])-radiated(dev.tau, u, 0.))
        both.append(dict(h, signal=[y]))
    C.runs = [u]; C.scale_error = C.scale_error[-1:]; write(C, r, both, folder, start, [], "unseen"); C.runs = old
def main():
    a = argparse.ArgumentParser(); a.add_argument("out"); a.add_argument("--count", type=int, default=48); a.add_argument("--seed", type=int, default=1)
    o = a.parse_args(); shutil.rmtree(os.path.join(o.out, "cases"), ignore_errors=True); os.makedirs(os.path.join(o.out, "cases"))
    r = np.random.default_rng(o.seed); names = list(WHERE); singles, pairs, aliens, truth = [], [], [], []
    for i in range(o.count):
        kind = CYCLE[i % len(CYCLE)]; snr = [1, 2, 3, 6][int(r.integers(4))]; wish = []
        if kind == "effect":
            if not singles: singles = [names[j] for j in r.permutation(len(names))]
            wish = [singles.pop()]
        if kind == "pair": pairs = pairs or [PAIRS[j] for j in r.permutation(len(PAIRS))]; wish = list(pairs.pop()); snr = max(snr, 2)
        if kind == "alien": aliens = aliens or [ALIENS[j] for j in r.permutation(len(ALIENS))]; wish = [aliens.pop()]; snr = max(snr, 2)
        if kind == "inseparable": wish = [["clock-drift", "thermometer-scale"][i//len(CYCLE) % 2 if i < 30 else (i+1) % 2]]; snr = max(snr, 2)
        card = bool(r.random() < .33) and kind != "inseparable" and not {"radiation", "axis-rotation"} & set(wish)
        truth.append(campaign(o.seed, kind, i, {"card": card, "names": wish, "snr": snr, "unseen": i % 2 == 0}, o.out))
        t = truth[-1]; print(t["id"], kind, wish, t["scene"], "card" if t["card"] else "", [(h["snr"], h["sigma"], h["accept"]) for h in t["hidden"]], t["attempt"], flush=True)
        json.dump(truth, open(os.path.join(o.out, "truth.json"), "w"), indent=1, default=lambda v: np.asarray(v).tolist())
if __name__ == "__main__": main()
