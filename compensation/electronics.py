"""Electronics between the wave and the loops: gains, phases and angles of the electrodes, delay, steps and noise.

Pick-offs show C_p (X, Y) of the plane of the two patterns, drives make (X, Y) forces C_d c of their commands:

    C_p = G,  C_d = Gᵀ,   G = e^{iφ} diag(g_x e^{iη/2}, g_y e^{−iη/2}) [[cos ½κ, sin ½κ], [sin ½κ, cos ½κ]] R(−n β),

with δ = g_x/g_y − 1 and η the differences of gain and phase between the channels along cos nθ and sin nθ, κ how far the axes are from
being square, β a turn of the electrodes and φ the phase error that both share. The gains' mean is 1, all amplitudes are relative to the commanded one.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from compensation.actuators import UNLIMITED, Actuators
from compensation.arrays import Complex
from compensation.errors import CompensationError
from compensation.wave import StandingWave, turn

BOLTZMANN = 1.380649e-23  # J/K


def uneven_of(gain_ratio: float) -> float:
    """Return (g_x − g_y) over the mean of both, of a ratio g_x/g_y − 1."""
    return 2 * gain_ratio / (2 + gain_ratio)


def ratio_of(uneven: float) -> float:
    """Return g_x/g_y − 1 of (g_x − g_y) over the mean of both."""
    return 2 * uneven / (2 - uneven)


@dataclass(frozen=True)
class Channels:
    """The pair of pick-offs, or of drives: δ = g_x/g_y − 1, phase difference η, skew κ, rotation β on the shell, phase φ (rad)."""

    gain_ratio: float = 0.0
    phase_difference: float = 0.0
    skew: float = 0.0
    rotation: float = 0.0
    phase: float = 0.0

    def __post_init__(self) -> None:
        for name in ("gain_ratio", "phase_difference", "skew", "phase"):
            if not abs(getattr(self, name)) < 0.5:
                raise CompensationError(f"{name} = {getattr(self, name):g} of the electronics is not within ±0.5.")

    def matrix(self, harmonic: int) -> Complex:
        """Return G (2, 2)."""
        uneven, late = uneven_of(self.gain_ratio) / 2, np.exp(0.5j * self.phase_difference)
        gains = np.diag([(1 + uneven) * late, (1 - uneven) / late]) * np.exp(1j * self.phase)
        square, skewed = np.cos(self.skew / 2), np.sin(self.skew / 2)
        return np.asarray(gains @ [[square, skewed], [skewed, square]] @ turn(-harmonic * self.rotation))


@dataclass(frozen=True)
class LoopNoise:
    """Noise by source, over the commanded amplitude: `pickoff` (1/√Hz, one-sided, at the carrier), `drive` (1/s/√Hz, over 2ω).

    Steps of a demodulated sample (1) and of a command (1/s) are white noise of step²/12; `thermal` (1/√s) is of each quadrature.
    """

    pickoff: float = 0.0
    adc_step: float = 0.0
    dac_step: float = 0.0
    drive: float = 0.0
    thermal: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0):
                raise CompensationError(f"the noise '{name}' must be 0 or positive, not {value:g}.")

    def measurement_variance(self, sampling: float) -> float:
        """Variance of one demodulated sample: density² times sampling rate (white about the carrier), and the ADC's step."""
        return self.pickoff**2 * sampling + self.adc_step**2 / 12

    def command_variance(self, sampling: float) -> float:
        """Variance (1/s²) of one command: the DAC's step, and drive noise."""
        return self.drive**2 * sampling + self.dac_step**2 / 12


def thermal_noise(wave: StandingWave, temperature: float, modal_mass: float, amplitude: float) -> float:
    """Return the thermomechanical noise (1/√s) of each quadrature over the amplitude: √(2 k_B T/(m ω² τ))/a.

    dX = −X/τ dt + σ dW with ⟨X²⟩ = k_B T/(m ω²) = σ² τ/2; as angle random walk σ/(a n k) (rad/√s).
    """
    if not (temperature > 0 and modal_mass > 0 and amplitude > 0):
        raise CompensationError("thermal noise needs a positive temperature, modal mass and amplitude.")
    omega, tau = float(np.mean(wave.omega)), float(np.mean(wave.tau))
    return float(np.sqrt(2 * BOLTZMANN * temperature / (modal_mass * omega**2 * tau)) / amplitude)


@dataclass(frozen=True)
class Electronics:
    """Pick-offs, drives, noise and actuators of a gyro."""

    pickoff: Channels = Channels()
    drive: Channels = Channels()
    noise: LoopNoise = LoopNoise()
    actuators: Actuators = UNLIMITED

    def channels(self, harmonic: int, angle: ArrayLike = 0.0) -> tuple[Complex, Complex]:
        """Return C_p and C_d (..., 2, 2) in the frame of a wave at the azimuth θ."""
        R = np.moveaxis(turn(harmonic * np.asarray(angle)), (0, 1), (-2, -1))
        back = np.swapaxes(R, -1, -2)
        return back @ self.pickoff.matrix(harmonic) @ R, back @ self.drive.matrix(harmonic).T @ R

    def shown(self, harmonic: int, angle: float) -> float:
        """Return the azimuth (rad) that the pick-offs show of a wave at the azimuth θ, from what is in phase."""
        pickoff = self.channels(harmonic, angle)[0][:, 0] * np.exp(-1j * self.pickoff.phase)
        return angle + float(np.arctan2(*pickoff.real[::-1])) / harmonic
