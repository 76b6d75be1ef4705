"""A wave that turns by command, through every error of the electronics: against exact limits and loops stepped in time here."""

import numpy as np
import pytest

from compensation.actuators import Actuators
from compensation.controllers import Loops
from compensation.electronics import Channels, Electronics
from compensation.rebalance import settle_rebalance
from compensation.settled_turn import turn_settled
from compensation.wave import from_quality, turn
from compensation.whole_angle import simulate_whole_angle

STIFF = Actuators(quadrature="stiffness")
K, PRECESSION, SECONDS, ROW = 0.277, np.radians(2.0), 45.0, 0.5  # in 45 s the azimuth turns by a period, 90°
WAVE = from_quality(4432.0, 1e5, damping_anisotropy=0.02, damping_axis=0.1, frequency_split=0.02, frequency_axis=-0.2)
ALL = Channels(0.05, 0.04, -0.03, 0.0, 0.05), Channels(-0.03, -0.05, 0.04, 0.02, 0.06)
CASES = {
    "pick-off gain": Electronics(Channels(gain_ratio=0.1)),
    "pick-off phase difference": Electronics(Channels(phase_difference=0.1)),
    "pick-off skew": Electronics(Channels(skew=0.1)),
    "pick-off phase": Electronics(Channels(phase=0.15)),
    "drive gain": Electronics(drive=Channels(gain_ratio=0.1)),
    "drive phase difference": Electronics(drive=Channels(phase_difference=0.1)),
    "drive skew": Electronics(drive=Channels(skew=0.1)),
    "drive phase": Electronics(drive=Channels(phase=0.15)),
    "misalignment": Electronics(drive=Channels(rotation=0.05)),
    "all": Electronics(*ALL),
    "stiffness, phase": Electronics(Channels(phase=0.1), Channels(phase=0.05), actuators=STIFF),
    "stiffness, pick-off phase difference": Electronics(Channels(phase_difference=0.1), actuators=STIFF),
    "stiffness, all": Electronics(*ALL, actuators=STIFF),
}
WATCHED = ("angle", "rate", "quadrature", "decay", "omega")


def seen(one, x, y):
    """What the pair of pick-offs shows: its axes are ½κ nearer to each other than 90°, its gains g_x/g_y = 1 + δ with the mean 1."""
    g_y = 2 / (2 + one.gain_ratio)
    g_x, late, square = (1 + one.gain_ratio) * g_y, one.phase_difference / 2, one.skew / 2
    return (
        g_x * np.exp(1j * (one.phase + late)) * (np.cos(square) * x + np.sin(square) * y),
        g_y * np.exp(1j * (one.phase - late)) * (np.sin(square) * x + np.cos(square) * y),
    )


def forced(one, x, y):
    """The forces that commands to the pair of drives make: each along its axis, which stands on the shell turned by β."""
    g_y, turned = 2 / (2 + one.gain_ratio), 2 * one.rotation
    g_x, late, square = (1 + one.gain_ratio) * g_y, one.phase_difference / 2, one.skew / 2
    x, y = g_x * np.exp(1j * (one.phase + late)) * x, g_y * np.exp(1j * (one.phase - late)) * y
    a, b = turned + square, turned + np.pi / 2 - square
    return np.cos(a) * x + np.cos(b) * y, np.sin(a) * x + np.sin(b) * y


def stepped(electronics, start):
    """Step two complex amplitudes under proportional-integral loops of amplitude, phase and quadrature; from 10 s on, by rows: `WATCHED`."""
    stiff, step, gain = electronics.actuators.stiff, 0.01, 2 * np.pi * 5.0
    a, w = 4 * WAVE.damping_axis, 4 * WAVE.frequency_axis
    d, s = WAVE.damping_split / 2, 1j * WAVE.frequency_split / 2
    even, odd = -d * np.cos(a) + s * np.cos(w), -d * np.sin(a) + s * np.sin(w)
    show = np.array(seen(electronics.pickoff, *np.eye(2)))
    x, y = np.linalg.solve(show, [np.cos(2 * start), np.sin(2 * start)])
    psi, sums, found = 2 * start, np.array([1 / WAVE.tau, 0.0, 0.0]), []
    for _ in range(round(SECONDS / step) + 1):
        p, q = seen(electronics.pickoff, x, y)
        major = np.arctan2(2 * (p * q.conjugate()).real, abs(p) ** 2 - abs(q) ** 2) / 2
        before, psi = psi, psi + (major - psi + np.pi / 2) % np.pi - np.pi / 2
        c, b = np.cos(psi), np.sin(psi)
        along, across = c * p + b * q, c * q - b * p
        error = np.array([1 - along.real, along.imag, -across.imag])
        sums = sums + gain**2 / 4 * step * error
        amplitude, phase, quadrature = sums + gain * error
        found.append(((psi + before) / 4, (psi - before) / 2 / step, quadrature, amplitude, WAVE.omega + phase))
        ahead = psi + (psi - before) / 2  # of the middle of the step
        c, b = np.cos(ahead), np.sin(ahead)
        node = 2 * PRECESSION + (0.0 if stiff else 1j * quadrature)
        u, v = forced(electronics.drive, c * amplitude - b * node, b * amplitude + c * node)
        spring = 1j * quadrature if stiff else 0.0  # couples antinode and node
        one, two = even - spring * np.sin(2 * ahead), odd + spring * np.cos(2 * ahead)
        own, half = -1 / WAVE.tau - 1j * phase, step / 2
        f, g = own * x + one * x + two * y + u, own * y + two * x - one * y + v
        f, g = x + half * f, y + half * g
        f, g = own * f + one * f + two * g + u, own * g + two * f - one * g + v
        x, y = x + step * f, y + step * g
    return dict(zip(WATCHED, np.array(found)[round(10 / step) :: round(ROW / step)].T, strict=True))


