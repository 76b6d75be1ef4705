"""The BVG paper's theory of the bell, (16)–(22), in numbers beside the shell solver, and its reading of the rate, (23)–(30)."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from compensation.piezo import COUNT, DRIVE_Q
from studies.instrument.card import load_card

if TYPE_CHECKING:
    from compensation.loop import BellResonator
    from compensation.piezo import PiezoRing

CARD = "bvg-bell"
D31_PZT5A = -1.71e-10
"""C/N, of PZT-5A (data sheets of makers); the paper names the ceramic and no constant."""
ELEMENT_mm, AMPLIFIER_F = (6.0, 3.0), 1e-9
"""Length along the wall, beginning at the dome, and width of an element; feedback of its amplifier: assumed, none is printed."""


@dataclass(frozen=True)
class PatternRow:
    """One assumed pattern: frequency (Hz), precession factor, and the share of its energy that stretches the wall."""

    name: str
    frequency: float
    precession_factor: float
    membrane_share: float


@dataclass(frozen=True)
class BellTheory:
    """The two-pattern model with three patterns on one bell, and the solver: `solid` on the card's stem, `free` without."""

    card: str
    rows: tuple[PatternRow, ...]
    solid: PatternRow
    free: PatternRow


def compare_bell_theory(card: str = CARD) -> BellTheory:
    """Hold the pattern (19), the same without its factor cos(5πφ/φ_b), and one that does not stretch against the solver."""
    from dataclasses import replace

    from shell.bell_theory import (
        inextensional_functions,
        rayleigh_functions,
        rayleigh_functions_without_factor,
        two_pattern_model,
    )
    from shell.modes import solve_modes

    instrument = load_card(card)
    resonator = instrument.resonator
    elastic = instrument.material.elastic(instrument.reference_temperature)
    patterns = (
        ("(19) as printed", rayleigh_functions),
        ("(19) without cos(5πφ/φ_b)", rayleigh_functions_without_factor),
        ("solved from (17), (18)", inextensional_functions),
    )
    rows = []
    for name, pattern in patterns:
        model = two_pattern_model(resonator, elastic, pattern)
        rows.append(PatternRow(name, model.frequency, model.bryan_factor, model.membrane_share))
    solved = []
    for name, body in (
        ("solid, on its stem", resonator),
        ("solid, free", replace(resonator, support="free", stem=None)),
    ):
        (mode,) = solve_modes(body, elastic)
        solved.append(PatternRow(name, mode.frequency, mode.bryan_factor, mode.energy_fractions.membrane))
    return BellTheory(instrument.name, tuple(rows), solved[0], solved[1])


@dataclass(frozen=True)
class LoopReading:
    """A planted rate read from the integrated equations (23): open loop (25) and force rebalance (26), rad/s."""

    planted: float  # the rate, and its mean as read
    open_loop: float
    rebalance: float
    scale_error: float  # relative error of Ω = K A_q (30) with K of the resonator's constants
    singular_share: float  # part of the time in which ṗ of (24) is below a tenth of its amplitude
    second_form: float  # the mean read from the driven axis in open loop, second form of (24), rad/s
    from_charges: float  # the mean read in force rebalance from the charges of the piezo elements, (27)–(29), rad/s
    volts_per_um: float  # sum of the amplifiers of elements 3 and 7 per micrometre of the mouth
    printed_share: float  # part of the charge that (27) as printed leaves, σ_φφ over σ_θθ + σ_φφ


def read_planted_rate(planted: float = 2.0) -> LoopReading:
    """Integrate (23) with a coupling c₁ and read the rate back by (24)–(26) for amplitudes, by (27)–(29) and by (30).

    Parameters
    ----------
    planted : rate, rad/s.
    """
    from scipy.integrate import solve_ivp

    from compensation.loop import read_rate_from_drive, read_rate_from_loop, scale_of_rebalance
    from compensation.motion import demodulate

    bell, ring, share = _bell_with_elements()
    omega = bell.omega
    found = {}
    time = 2 * np.pi / omega / 24 * np.arange(int(0.03 * omega / (2 * np.pi) * 24))
    for name, rebalance in (("open", 0.0), ("rebalance", 40.0)):

        def slope(t: float, y: np.ndarray, gain: float = rebalance) -> list[float]:
            p, q, dp, dq = y
            coupling = 2 * planted * bell.b
            return [
                dp,
                dq,
                (coupling * dq - bell.c0 * p - bell.c1 * q) / bell.m0,
                (-gain * dq - coupling * dp - bell.c0 * q - bell.c1 * p) / bell.m0,
            ]

        start = [0.0, 0.0, omega * 1e-6, 0.0]
        y = solve_ivp(slope, (0, time[-1]), start, "DOP853", time, rtol=1e-10, atol=1e-16).y
        at, P = demodulate(time, y[0], omega)
        _, Q = demodulate(time, y[1], omega)
        _, F = demodulate(time, -rebalance * y[3], omega)
        read = read_rate_from_loop(bell, omega, at, P, Q, F if rebalance else None)
        late = (at > 0.01) & (at < at[-1] - 0.001)
        found[name] = float(np.mean(read[late]))
        if not rebalance:
            second = read_rate_from_drive(bell, omega, at, P, Q, np.zeros_like(P))
            found["second"] = float(np.mean(second[late]))
        else:
            # the amplifiers' voltages, and those that give the force on elements 2 and 6
            sensed = ring.displacements(ring.voltages(ring.charges(y[0], y[1])))
            drives = np.zeros((COUNT, len(time)))
            drives[[i - 1 for i in DRIVE_Q]] = -rebalance * y[3] / sum(ring.coupling[i - 1, 1] for i in DRIVE_Q)
            columns = (demodulate(time, x, omega)[1] for x in (*sensed, ring.forces(drives)[1]))
            found["charges"] = float(np.mean(read_rate_from_loop(bell, omega, at, *columns)[late]))
            K = scale_of_rebalance(bell, omega, float(abs(P[-1])))
            by_scale = K * float(np.real(F[-1] / (1j * P[-1] / abs(P[-1]))))
    return LoopReading(
        planted,
        found["open"],
        found["rebalance"],
        by_scale / planted - 1,
        2 * np.arcsin(0.1) / np.pi,
        found["second"],
        found["charges"],
        abs(1e-6 / ring.scales[0]),
        share,
    )


def _bell_with_elements() -> "tuple[BellResonator, PiezoRing, float]":
    """The card's bell as (23) with a coupling c₁, the elements on its cylinder, and σ_φφ over the sum of the stresses there."""
    from compensation.loop import BellResonator
    from compensation.piezo import PiezoRing
    from shell.curves import Arc
    from shell.modes import solve_modes
    from shell.wall_stress import find_wall_stress

    instrument = load_card(CARD)
    body = instrument.resonator
    (mode,) = solve_modes(body, instrument.material.elastic(instrument.reference_temperature))
    lengths = [segment.length for segment in body.segments]
    top, height = lengths[0] / sum(lengths), ELEMENT_mm[0] * 1e-3 / sum(lengths)
    stress = find_wall_stress(mode, top, top + height)
    width, dome = ELEMENT_mm[1] * 1e-3, body.segments[0]
    assert isinstance(dome, Arc)
    ring = PiezoRing(stress.total, D31_PZT5A, ELEMENT_mm[0] * width * 1e-3, width / dome.radius, AMPLIFIER_F)
    m0 = mode.modal_mass
    bell = BellResonator(m0=m0, b=2 * m0 * mode.bryan_factor, c0=m0 * (2 * np.pi * mode.frequency) ** 2, c1=3.0)
    return bell, ring, stress.along / stress.total
