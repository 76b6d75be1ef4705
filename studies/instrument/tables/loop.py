"""`[loop]`: the loops that read the gyro, and the errors of their electronics. A card with it has its bias from them.

[loop]                                # every key may be left out; the uncertainties hold where the table stands
mode = "force-rebalance"              # or "whole-angle"
amplitude_bandwidth_Hz = 1.0          # loops GA, GF, GR, GQ of the BVG paper: where the open loop has gain 1
phase_bandwidth_Hz = 10.0
rate_bandwidth_Hz = 10.0
quadrature_bandwidth_Hz = 5.0
sampling_Hz = 1000.0                  # of the controllers
delay_ms = 1.0                        # from the end of a sample to its force
demodulator_Hz = 200.0                # low pass after demodulation
self_precession_deg_per_s = 0.0       # commanded turn of a whole-angle wave
frequency_split_mHz = 5.0             # Δω/2π that the quadrature loop holds, besides [imperfection], [electrodes]; ± 100 %
frequency_axis_deg = 0.0              # θ_ω, of the higher frequency; ± 13
pickoff_gain_ratio = 0.0              # g_x/g_y − 1; ± 0.005                the same keys with drive_ in the place of pickoff_
pickoff_phase_deg = 0.0               # phase error of both; ± 0.5
pickoff_phase_difference_deg = 0.0    # between the two; ± 0.1
pickoff_skew_mrad = 0.0               # of the two axes from square, in n θ; ± 1
misalignment_mrad = 0.0               # turn of the drives against the pick-offs, on the shell; ± 0.5
amplitude_V = 1.0                     # of the pick-offs at the commanded vibration; the column drive_amplitude_V counts by it
quadrature_V_per_Hz = 10.0            # quadrature_V per held split
pickoff_noise_uV_per_rt_Hz = 1.0      # at the carrier, one-sided
adc_step_uV = 10.0                    # of a demodulated sample
rate_range_deg_per_s = 100.0          # largest rate the force can hold
quadrature_control = "force"          # or "stiffness": what nulls quadrature; a force shares the range with the rate and leaks by phase errors
quadrature_range_Hz = 1.0             # largest split that the stiffness nulls
dac_bits = 16                         # over ± that range
drive_noise_ppm_per_rt_Hz = 0.0       # of that range
drive_headroom = 20.0                 # largest drive of the amplitude over what holds it at the reference temperature
start_offset_Hz = 1.0                 # of the resonance from where the oscillator starts
vibration_um, modal_mass_mg           # with both, thermomechanical noise is known
"""

from typing import Annotated, Literal

from studies.instrument.registry import CardTable
from studies.schema.keys import Keys, number

Band = Annotated[float, number(above=0.0)]


class Loop(Keys, frozen=True, kw_only=True):
    """Loops of the gyro and the errors of their electronics, in the units of the keys."""

    mode: Literal["force-rebalance", "whole-angle"] = "force-rebalance"
    amplitude_bandwidth_Hz: Band = 1.0
    phase_bandwidth_Hz: Band = 10.0
    rate_bandwidth_Hz: Band = 10.0
    quadrature_bandwidth_Hz: Band = 5.0
    sampling_Hz: Band = 1000.0
    delay_ms: Annotated[float, number(least=0.0, below=1000.0)] = 1.0
    demodulator_Hz: Band = 200.0
    self_precession_deg_per_s: float = 0.0
    frequency_split_mHz: Annotated[float, number(least=0.0, relative_sd=1.0)] = 5.0
    frequency_axis_deg: Annotated[float, number(sd=13.0)] = 0.0
    pickoff_gain_ratio: Annotated[float, number(above=-0.5, below=0.5, sd=0.005)] = 0.0
    pickoff_phase_deg: Annotated[float, number(above=-25.0, below=25.0, sd=0.5)] = 0.0
    pickoff_phase_difference_deg: Annotated[float, number(above=-25.0, below=25.0, sd=0.1)] = 0.0
    pickoff_skew_mrad: Annotated[float, number(above=-400.0, below=400.0, sd=1.0)] = 0.0
    drive_gain_ratio: Annotated[float, number(above=-0.5, below=0.5, sd=0.005)] = 0.0
    drive_phase_deg: Annotated[float, number(above=-25.0, below=25.0, sd=0.5)] = 0.0
    drive_phase_difference_deg: Annotated[float, number(above=-25.0, below=25.0, sd=0.1)] = 0.0
    drive_skew_mrad: Annotated[float, number(above=-400.0, below=400.0, sd=1.0)] = 0.0
    misalignment_mrad: Annotated[float, number(above=-200.0, below=200.0, sd=0.5)] = 0.0
    amplitude_V: Annotated[float, number(above=0.0)] = 1.0
    quadrature_V_per_Hz: Annotated[float, number(above=0.0)] = 10.0
    pickoff_noise_uV_per_rt_Hz: Annotated[float, number(least=0.0)] = 1.0
    adc_step_uV: Annotated[float, number(least=0.0)] = 10.0
    rate_range_deg_per_s: Annotated[float, number(above=0.0)] = 100.0
    quadrature_control: Literal["force", "stiffness"] = "force"
    quadrature_range_Hz: Annotated[float, number(above=0.0)] = 1.0
    dac_bits: Annotated[int, number(least=2, most=32)] = 16
    drive_noise_ppm_per_rt_Hz: Annotated[float, number(least=0.0)] = 0.0
    drive_headroom: Annotated[float, number(above=1.0)] = 20.0
    start_offset_Hz: float = 1.0
    vibration_um: Annotated[float, number(above=0.0)] | None = None
    modal_mass_mg: Annotated[float, number(above=0.0)] | None = None
    note: str = ""

    def __post_init__(self) -> None:
        if (self.vibration_um is None) != (self.modal_mass_mg is None):
            raise ValueError(
                "thermal noise needs both vibration_um and modal_mass_mg; add the other, or leave out both."
            )


TABLE = CardTable("loop", Loop, optional=True)
