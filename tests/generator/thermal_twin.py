"""A virtual gyro's heat: a chain of nodes stepped by the implicit trapezoidal rule, written apart from the library."""

from dataclasses import dataclass

import numpy as np

STEP = 5.0
NODES = 4


@dataclass(frozen=True)
class Heat:
    """What the thermal twin is made of.

    `contact` is the main time constant (s) from housing to resonator, `spread` the diffusion time through the chain,
    `side` = (share, time constant) of a second path, `radiated` the radiated share, `heating` K per unit power.
    """

    contact: float
    spread: float = 6.0
    side: tuple[float, float] | None = None
    radiated: float = 0.0
    heating: float = 0.0


def chamber_to_housing(chamber, constant, start):
    """Backward Euler of the housing behind the chamber air."""
    out = np.empty_like(chamber)
    state = start
    ratio = STEP / constant
    for k, value in enumerate(chamber.tolist()):
        state = (state + ratio * value) / (1.0 + ratio)
        out[k] = state
    return out


def resonator(housing, heat, power=None, start_offset=0.0, reference=293.15):
    """Mean and spread (first minus last node) of the chain's temperature, °C."""
    n = NODES + (heat.side is not None)
    inner = NODES**2 / (2.0 * heat.spread)
    conduct = np.zeros((n, n))
    feed = np.zeros(n)
    share = heat.side[0] if heat.side else 0.0
    gain = NODES / heat.contact
    conduct[0, 0] -= gain * (1 - share)
    feed[0] += gain * (1 - share)
    for k in range(NODES - 1):
        conduct[k, k] -= inner
        conduct[k, k + 1] += inner
        conduct[k + 1, k] += inner
        conduct[k + 1, k + 1] -= inner
    if heat.side:
        conduct[NODES - 1, NODES - 1] -= gain * share
        conduct[NODES - 1, n - 1] += gain * share
        conduct[n - 1, n - 1] -= 1.0 / heat.side[1]
        feed[n - 1] += 1.0 / heat.side[1]
    source = np.zeros(n)
    source[0] = gain * heat.heating
    state = np.full(n, housing[0])
    state[:NODES] += start_offset
    power = np.zeros_like(housing) if power is None else power
    eye = np.eye(n)
    left = np.linalg.inv(eye - 0.5 * STEP * conduct)
    right = left @ (eye + 0.5 * STEP * conduct)
    push, warm = left @ feed * STEP, left @ source * STEP
    mean, tilt = np.empty_like(housing), np.empty_like(housing)
    cubic = gain * heat.radiated
    before_u, before_p = housing[0], power[0]
    for k in range(housing.size):
        u, p = housing[k], power[k]
        if k:
            extra = 0.0
            if cubic:
                a, b = 0.5 * (u + before_u) + 273.15, state[0] + 273.15
                extra = cubic * ((a**4 - b**4) / (4 * reference**3) - (a - b))
            state = right @ state + push * (0.5 * (u + before_u)) + warm * (0.5 * (p + before_p))
            if cubic:
                state += left[:, 0] * (STEP * extra)
        before_u, before_p = u, p
        mean[k] = state[:NODES].sum() / NODES
        tilt[k] = state[0] - state[NODES - 1]
    return mean, tilt


def follow(drive, constant):
    """Backward Euler of a first-order follower."""
    return chamber_to_housing(drive, constant, drive[0])


def preisach(temperature, half_width, rng, relays=1200):
    """Mean of relays with scattered half widths and centres, every 30 s: a smooth rate-independent loop, in K."""
    every = 6
    sampled = temperature[::every]
    low, high = sampled.min() - 3 * half_width, sampled.max() + 3 * half_width
    centre = np.linspace(low, high, relays)[rng.permutation(relays)]
    width = half_width * np.exp(0.12 * rng.standard_normal(relays))
    up, down = centre + width, centre - width
    state = np.where(sampled[0] > centre, 1.0, -1.0)
    out = np.empty_like(sampled)
    for k, value in enumerate(sampled):
        state[value > up] = 1.0
        state[value < down] = -1.0
        out[k] = state.mean()
    loop = out * 0.5 * (high - low)
    # relays switch one after the other; the mean of many is what a bond does
    from scipy.ndimage import gaussian_filter1d

    fine = np.interp(np.arange(temperature.size), np.arange(sampled.size) * every, gaussian_filter1d(loop, 3.0))
    return fine - (temperature - 0.5 * (high + low))
