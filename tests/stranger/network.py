"""Distributed thermal network: housing → base (board beside it) → stem → twelve rings of the shell, own integrator.

C_i dT_i/dt = Σ_j G_ij (T_j − T_i) + s G_rad/(4 T₀³) (T_h⁴ − T_b⁴): exponential time differencing,
the linear part exact for a driving temperature that is linear within a step, the T⁴ excess of the base at mid step.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

STEP_S = 10.0
RINGS = 12
KELVIN = 273.15


@dataclass(frozen=True)
class Network:
    """Time constants in s; `spread` scales everything that departs from one single lag."""

    housing_s: float
    main_s: float
    stem_s: float
    shell_s: float
    board_share: float
    board_s: float
    t4_share: float
    spread: float = 1.0

    def scaled(self, spread: float) -> "Network":
        return replace(self, spread=spread)


def draw_network(rng: np.random.Generator) -> Network:
    return Network(
        housing_s=rng.uniform(200, 900),
        main_s=np.exp(rng.uniform(np.log(500), np.log(2600))),
        stem_s=rng.uniform(40, 200),
        shell_s=rng.uniform(40, 260),
        board_share=rng.uniform(0.02, 0.2),
        board_s=rng.uniform(1500, 9000),
        t4_share=rng.uniform(0, 0.5) * rng.integers(0, 2),
    )


def housing_of(network: Network, chamber: np.ndarray) -> np.ndarray:
    return lag(chamber, network.housing_s)


def lag(drive: np.ndarray, tau: float, start: float | None = None) -> np.ndarray:
    """First-order lag on the uniform grid, the drive linear between its points."""
    keep = np.exp(-STEP_S / tau)
    mean = tau / STEP_S * (1 - keep)
    old, new = mean - keep, 1 - mean
    begin = drive[0] if start is None else start
    tail, _ = lfilter([new, old], [1, -keep], drive[1:], zi=[old * drive[0] + keep * begin])
    return np.concatenate([[begin], tail])


def integrate(network: Network, housing: np.ndarray, start_offset: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return (mode, stem): the shell's temperature weighted by the n = 2 strain (towards the rim), and the stem's, °C."""
    matrix, drive = _equations(network)
    values, left = np.linalg.eig(matrix)
    values, left = values.real, left.real
    right = np.linalg.inv(left)
    z = values * STEP_S
    decay = np.exp(z)
    phi1 = np.where(np.abs(z) < 1e-8, 1.0, np.expm1(z) / z)
    phi2 = (phi1 - 1) / z
    b = right @ drive
    weight = np.linspace(0.2, 1.0, RINGS) ** 2
    weight /= weight.sum()
    share = network.t4_share * network.spread
    heat = right[:, 0] * share / network.main_s
    state = right @ np.full(len(drive), housing[0] + start_offset)
    read = np.vstack([weight @ left[3:], left[2]])
    forced = STEP_S * b[:, None] * ((phi1 - phi2)[:, None] * housing[:-1] + phi2[:, None] * housing[1:])
    kick = (STEP_S * phi1 * heat * 0.5)[:, None]
    excess = np.zeros(len(housing) - 1)
    for _ in range(60):  # the excess of the course before, until it is that of the course itself
        inputs = np.column_stack([state, forced + kick * excess])
        states = np.array([lfilter([1.0], [1.0, -keep], own) for keep, own in zip(decay, inputs, strict=True)])
        new = decay[:, None] * states[:, :-1] + forced
        around = (housing[:-1], left[0] @ states[:, :-1]), (housing[1:], left[0] @ new)
        before, excess = excess, sum(_t4_excess(*pair) for pair in around)
        if not share or np.abs(excess - before).max() < 1e-12:
            break
    return tuple(read @ states)


def _t4_excess(housing: np.ndarray, base: np.ndarray) -> np.ndarray:
    h, b, reference = housing + KELVIN, base + KELVIN, 293.15
    return (h**4 - b**4) / (4 * reference**3) - (h - b)


def _equations(network: Network) -> tuple[np.ndarray, np.ndarray]:
    """Nodes: base, board, stem, rings. The chain is light against the base, and fast as `spread` goes to 0."""
    n = 3 + RINGS
    a, b = np.zeros((n, n)), np.zeros(n)
    b[0] = 1 / network.main_s
    a[0, 0] = -b[0]
    share = network.board_share * network.spread
    couple(a, 0, 1, share / network.board_s, 1 / network.board_s)
    stem = network.stem_s * network.spread
    couple(a, 0, 2, 0.03 / stem, 1 / stem)
    ring = network.shell_s * network.spread / RINGS**2
    couple(a, 2, 3, 0.5 / ring / RINGS, 1 / ring)
    for i in range(3, n - 1):
        couple(a, i, i + 1, 1 / ring, 1 / ring)
    return a, b


def couple(a: np.ndarray, i: int, j: int, into_i: float, into_j: float) -> None:
    a[i, i] -= into_i
    a[i, j] += into_i
    a[j, j] -= into_j
    a[j, i] += into_j
