"""`[loop]`: the loops that read the gyro, and the errors of their electronics. A card with it has its bias from them."""

from typing import Annotated, Literal

from studies.instrument.registry import CardTable
from studies.schema.keys import Keys, Note, number, says

Band = Annotated[float, number(above=0.0)]


class Loop(Keys, frozen=True, kw_only=True):
    """Loops of the gyro and the errors of their electronics, in the units of the keys."""

    mode: Annotated[Literal["force-rebalance", "whole-angle"], says("mode of the loops")] = "force-rebalance"
    amplitude_bandwidth_Hz: Annotated[Band, says("loop GA of the BVG paper: gain crossover")] = 1.0
    phase_bandwidth_Hz: Annotated[Band, says("loop GF")] = 10.0
    rate_bandwidth_Hz: Annotated[Band, says("loop GR")] = 10.0
    quadrature_bandwidth_Hz: Annotated[Band, says("loop GQ")] = 5.0
    sampling_Hz: Annotated[Band, says("of the controllers")] = 1000.0
    delay_ms: Annotated[float, number("from the end of a sample to its force", least=0.0, below=1000.0)] = 1.0
    demodulator_Hz: Annotated[Band, says("low pass after demodulation")] = 200.0
    self_precession_deg_per_s: Annotated[float, number("commanded precession of a whole-angle wave")] = 0.0
    frequency_split_mHz: Annotated[float, number("Δω/2π held by the quadrature loop, besides [imperfection], [electrodes]", least=0.0, relative_sd=1.0)] = 5.0  # fmt: skip
    frequency_axis_deg: Annotated[float, number("θ_ω, of the higher frequency; ± 26 means unknown", sd=26.0)] = 0.0
    pickoff_gain_ratio: Annotated[float, number("g_x/g_y − 1, their mean 1", above=-0.5, below=0.5, sd=0.005)] = 0.0
    pickoff_phase_deg: Annotated[float, number("phase error of both", above=-25.0, below=25.0, sd=0.5)] = 0.0
    pickoff_phase_difference_deg: Annotated[float, number("between the two", above=-25.0, below=25.0, sd=0.1)] = 0.0
    pickoff_skew_mrad: Annotated[float, number("of the two axes from 90°, in n θ", above=-400.0, below=400.0, sd=1.0)] = 0.0  # fmt: skip
    drive_gain_ratio: Annotated[float, number("the same of the drives", above=-0.5, below=0.5, sd=0.005)] = 0.0
    drive_phase_deg: Annotated[float, number("likewise", above=-25.0, below=25.0, sd=0.5)] = 0.0
    drive_phase_difference_deg: Annotated[float, number("likewise", above=-25.0, below=25.0, sd=0.1)] = 0.0
    drive_skew_mrad: Annotated[float, number("likewise", above=-400.0, below=400.0, sd=1.0)] = 0.0
    misalignment_mrad: Annotated[float, number("misalignment of the drives to the pick-offs, on the shell", above=-200.0, below=200.0, sd=0.5)] = 0.0  # fmt: skip
    amplitude_V: Annotated[float, number("of the pick-offs at the commanded vibration; it scales the column drive_amplitude_V", above=0.0)] = 1.0  # fmt: skip
    quadrature_V_per_Hz: Annotated[float, number("quadrature_V per compensated split", above=0.0)] = 10.0
    pickoff_noise_uV_per_rt_Hz: Annotated[float, number("at the carrier, one-sided", least=0.0)] = 1.0
    adc_step_uV: Annotated[float, number("of a demodulated sample", least=0.0)] = 10.0
    rate_range_deg_per_s: Annotated[float, number("largest rate that the force can balance", above=0.0)] = 100.0
    quadrature_control: Annotated[Literal["force", "stiffness"], says("actuator of the quadrature; a force shares the range of the rate and leaks by phase errors")] = "force"  # fmt: skip
    quadrature_range_Hz: Annotated[float, number("largest split that the stiffness nulls", above=0.0)] = 1.0
    dac_bits: Annotated[int, number("over ± that range", least=2, most=32)] = 16
    drive_noise_ppm_per_rt_Hz: Annotated[float, number("of that range", least=0.0)] = 0.0
    drive_headroom: Annotated[float, number("largest drive over the steady-state drive, at reference", above=1.0)] = 20.0  # fmt: skip
    start_offset_Hz: Annotated[float, number("of the resonance from the oscillator at the start")] = 1.0
    vibration_um: Annotated[float, number("with modal_mass_mg: thermomechanical noise is known", above=0.0, example=1.0)] | None = None  # fmt: skip
    modal_mass_mg: Annotated[float, number("with vibration_um", above=0.0, example=500.0)] | None = None
    note: Note = ""

    def __post_init__(self) -> None:
        if (self.vibration_um is None) != (self.modal_mass_mg is None):
            raise ValueError("thermal noise needs both vibration_um and modal_mass_mg, or neither.")


TABLE = CardTable("loop", Loop, optional=True)