@pytest.mark.parametrize("electronics", CASES.values(), ids=CASES)
def test_limits_of_loops_stepped_in_time(electronics):
    """Angle and columns, of settled loops and of the loops' own run; what the errors do to the azimuth in 35 s is 1° and more."""
    start, time = electronics.shown(2, 0.3), np.arange(0.0, SECONDS + ROW / 2, ROW)
    true = stepped(electronics, start)
    true["rate"] = (true["rate"] - PRECESSION) / K
    there = settle_rebalance(WAVE, electronics, 0.0, true["angle"], precession=PRECESSION)
    for name in WATCHED[1:]:
        assert np.abs(getattr(there, name) - true[name]).max() < 3e-3 * np.ptp(true[name]), name
    turned = true["angle"] - true["angle"][0]
    assert np.degrees(np.ptp(turned - PRECESSION * ROW * np.arange(len(turned)))) > 1.0
    run = simulate_whole_angle(WAVE, electronics, Loops(), time, precession=PRECESSION, angle=0.3)
    settled = turn_settled(WAVE, electronics, time, precession=PRECESSION, angle=0.3)
    for one in (run, settled):
        assert one.angle[0] == pytest.approx(start, abs=1e-12)
        assert np.degrees(one.angle[-len(turned) :] - one.angle[-len(turned)]) == pytest.approx(
            np.degrees(turned), abs=6e-3
        )
        assert K * one.rate[:-1].sum() * ROW == pytest.approx(one.angle[-1] - start - PRECESSION * SECONDS, abs=5e-6)


def real_limit(pickoff, drive):
    """Without losses and splits θ̇ = p det D/(eᵀ D e) of D = C_p C_d, e along the wave: over a period, p det D/(½ tr D)."""
    D = np.array(seen(pickoff, *np.eye(2))).real @ np.array(forced(drive, *np.eye(2))).real
    return np.linalg.det(D) / (np.trace(D) / 2)


FREE = from_quality(4432.0, 1e12)


@pytest.mark.parametrize(
    ("electronics", "factor"),
    [
        (Electronics(Channels(phase=0.2), Channels(phase=0.1)), 1 / np.cos(0.3)),
        (Electronics(Channels(phase=0.2), Channels(phase=0.1), actuators=STIFF), np.cos(0.3)),
        (Electronics(drive=Channels(rotation=0.05)), 1 / np.cos(0.1)),
        *((Electronics(*pair), real_limit(*pair)) for pair in (
            (Channels(0.2), Channels()), (Channels(skew=0.2), Channels()), (Channels(), Channels(0.2)), (Channels(), Channels(skew=0.2)),
            (Channels(0.1, skew=-0.2), Channels(-0.2, skew=0.1, rotation=0.05)),
        )),
    ],
)  # fmt: skip
def test_limits_of_a_commanded_turn_without_losses(electronics, factor):
    """Quadrature's control by force gives the phase error's cos φ back, and once more: 1/cos φ; a stiffness does not."""
    seconds = np.pi / 2 / (PRECESSION * factor)
    time = 0.1 * np.arange(np.ceil(10 * seconds) + 1)
    for run in (
        turn_settled(FREE, electronics, time, precession=PRECESSION),
        simulate_whole_angle(FREE, electronics, Loops(), time, precession=PRECESSION),
    ):
        turned = np.interp(seconds, time, run.angle) - run.angle[0]
        assert turned == pytest.approx(np.pi / 2, rel=2e-5)


def test_limits_of_channels():
    """g_x/g_y − 1, the phase between the two, and the axes' angle are what the fields say, however large; drives act as pick-offs see."""
    one = Channels(gain_ratio=0.4, phase_difference=0.3, skew=0.4, rotation=0.1, phase=0.2)
    pickoff, drive = Electronics(one, one).channels(2)
    assert pickoff @ np.array([0.3, 1j]) == pytest.approx(
        seen(Channels(0.4, 0.3, 0.4, 0.0, 0.2), *turn(-0.2) @ [0.3, 1j])
    )
    assert drive @ np.array([0.3, 1j]) == pytest.approx(forced(one, 0.3, 1j))
