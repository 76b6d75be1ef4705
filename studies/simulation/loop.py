"""The loops of a card's gyro: its standing wave and electronics in SI units, what they say settled, and over a run."""

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compensation.actuators import Actuators, RangeUse
from compensation.applied_rate import AppliedRate
from compensation.arrays import Array
from compensation.controllers import Loops, Margin, require_stable
from compensation.electronics import Channels, Electronics, LoopNoise, thermal_noise
from compensation.rebalance import LoopRun, settle_rebalance, simulate_rebalance
from compensation.settled_turn import read_turned, turn_settled
from compensation.wave import StandingWave
from compensation.whole_angle import WITHOUT_RATE, simulate_whole_angle
from studies.errors import InputError, naming
from studies.progress import tell
from studies.record import place_of_largest
from studies.resonator.splitting import reference_split

if TYPE_CHECKING:
    from studies.instrument.card import Instrument
    from studies.instrument.tables.loop import Loop

DEG_PER_H = float(np.degrees(1.0)) * 3600.0


def wave_of(
    instrument: "Instrument",
    frequency: ArrayLike,
    inverse_q: ArrayLike,
    bryan_factor: float,
    harmonic: int = 2,
    damping: NDArray[np.complex128] | None = None,
) -> StandingWave:
    """Return the standing wave at frequencies (Hz) and losses, numbers or rows; `damping`: Δ(1/Q) exp(2inθ_τ) in place of `[bias]`'s."""
    loop, bias = require_loop(instrument), instrument.bias
    omega = 2 * np.pi * np.asarray(frequency, dtype=float)
    decay = omega * np.asarray(inverse_q, dtype=float) / 2
    split, axis = bias.damping_anisotropy * decay, np.asarray(np.radians(bias.damping_axis_deg))
    if damping is not None:
        split, axis = omega * np.abs(damping) / 2, np.angle(damping) / (2 * harmonic)
    return StandingWave(
        omega, 1 / decay, split, axis, *_frequency_split(instrument, loop, harmonic), harmonic, bryan_factor
    )


def _frequency_split(instrument: "Instrument", loop: "Loop", harmonic: int) -> tuple[float, float]:
    """Δω (rad/s) and the axis of the higher frequency (rad): that of [loop], and what imperfection and electrodes make besides."""
    own = loop.frequency_split_mHz * 1e-3, float(np.radians(loop.frequency_axis_deg))
    if not instrument.is_imperfect:
        return 2 * np.pi * own[0], own[1]
    split = reference_split(instrument, harmonic).split
    wave = own[0] * np.exp(2j * harmonic * own[1]) + split.frequency * split.wave
    return float(2 * np.pi * abs(wave)), float(np.angle(wave)) / (2 * harmonic)


def electronics_of(instrument: "Instrument", wave: StandingWave) -> Electronics:
    """Return pick-offs, drives and noise for the card's vibration at its reference temperature."""
    loop = require_loop(instrument)

    def channels(side: str, rotation: float) -> Channels:
        return Channels(
            getattr(loop, f"{side}_gain_ratio"),
            np.radians(getattr(loop, f"{side}_phase_difference_deg")),
            1e-3 * getattr(loop, f"{side}_skew_mrad"),
            rotation,
            np.radians(getattr(loop, f"{side}_phase_deg")),
        )

    full = wave.coupling * np.radians(loop.rate_range_deg_per_s)  # of the force over 2ω and the amplitude
    thermal = 0.0
    if loop.vibration_um is not None and loop.modal_mass_mg is not None:
        temperature = instrument.reference_temperature
        thermal = thermal_noise(wave, temperature, 1e-6 * loop.modal_mass_mg, 1e-6 * loop.vibration_um)
    noise = LoopNoise(
        pickoff=1e-6 * loop.pickoff_noise_uV_per_rt_Hz / loop.amplitude_V,
        adc_step=1e-6 * loop.adc_step_uV / loop.amplitude_V,
        dac_step=2 * full / 2**loop.dac_bits,
        drive=1e-6 * loop.drive_noise_ppm_per_rt_Hz * full,
        thermal=thermal,
    )
    actuators = Actuators(
        force=full,
        drive=loop.drive_headroom * float(np.median(1 / np.asarray(wave.tau))),
        stiffness=np.pi * loop.quadrature_range_Hz,
        quadrature=loop.quadrature_control,
    )
    return Electronics(channels("pickoff", 0.0), channels("drive", 1e-3 * loop.misalignment_mrad), noise, actuators)


