"""Mounting stress: the bond strains the resonator's support and relaxes."""

import numpy as np

from compensation.arrays import Array
from studies.effects.effect import Coefficient, Effect, Parameter, Shape, Span
from studies.effects.states import States, lag


def columns(states: States, shape: Shape, response: str) -> Array:
    """Maxwell elements: stress ∝ T_r − lag(T_r; τ_s), a mismatch that relaxes with τ_s, a third and three times of it,
    from none in a resonator that is as warm as its housing.

    Beside it, in the frequency, what strains a joint between housing and resonator, s = T_h − T_r, the part of it that
    relaxes, s³, per (30 K)², of a joint that hardens, and u/√(1 + (u/k)²) − u of one that yields, k = 10 and 30 K, u = s and what
    is left of s when half of it has relaxed. In the bias s is the rate bias, behind one lag exactly.
    """
    rest = float(states.housing[0])
    strains = [lag(states.resonator, states.step, shape[0] * ratio, rest) for ratio in (1.0, 1.0 / 3.0, 3.0)]
    across = (states.housing - states.resonator) * (response == "frequency_Hz")
    relaxing = lag(across, states.step, shape[0])
    joint = [across, relaxing, across * (across / 30.0) ** 2]
    for held in (across, across - 0.5 * relaxing):
        joint += [held / np.sqrt(1.0 + (held / most) ** 2) - held for most in (10.0, 30.0)]
    return np.concatenate([states.resonator[:, None] - np.stack(strains, 1), np.stack(joint, 1)], axis=1)


def grid(span: Span, response: str) -> list[tuple[float, ...]]:
    """Relaxation times from half the thermal one (a shorter one would be the rate) to well beyond a run."""
    return [(float(tau),) for tau in np.geomspace(max(0.5 * span.tau, 600.0), max(4.0 * span.longest_run, 4000.0), 6)]


def steady(x: Array, shape: Shape) -> Array:
    """A bond that strains the mount on one side of a temperature only."""
    return np.maximum(x - shape[0], 0.0)[:, None]


EFFECT = Effect(
    name="mounting-stress",
    summary="thermal mismatch strains the mount and relaxes slowly; the frequency shifts at constant temperature",
    source="viscoelastic bond (Maxwell element) under thermal mismatch strain",
    isolate="soak for days after a large step and watch f against an independent thermometer on the resonator",
    sensor="a thermometer on the base or stem: a second lag would show there, a stress would not",
    coefficients=(
        Coefficient("stress_{unit}_per_K", (1.0, 0.2, 0.2)),
        Coefficient("joint_{unit}_per_K", (1.0, 0.5, 0.3, 0.5, 0.5, 0.5, 0.5)),
    ),
    columns=columns,
    grid=grid,
    sizes={"frequency_Hz": 5e-5, "bias_deg_per_h": 2.0},
    shape=(Parameter("relaxation_time_s", 600.0, 1e6, "time in which the stress relaxes"),),
    memory="relaxation_time_s",
    steady=steady,
    steady_grid=lambda low, high: [
        (float(c),) for c in np.linspace(low + 0.15 * (high - low), high - 0.15 * (high - low), 29)
    ],
    steady_words="mounting stress above a bond temperature",
)
