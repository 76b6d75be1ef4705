"""Measured points of an imperfect hemisphere, made in three dimensions: radii, patches left out, a frame of their own."""

from math import pi

import numpy as np
from scipy.spatial.transform import Rotation


def dome_points(
    rng, count, waves, side, radius=15e-3, wall=0.9e-3, noise=100e-9, gaps=0.02, outliers=0.0, tilt_deg=0.5, shift=50e-6
):
    """Points (count, 3), m, evenly over the face `side` (-1 inner, 1 outer) of a dome with its pole at +z.

    waves : (m, amplitude, azimuth, power): the face stands out of the material by amplitude · sin^power φ · cos m(θ - azimuth).
    """
    z, theta = rng.uniform(0, 1, count), rng.uniform(0, 2 * pi, count)
    sine = np.sqrt(1 - z**2)
    out = np.zeros(count)
    for m, amplitude, azimuth, power in waves:
        out += amplitude * sine**power * np.cos(m * (theta - azimuth))
    direction = np.stack([sine * np.cos(theta), sine * np.sin(theta), z], axis=1)
    points = (radius + side * (wall / 2 + out) + noise * rng.standard_normal(count))[:, None] * direction
    wild = rng.random(count) < outliers
    points[wild] *= 1 + rng.uniform(-0.03, 0.03, wild.sum())[:, None]
    kept = np.ones(count, dtype=bool)
    while gaps and kept.mean() > 1 - gaps:
        kept &= direction @ direction[rng.integers(count)] < np.cos(rng.uniform(0.03, 0.1))
    azimuth = rng.uniform(0, 2 * pi)
    spin = Rotation.from_rotvec(np.deg2rad(tilt_deg) * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]))
    return points[kept] @ spin.as_matrix().T + shift * rng.uniform(-1, 1, 3)
