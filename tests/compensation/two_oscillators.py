"""Two coupled oscillators q'' + C q' + K q = 0, solved by their eigenvalues: a ring-down that knows no slow approximation."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Gyro:
    """Frequencies (Hz), Q along the two damping axes, and the azimuths (rad) of the upper mode and of most damping."""

    upper: float
    lower: float
    q_least: float
    q_most: float
    axis: float
    damping_axis: float
    harmonic: int = 2

    def matrices(self):
        def turned(first, second, azimuth):
            c, s = np.cos(self.harmonic * azimuth), np.sin(self.harmonic * azimuth)
            R = np.array([[c, -s], [s, c]])
            return R @ np.diag([first, second]) @ R.T

        K = turned((2 * np.pi * self.upper) ** 2, (2 * np.pi * self.lower) ** 2, self.axis)
        middle = 2 * np.pi * (self.upper + self.lower) / 2
        return K, turned(middle / self.q_least, middle / self.q_most, self.damping_axis)

    def modes(self):
        """The two eigenvalues above the real axis, the higher frequency first, and their displacements.

        Of the phase that an eigenvector leaves open, which differs from processor to processor, a projection is real and positive.
        """
        K, C = self.matrices()
        A = np.block([[np.zeros((2, 2)), np.eye(2)], [-K, -C]])
        values, vectors = np.linalg.eig(A)
        order = np.argsort(-values.imag)[:2]
        seen = np.array([0.6, 0.8]) @ vectors[:2, order]
        return values[order], vectors[:2, order] * np.conj(seen) / abs(seen)

    def envelope(self, time, carrier, amplitudes):
        """Complex amplitudes about the carrier of the two channels, for complex amplitudes of the two modes."""
        values, vectors = self.modes()
        shapes = vectors / np.linalg.norm(vectors, axis=0)
        turn = np.exp(np.outer(values - 2j * np.pi * carrier, time))
        return shapes @ (np.asarray(amplitudes)[:, None] * turn)

    def samples(self, time, amplitudes):
        """What two pick-offs read."""
        return self.envelope(time, 0.0, amplitudes).real


def noisy(values, sd, random):
    """White complex noise of standard deviation `sd` on each row."""
    n = random.standard_normal(values.shape) + 1j * random.standard_normal(values.shape)
    return values + sd / np.sqrt(2) * n
