"""Ring-downs of a two-mode resonator with known truth, well-specified or not, written from the physics alone.

In a frame that turns at the reference frequency the complex amplitudes a = (a_c, a_s) at the two pick-offs obey

    da/dt = [-G + i (W - w_ref)] a + i k (2 |a|^2 a + (a.a) a*) / 3
    W = w + (dw/2) R(2 n th_w),  G = g + (dg/2) R(2 n th_g),  R(x) = [[cos x, sin x], [sin x, -cos x]],  g = pi f / Q

the averaged equations of x'' + D x' + K x + c |x|^2 x = 0: a straight line of vibration of amplitude A is shifted by k A^2.
This file reads nothing of the program; `tests/benchmarks/ringdowns.py` of 425c9816 asked the program about thousands of them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

Array = np.ndarray
WELL = ("target", "clean")
SPOILT = ("cubic", "plateau", "crosstalk", "hum", "clipping", "drift", "lost")
N = 2  # circumferential harmonic


@dataclass
class Decay:
    kind: str
    columns: dict[str, Array]
    comments: dict[str, str]
    truth: dict[str, float]
    bound: dict[str, float] = field(default_factory=dict)  # Cramer-Rao standard deviation, well-specified kinds only
    story: dict[str, float | str] = field(default_factory=dict)

    def write(self, path: Path) -> Path:
        keys = list(self.columns)
        rows = np.column_stack([self.columns[k] for k in keys])
        head = "".join(f"# {k}: {v}\n" for k, v in self.comments.items())
        lines = [
            ",".join("" if np.isnan(v) else f"{v:.9g}" if k else f"{v:.10f}" for k, v in enumerate(row)) for row in rows
        ]
        path.write_text(head + ",".join(keys) + "\n" + "\n".join(lines) + "\n")
        return path


def tensor(mean: float, difference: float, axis_deg: float) -> Array:
    """Mean and principal difference of a symmetric 2 x 2 matrix whose larger principal axis points to an azimuth."""
    angle = np.radians(2 * N * axis_deg)
    turn = np.array([[np.cos(angle), np.sin(angle)], [np.sin(angle), -np.cos(angle)]])
    return mean * np.eye(2) + difference / 2 * turn


def swing(p: Array, reference: float, t: Array, cubic: float = 0.0, wander: Array | None = None) -> Array:
    """Noiseless complex amplitudes (time, 2) for p = (f, df c, df s, g, dg c, dg s, Re a, Im a); Hz and 1/s."""
    w = 2 * np.pi * np.array([[p[0] - reference + p[1] / 2, p[2] / 2], [p[2] / 2, p[0] - reference - p[1] / 2]])
    g = np.array([[p[3] + p[4] / 2, p[5] / 2], [p[5] / 2, p[3] - p[4] / 2]])
    a0 = np.array([p[6] + 1j * p[8], p[7] + 1j * p[9]])
    matrix = -g + 1j * w
    if not cubic:
        values, vectors = np.linalg.eig(matrix)
        a = (np.exp(np.outer(t - t[0], values)) * np.linalg.solve(vectors, a0)) @ vectors.T
    else:

        def law(_: float, a: Array) -> Array:
            return matrix @ a + 1j * cubic * (2 * np.vdot(a, a).real * a + (a @ a) * a.conj()) / 3

        sol = solve_ivp(law, (t[0], t[-1]), a0, "DOP853", rtol=1e-10, atol=1e-12, dense_output=True)
        a = np.asarray(sol.sol(t)).T
    if wander is not None:  # common drift of both frequencies, Hz at each time
        phase = np.concatenate([[0.0], np.cumsum(np.diff(t) * (wander[1:] + wander[:-1]) / 2)])
        a = a * np.exp(2j * np.pi * phase)[:, None]
    return a


def values_of(p: Array) -> dict[str, float]:
    """What a maker asks for: split, eigenfrequencies, Q of each, axes of the lower frequency and of the lesser damping."""
    difference, spread = np.hypot(p[1], p[2]), np.hypot(p[4], p[5])
    w, g = tensor_of(p[0], p[1], p[2]), tensor_of(p[3], p[4], p[5])
    roots = np.linalg.eigvals(-g + 2j * np.pi * (w - p[0] * np.eye(2)))
    roots = roots[np.argsort(roots.imag)]
    f, rate = p[0] + roots.imag / (2 * np.pi), -roots.real
    return {
        "split_Hz": float(difference), "eigen_split_Hz": float(f[1] - f[0]), "mean_Hz": float(p[0]), "f1_Hz": float(f[0]), "f2_Hz": float(f[1]),
        "principal_f1_Hz": float(p[0] - difference / 2), "principal_f2_Hz": float(p[0] + difference / 2),
        "q1": float(np.pi * f[0] / rate[0]), "q2": float(np.pi * f[1] / rate[1]), "mean_q": float(np.pi * p[0] / p[3]),
        "inverse_q": float(p[3] / np.pi / p[0]), "inverse_q_high": float((p[3] + spread / 2) / np.pi / p[0]), "inverse_q_low": float((p[3] - spread / 2) / np.pi / p[0]),
        "stiff_axis_deg": float(np.degrees(np.arctan2(p[2], p[1])) / (2 * N)), "lossy_axis_deg": float(np.degrees(np.arctan2(p[5], p[4])) / (2 * N)),
    }  # fmt: skip


def tensor_of(mean: float, c: float, s: float) -> Array:
    return np.array([[mean + c / 2, s / 2], [s / 2, mean - c / 2]])


def cramer_rao(p: Array, reference: float, t: Array, noise: float) -> dict[str, float]:
    """Standard deviations of the values from F = J^T J / noise^2, derivatives by central differences."""
    scale = np.array([1 / (t[-1] - t[0])] * 3 + [p[3]] * 3 + [np.abs(p[6:]).max()] * 4) * 1e-4

    def signal(q: Array) -> Array:
        a = swing(q, reference, t).ravel()
        return np.concatenate([a.real, a.imag])

    steps = [np.eye(10)[k] * scale[k] for k in range(10)]
    jac = np.column_stack([(signal(p + e) - signal(p - e)) / (2 * s) for e, s in zip(steps, scale, strict=True)])
    covariance = np.linalg.inv(jac.T @ jac / noise**2)
    out = {}
    for name in values_of(p):
        slope = np.array(
            [(values_of(p + e)[name] - values_of(p - e)[name]) / (2 * s) for e, s in zip(steps, scale, strict=True)]
        )
        out[name] = float(np.sqrt(slope @ covariance @ slope))
    return out


def make(kind: str, seed: int, index: int) -> Decay:
    """One decay; the same (kind, seed, index) gives the same bytes."""
    rng = np.random.default_rng([seed, index, (*WELL, *SPOILT).index(kind)])
    raw = kind != "target" and rng.random() < (0.5 if kind == "clipping" else 0.2)
    if kind == "target":
        f, q, split_hz, spread = 7000.0 + rng.uniform(-50, 50), 1e7, 0.020, rng.uniform(0.02, 0.15)
    else:
        f = rng.uniform(400, 1500) if raw else rng.uniform(3e3, 1e4)
        q = np.exp(rng.uniform(*np.log((3e3, 2e4) if raw else (3e5, 2e7))))
        split_hz, spread = f / q * np.exp(rng.uniform(np.log(0.7), np.log(30))), rng.uniform(0.01, 0.2)
    g = np.pi * f / q
    th_w, th_g = rng.uniform(0, 2 * np.pi, 2)
    line = rng.uniform(0.15, 1.4) + np.pi / 2 * rng.integers(0, 4)  # pattern away from either pick-off, small ellipse
    a0 = (
        np.array([np.cos(line), np.sin(line)])
        * np.exp(1j * rng.uniform(0, 6.28))
        * (1 + 1j * rng.uniform(-0.1, 0.1, 2))
    )
    p = np.array([f, split_hz * np.cos(th_w), split_hz * np.sin(th_w), g, 2 * spread * g * np.cos(th_g), 2 * spread * g * np.sin(th_g),
                  *a0.real, *a0.imag])  # fmt: skip
    reference = f + rng.uniform(-3, 3) * f / q if not raw else f
    span = rng.uniform(1.5, 5) / g
    if raw:
        rate = f * rng.uniform(3.3, 6)
        t = np.arange(int(min(span * rate, 60_000))) / rate
    else:
        t = np.linspace(0, span, int(max(600, 8 * span * max(split_hz, f / q))))
    noise = np.exp(rng.uniform(np.log(1e-4), np.log(1e-2)))
    story: dict[str, float | str] = {"raw": float(raw), "noise": noise, "tau_s": 1 / g, "span_tau": span * g}
    cubic, wander, release = 0.0, None, 0.0
    if kind == "cubic":
        story["shift_widths"] = shift = np.exp(rng.uniform(np.log(0.1), np.log(20))) * rng.choice([-1, 1])
        cubic = float(2 * g * shift)
    if kind == "drift":
        story["drift_widths"] = size = np.exp(rng.uniform(np.log(0.1), np.log(20))) * rng.choice([-1, 1])
        u = t / t[-1]
        shape = {"line": u, "lag": 1 - np.exp(-4 * u), "wave": np.sin(2 * np.pi * u * rng.uniform(0.5, 3))}
        story["form"] = form = str(rng.choice(list(shape)))
        wander = shape[form] * size * f / q
        story["wander_low"], story["wander_high"] = float(wander.min()), float(wander.max())
    if kind == "plateau":
        release = story["release"] = float(rng.uniform(0.05, 0.35) * t[-1])
    free = t >= release
    a = np.empty((t.size, 2), complex)
    a[free] = swing(p, reference, t[free], cubic, None if wander is None else wander[free])
    if kind == "plateau":  # driven at one frequency near the modes until the release, then free from the state it has
        drive = f - reference + rng.normal() * f / q / 2
        a[~free] = a0 * np.exp(2j * np.pi * drive * (t[~free] - t[free][0]))[:, None]
    if kind == "crosstalk":  # the drive leaks into the pick-offs and stays
        story["level"] = level = float(np.exp(rng.uniform(np.log(0.003), np.log(0.1))))
        story["offset_widths"] = offset = rng.normal() * 3
        a = (
            a
            + level
            * np.exp(1j * rng.uniform(0, 6.28, 2))
            * np.exp(2j * np.pi * t * (f - reference + offset * f / q))[:, None]
        )
    if kind == "hum":  # two lines of the mains beside the modes, which beat with each other
        story["level"] = level = float(np.exp(rng.uniform(np.log(0.003), np.log(0.1))))
        step = np.median(np.diff(t))
        widest = min(0.4 / step, 40 * f / q)
        one = rng.uniform(2 * f / q, widest) * rng.choice([-1, 1])
        beat = rng.uniform(0.1, 3) * f / q
        tones = np.exp(2j * np.pi * t * one) + rng.uniform(0.2, 1) * np.exp(2j * np.pi * t * (one + beat))
        a = a + level * np.outer(tones, np.exp(1j * rng.uniform(0, 6.28, 2)))
        story["offset_widths"] = one / (f / q)
    if raw:
        x = (a * np.exp(2j * np.pi * reference * t)[:, None]).real + noise * rng.normal(size=a.shape)
    else:
        x = a + noise * (rng.normal(size=a.shape) + 1j * rng.normal(size=a.shape))
    if kind == "clipping":
        story["limit"] = limit = float(rng.uniform(0.4, 0.95))
        top = np.abs(x).max(axis=0) * limit
        if raw:
            x = np.clip(x, -top, top)
        else:  # fundamental of a clipped sine of amplitude A > limit: A (2/pi) (asin s + s sqrt(1 - s^2)), s = limit / A
            size = np.abs(x)
            s = np.minimum(1, top / np.maximum(size, 1e-12))
            x = x * (2 / np.pi) * (np.arcsin(s) + s * np.sqrt(1 - s**2))
    if kind == "lost":
        x, t, story["form"] = lose(x, t, rng)
    comments = {} if raw else {"reference_frequency_Hz": f"{reference:.9f}"}
    # a real sample of x = Re(a e^{iwt}) tells half of what a complex one tells at the same noise
    bound = cramer_rao(p, reference, t, noise * np.sqrt(2 if raw else 1)) if kind in WELL else {}
    return Decay(kind, columns_of(x, t, raw, rng), comments, values_of(p), bound, story)


def lose(x: Array, t: Array, rng: np.random.Generator) -> tuple[Array, Array, str]:
    """Two to eight blocks of samples lost: rows absent, cells empty, zeros, the last value held, or a clock that does not know."""
    form = str(rng.choice(["absent", "empty", "zero", "held", "unaware"]))
    gone = np.zeros(t.size, bool)
    for _ in range(rng.integers(2, 9)):
        start = int(rng.integers(5, t.size - 5))
        stop = start + int(max(2, t.size * rng.uniform(0.002, 0.06)))
        gone[start:stop] = True
        if form == "held":
            x[start:stop] = x[start - 1]
    if form == "absent":
        return x[~gone], t[~gone], form
    if form == "unaware":
        return x[~gone], t[: int((~gone).sum())], form
    x = x.copy()
    if form != "held":
        x[gone] = np.nan if form == "empty" else 0.0
    return x, t, form


def columns_of(x: Array, t: Array, raw: bool, rng: np.random.Generator) -> dict[str, Array]:
    """The columns of the file: raw volts, or one of the two outputs of a lock-in amplifier."""
    if raw:
        return {"time_s": t, "pickoff_cos_V": x[:, 0], "pickoff_sin_V": x[:, 1]}
    if rng.random() < 0.5:
        return {"time_s": t, "amplitude_cos_V": np.abs(x[:, 0]), "phase_cos_deg": np.degrees(np.angle(x[:, 0])),
                "amplitude_sin_V": np.abs(x[:, 1]), "phase_sin_deg": np.degrees(np.angle(x[:, 1]))}  # fmt: skip
    return {"time_s": t, "in_phase_cos_V": x[:, 0].real, "out_of_phase_cos_V": x[:, 0].imag,
            "in_phase_sin_V": x[:, 1].real, "out_of_phase_sin_V": x[:, 1].imag}  # fmt: skip
