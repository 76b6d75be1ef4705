"""Causes that no listed effect describes. Same form as the effects: shapes of unit size."""

import numpy as np

from tests.stranger.effects import Effect, Rng, Shape
from tests.stranger.network import STEP_S, lag
from tests.stranger.protocol import Run


def telegraph(runs: list[Run], rng: Rng) -> Shape:
    """Two states, random dwell times, at least six switches in all."""
    dwell = min(1800.0, sum(r.time[-1] for r in runs) / 12)
    out = []
    for r in runs:
        edges = np.cumsum(rng.exponential(dwell, 200) + 120)
        out.append((np.searchsorted(edges, r.time) % 2).astype(float))
    return out


def burst(runs: list[Run], rng: Rng) -> Shape:
    """Lorenz' attractor, let through in a few windows."""
    out = []
    for r in runs:
        x = rng.normal(0, 5, 3) + np.array([0, 0, 25])
        path = np.empty(len(r.time))
        for i in range(len(path)):
            for _ in range(4):
                x = x + 0.01 * np.array([10 * (x[1] - x[0]), x[0] * (28 - x[2]) - x[1], x[0] * x[1] - 8 / 3 * x[2]])
            path[i] = x[0] / 10
        gate = sum(
            np.exp(-(((r.time - rng.uniform(0.1, 0.9) * r.time[-1]) / rng.uniform(400, 1500)) ** 4)) for _ in range(3)
        )
        out.append(path * np.clip(gate, 0, 1))
    return out


def chirp(runs: list[Run], rng: Rng) -> Shape:
    """A tone whose period runs from an hour to two minutes within each run, whatever the temperature."""
    out = []
    for r in runs:
        u = r.time / r.time[-1]
        slow, fast = rng.uniform(1 / 4000, 1 / 2000), rng.uniform(1 / 400, 1 / 150)
        out.append(np.sin(2 * np.pi * r.time[-1] * (slow * u + (fast - slow) * u**2 / 2) + rng.uniform(0, 6)))
    return out


def mains_beat(runs: list[Run], rng: Rng) -> Shape:
    """Cross-talk with the mains: a beat that follows the wandering mains frequency, its envelope random."""
    out = []
    for r in runs:
        n = len(r.time)
        wander = lag(rng.normal(0, 1, n), 600.0) * np.sqrt(2 * 600 / STEP_S)
        envelope = np.clip(lag(rng.normal(0, 1, n), 1200.0) * np.sqrt(2 * 1200 / STEP_S) + 0.6, 0, None)
        out.append(envelope * np.sin(2 * np.pi * np.cumsum(0.0015 * (1 + 0.9 * wander)) * STEP_S))
    return out


def moisture(runs: list[Run], rng: Rng) -> Shape:
    """Water taken up fast and given off slowly, in damp spells at random times."""
    out = []
    for r in runs:
        damp = telegraph([r], rng)[0] * rng.uniform(0.6, 1.4)
        film, path = 0.0, np.empty(len(r.time))
        for i, wet in enumerate(damp):
            film += STEP_S * ((wet - film) / 250 if wet > film else (wet - film) / 900)
            path[i] = film**1.5
        out.append(path)
    return out


def popcorn(runs: list[Run], rng: Rng) -> Shape:
    """Pulses with a sharp front and a long tail, of random height and sign, at random times."""
    out = []
    for r in runs:
        hits = (
            (rng.random(len(r.time)) < STEP_S / 1800)
            * rng.exponential(1, len(r.time))
            * rng.choice([-1, 1], len(r.time))
        )
        out.append(lag(hits, 150.0) * 15)
    return out


ALIENS = {
    "telegraph": Effect("telegraph", ("frequency", "bias"), telegraph),
    "burst": Effect("burst", ("bias",), burst),
    "chirp": Effect("chirp", ("frequency", "bias"), chirp),
    "mains-beat": Effect("mains-beat", ("bias",), mains_beat),
    "moisture": Effect("moisture", ("frequency",), moisture),
    "popcorn": Effect("popcorn", ("bias", "frequency"), popcorn),
}