def find_range_use(
    instrument: "Instrument", wave: StandingWave, rate: ArrayLike = 0.0, pattern_angle: ArrayLike | None = None,
    effort: ArrayLike | None = None,
) -> RangeUse:  # fmt: skip
    """Return what part of the actuators' ranges the settled loops use; a free wave meets the quadrature, and without its `effort` (1/s) the decay, of every azimuth."""
    loop = require_loop(instrument)
    electronics = electronics_of(instrument, wave)
    angle = np.radians(instrument.bias.pattern_angle_deg) if pattern_angle is None else np.asarray(pattern_angle)
    if loop.mode == "whole-angle":
        turn = wave.harmonic * np.radians(loop.self_precession_deg_per_s)
        most = 1 / np.asarray(wave.tau) + np.abs(wave.damping_split) / 2 if effort is None else effort
        return electronics.actuators.use(turn, np.abs(wave.frequency_split) / 2, most)
    run = settle_rebalance(wave, electronics, rate, angle)
    return electronics.actuators.use(wave.coupling * run.rate, run.quadrature, run.decay)


def require_range(instrument: "Instrument", use: RangeUse, rate: ArrayLike, coupling: float, source: str = "") -> None:
    """Raise naming the key of the actuator that the settled loops overload, and what it can hold."""
    loop = require_loop(instrument)
    if use.worst <= 1:
        return
    where, held = f"{instrument.path} [loop]", np.degrees(float(np.max(np.abs(rate))))
    across, quadrature, drive = (float(np.max(x)) for x in (use.across, use.quadrature, use.drive))
    if loop.mode == "force-rebalance" and held > loop.rate_range_deg_per_s:
        place = place_of_largest(source, "rate_deg_per_s") if source else "--rate"
        raise InputError(
            f"{where}: the rate of {held:.4g} °/s ({place}) is beyond rate_range_deg_per_s = {loop.rate_range_deg_per_s:g}; apply a"
            " lower rate, or raise the range."
        )
    if drive > 1:
        raise InputError(
            f"{where}: holding the amplitude takes {drive:.3g} times the largest drive, drive_headroom ="
            f" {loop.drive_headroom:g}; raise it, or lower the loss."
        )
    if quadrature > 1:
        stiff = loop.quadrature_control == "stiffness"
        held_split = loop.quadrature_range_Hz if stiff else coupling * np.radians(loop.rate_range_deg_per_s) / np.pi
        key = (
            f"quadrature_range_Hz = {loop.quadrature_range_Hz:g}"
            if stiff
            else f"rate_range_deg_per_s = {loop.rate_range_deg_per_s:g}"
        )
        raise InputError(
            f"{where}: the quadrature of the frequency split needs {100 * quadrature:.0f} % of the available range: {key} can null a"
            f" split of at most {1e3 * held_split:.4g} mHz; trim the split, or raise the range"
            + ("." if stiff else ', or set quadrature_control = "stiffness".')
        )
    turned = "the rate" if loop.mode == "force-rebalance" else "the self-precession"
    size = f" of {held:.4g} °/s" if loop.mode == "force-rebalance" else f" of {loop.self_precession_deg_per_s:g} °/s"
    raise InputError(
        f"{where}: {turned}{size} takes {100 * float(np.max(use.rate)):.4g} % of the force that rate_range_deg_per_s ="
        f" {loop.rate_range_deg_per_s:g} allows ({100 * across:.4g} % with quadrature); lower it, or raise the range."
    )


def loops_of(loop: "Loop") -> Loops:
    """Return the four loops with their sampling, delay and low pass."""
    return Loops(
        loop.amplitude_bandwidth_Hz,
        loop.phase_bandwidth_Hz,
        loop.rate_bandwidth_Hz,
        loop.quadrature_bandwidth_Hz,
        loop.sampling_Hz,
        1e-3 * loop.delay_ms,
        loop.demodulator_Hz,
    )


def require_loop(instrument: "Instrument") -> "Loop":
    """Return the card's loops, or say that it has none."""
    if instrument.loop is None:
        raise InputError(
            f"{instrument.path}: the card has no loops; add a table [loop] (it may be empty: all keys have defaults)."
        )
    return instrument.loop


