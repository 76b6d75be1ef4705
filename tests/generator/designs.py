"""Chamber programmes, voltage and amplitude schedules of fixed campaign designs; the physics is drawn at random."""

import numpy as np

from tests.generator.thermal_twin import STEP

HOURS = 3600.0


def _levels(levels, hours, total):
    time = np.arange(0.0, total, STEP)
    index = np.minimum((time / (hours * HOURS)).astype(int), len(levels) - 1)
    return np.asarray(levels, dtype=float)[index]


def _points(points, total):
    time = np.arange(0.0, total, STEP)
    t, v = np.array(points, dtype=float).T
    return np.interp(time, t * HOURS, v)


def stairs(total=8 * HOURS):
    return _levels([20, 0, -20, -5, 15, 40, 28, 10], 1.0, total)


def ramps(total=8 * HOURS):
    return _points([(0, 20), (0.5, 20), (2.5, -20), (3.2, -20), (5.2, 45), (6, 45), (7.2, 10), (8, 10)], total)


def cycle(total=8 * HOURS, low=-18.0, high=42.0, period=4.0):
    return _points([(0, 20)] + [(0.3 + period * (0.25 + 0.5 * k), high if k % 2 else low) for k in range(8)], total)


def wander(total=8 * HOURS):
    return _levels([20, 33, 5, 12, -18, -2, 38, 25, -10, 18, 30, 8], 0.66, total)


def paper_step(target, total=8 * HOURS):
    time = np.arange(0.0, total, STEP)
    return np.where(time < 900.0, 22.0, float(target))


def up_stairs(total=8 * HOURS, first=-20.0, last=40.0):
    return _levels(np.linspace(first, last, 6), total / HOURS / 6, total)


def schedule(levels, hours, total=8 * HOURS):
    return _levels(levels, hours, total)


VOLTS = [schedule([80, 80, 110, 80, 60, 100, 80, 120], 1.0), schedule([80, 95, 60, 80], 2.0), None, None]
DRIVES = [schedule([1.0], 8), schedule([1.0, 1.3, 0.8, 1.2, 1.0, 0.7], 1.3), schedule([1.0, 1.25, 0.85], 2.7), None]
ANGLES = [0.0, 11.0, 27.0, 40.0]

DESIGNS = {
    "rich": {
        "chambers": [stairs(), ramps(), cycle(), wander()],
        "volts": VOLTS,
        "drives": DRIVES,
        "angles": ANGLES,
        "gaps": [0.0, 12.0, 16.0, 30.0],
    },
    "plain": {
        "chambers": [stairs(), ramps(), cycle(), wander()],
        "volts": None,
        "drives": None,
        "angles": None,
        "gaps": [0.0, 12.0, 16.0, 30.0],
    },
    "cycles": {
        "chambers": [cycle(), cycle(), cycle(period=3.0), cycle()],
        "volts": VOLTS,
        "drives": DRIVES,
        "angles": None,
        "gaps": [0.0, 4.0, 4.0, 4.0],
    },
    "monotone": {
        "chambers": [up_stairs(), up_stairs(last=30.0), up_stairs(first=-10.0), up_stairs()],
        "volts": VOLTS,
        "drives": DRIVES,
        "angles": None,
        "gaps": [0.0, 16.0, 16.0, 16.0],
    },
    "steps": {
        "chambers": [paper_step(-10), paper_step(40), paper_step(0), paper_step(-20)],
        "volts": None,
        "drives": None,
        "angles": None,
        "gaps": [0.0, 16.0, 16.0, 16.0],
    },
    "three": {
        "chambers": [ramps(), cycle(period=3.2), stairs()],
        "volts": [VOLTS[1], VOLTS[0], None],
        "drives": [None, DRIVES[1], DRIVES[2]],
        "angles": [0.0, 15.0, 32.0],
        "gaps": [0.0, 40.0, 10.0],
    },
}