def require_stable_loops(instrument: "Instrument", frequency: float, inverse_q: float) -> tuple[Margin, ...]:
    """Return the margins of a card's loops, or raise naming an unstable one, its margin and the mend."""
    loop = require_loop(instrument)
    names = Loops.NAMES if loop.mode == "force-rebalance" else WITHOUT_RATE
    with naming(f"{instrument.path} [loop]"):
        return require_stable(loops_of(loop), float(np.pi * frequency * inverse_q), names)


def without_loop(instrument: "Instrument") -> "Instrument":
    """Return the instrument as it is before its loops read it: frequency and loss are those of the resonator."""
    return replace(instrument, content={key: value for key, value in instrument.content.items() if key != "loop"})


def settled_columns(
    instrument: "Instrument",
    frequency: Array,
    inverse_q: Array,
    bryan_factor: float,
    pattern_angle: ArrayLike | None = None,
    damping: NDArray[np.complex128] | None = None,
    time: Array | None = None,
    rate: ArrayLike | AppliedRate = 0.0,
    wander: ArrayLike = 0.0,
    means: bool = False,
) -> dict[str, Array]:
    """Return what the settled loops of a card record, `rate` and `wander` in rad/s, without the offset and polynomial of `[bias]`.

    With `means`, a row of a wave that turns freely over the `time` (s) has the azimuth of its moment and means to the next.
    """
    loop, start = require_loop(instrument), float(np.radians(instrument.bias.pattern_angle_deg))
    angle = np.broadcast_to(np.asarray(start if pattern_angle is None else pattern_angle), np.shape(frequency))
    wave = wave_of(instrument, frequency, inverse_q, bryan_factor, damping=damping)
    electronics = electronics_of(instrument, wave)
    precession = np.radians(loop.self_precession_deg_per_s)
    applied = rate.at(np.asarray(time)) if isinstance(rate, AppliedRate) else rate
    if loop.mode == "force-rebalance":
        run = settle_rebalance(wave, electronics, applied, angle)
    elif time is None:
        run = settle_rebalance(wave, electronics, applied, angle, precession=precession)
    elif pattern_angle is None:
        run = turn_settled(
            wave, electronics, time, rate=rate, precession=precession, angle=start, wander=wander, means=means
        )
    elif means:  # whatever was commanded has turned it so
        run = read_turned(wave, electronics, time, angle, rate=rate)
    else:
        run = settle_rebalance(wave, electronics, applied, angle, np.gradient(angle, time))
    return columns_of(loop, run)


def columns_of(loop: "Loop", run: LoopRun) -> dict[str, Array]:
    """Return a run of the loops in the columns and units of a record."""
    return {
        "frequency_Hz": run.omega / (2 * np.pi),
        "bias_deg_per_h": run.rate * DEG_PER_H,
        "inverse_q": 2 * run.decay / run.omega,
        "quadrature_V": loop.quadrature_V_per_Hz * run.quadrature / np.pi,
        "pattern_angle_deg": np.degrees(run.angle),
    }


def run_loops(
    instrument: "Instrument",
    time: Array,
    frequency: ArrayLike,
    inverse_q: ArrayLike,
    bryan_factor: float,
    *,
    rate: ArrayLike | AppliedRate = 0.0,
    both_ways: bool = False,
    damping: NDArray[np.complex128] | None = None,
    generator: np.random.Generator | None = None,
) -> LoopRun:
    """Run the card's loops over even rows (s); frequency (Hz), loss and `rate` (rad/s) are numbers or rows."""
    loop = require_loop(instrument)
    angle = float(np.radians(instrument.bias.pattern_angle_deg))
    wave = wave_of(instrument, frequency, inverse_q, bryan_factor, damping=damping)
    electronics = electronics_of(instrument, wave)
    told = partial(tell, "the loops, row by row")
    back = both_ways & (np.arange(len(time)) >= len(time) // 2)
    with naming(f"{instrument.path} [loop]"):
        if loop.mode == "whole-angle":
            return simulate_whole_angle(
                wave,
                electronics,
                loops_of(loop),
                time,
                rate=rate,
                precession=np.radians(loop.self_precession_deg_per_s) * np.where(back, -1.0, 1.0),
                angle=angle,
                generator=generator,
                progress=told,
            )
        return simulate_rebalance(
            wave, electronics, loops_of(loop), time, rate=rate, angle=angle, generator=generator, progress=told
        )
