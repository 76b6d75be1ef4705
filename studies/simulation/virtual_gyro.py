"""A card and a chamber profile become a record: temperatures, frequency, zero-rate output, loss, noise."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from shell.law import FrequencyLaw
from studies.errors import InputError, naming
from studies.instrument.tables.noise import SILENT
from studies.law import law_of
from studies.record import Record
from studies.simulation.chamber import ZERO_CELSIUS, check_profile
from studies.simulation.heat_path import build_network, slowest_lag
from studies.simulation.noise import bias_noise, frequency_noise, quantise, white_noise
from thermal.lag import lag
from thermal.meridian import cell_names, energy_weights
from thermal.network import Network
from thermal.profile import Profile
from thermal.radiative import simulate
from thermal.transient import Transient

if TYPE_CHECKING:
    from shell.levels import Theory
    from studies.instrument.card import Instrument
    from studies.instrument.tables.noise import Noise

Array = NDArray[np.float64]
MOST_ROWS = 40_000_000
DIGITS = {
    # decimals that are recorded, far below any noise
    "time_s": 9,
    "chamber_temperature_degC": 6,
    "housing_temperature_degC": 6,
    "resonator_temperature_degC": 6,
    "frequency_Hz": 8,
    "bias_deg_per_h": 6,
    "inverse_q": 16,
}
MARGIN = 10.0  # K beyond the profile in which the frequency stays known: effects and self-heating


@dataclass(frozen=True)
class VirtualRun:
    """A simulated run: its record, and what it was made of."""

    record: Record
    network: Network
    transient: Transient
    law: FrequencyLaw
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Noiseless:
    """Columns before noise: s, K, K, Hz, deg/h, 1."""

    time: Array
    housing: Array
    resonator: Array
    frequency: Array
    bias: Array
    inverse_q: Array


def simulate_run(
    instrument: "Instrument",
    profile: Profile,
    rate: float = 1.0,
    seed: int = 0,
    noise: bool = True,
    theory: "Theory" = "solid",
    law: FrequencyLaw | None = None,
) -> VirtualRun:
    """Run a virtual gyro through a chamber profile.

    Parameters
    ----------
    instrument : Instrument
        With optional tables `[thermal]`, `[loss]`, `[bias]`, `[noise]` and `[[effect]]`.
    profile : Profile
        Chamber temperature (K); the gyro has settled at its first value.
    rate : float
        Rows per second.
    seed : int
        Of the noise.
    noise : bool
        False records what is true, without noise, sensor lag or rounding.
    theory : str
        Of the shell: "solid" or "shell".
    law : FrequencyLaw, optional
        One that was built before for the same instrument.

    Raises
    ------
    InputError, ThermalError, ShellError
        An unusable table or effect; a profile that leaves the range of the material.
    """
    check_profile(profile, instrument)
    time = _rows(profile, rate)
    levels = instrument.noise if noise else SILENT
    network = build_network(instrument)
    transient = simulate(network, {"chamber": profile})
    reached = np.append(profile.value, instrument.reference_temperature)
    low, high = float(reached.min()) - MARGIN, float(reached.max()) + MARGIN
    law = law or law_of(instrument, low, high, theory)
    true = _respond(instrument, network, transient, law, time)
    generator = np.random.default_rng(seed)
    columns = _observe(true, levels, rate, generator)
    columns = {"time_s": time, "chamber_temperature_degC": profile.at(time) - ZERO_CELSIUS, **columns}
    for name, values in columns.items():
        np.round(values, DIGITS[name], out=values)
    resolution = {
        "frequency_Hz": levels.frequency_resolution_Hz,
        "bias_deg_per_h": levels.bias_resolution_deg_per_h,
        "housing_temperature_degC": levels.housing_resolution_degC,
    }
    record = Record(
        columns,
        instrument=instrument.name,
        source=f"simulated, rate {rate:g} Hz, " + (f"seed {seed}" if noise else "without noise"),
        resolution={name: step for name, step in resolution.items() if step > 0},
    )
    return VirtualRun(record, network, transient, law, _idle_effects(instrument))


def cell_weights(instrument: "Instrument", law: FrequencyLaw) -> Array:
    """Share of the mode's elastic energy in each cell of the shell, from its root to its free end; they add up to 1."""
    weights = _to_cells(instrument, law, law.along.elastic)
    return np.asarray(weights / weights.sum())


def cell_sensitivities(instrument: "Instrument", law: FrequencyLaw) -> Array:
    """Contribution to d ln f/dT (1/K) of each cell of the shell, from its root to its free end."""
    return _to_cells(instrument, law, law.sensitivity())


def _to_cells(instrument: "Instrument", law: FrequencyLaw, share: Array) -> Array:
    cells, resonator = instrument.heat_path.cells, instrument.resonator
    from_start = 1 - law.along.position if resonator.support == "clamped-rim" else law.along.position
    root = resonator.length - cells.edge[-1]
    return energy_weights(cells, resonator.length * from_start - root, share)


def _observed_rows(instrument: "Instrument", transient: Transient, law: FrequencyLaw) -> Array:
    """Sums over the nodes: the housing, the resonator's mean, and δ ln f of what departs from the mean."""
    mean, sensitivity = cell_weights(instrument, law), cell_sensitivities(instrument, law)
    rows = np.zeros((3, len(transient.nodes)))
    cells = [transient.nodes.index(name) for name in cell_names(len(mean))]
    rows[0, transient.nodes.index("housing")] = 1.0
    rows[1, cells] = mean
    rows[2, cells] = sensitivity - sensitivity.sum() * mean
    return rows


def _respond(
    instrument: "Instrument", network: Network, transient: Transient, law: FrequencyLaw, time: Array
) -> _Noiseless:
    T = transient.observe(time, _observed_rows(instrument, transient, law))
    housing, resonator = np.ascontiguousarray(T[:, 0]), np.ascontiguousarray(T[:, 1])
    changes = _apply_effects(instrument, network, time, housing, resonator)
    resonator = resonator + changes.get("resonator_temperature", 0.0)
    reference = instrument.reference_temperature
    # The bias follows the temperature, for which the thermal frequency stands; a spring or a clock moves only the reading.
    thermal = law.frequency(resonator) * np.exp(T[:, 2])
    frequency = thermal + changes.get("frequency_Hz", 0.0)
    inverse_q = instrument.loss.at(resonator - reference) + changes.get("inverse_q", 0.0)
    if not (inverse_q > 0).all():
        raise InputError(
            f"{instrument.path} [loss]: 1/Q becomes negative in this profile; correct its slope or curvature."
        )
    change = thermal - float(law.frequency(np.array([reference]))[0])
    rate = np.gradient(change, time[1] - time[0])
    bias = instrument.bias.at(change, rate, frequency, inverse_q, law.bryan_factor)
    return _Noiseless(time, housing, resonator, frequency, bias + changes.get("bias_deg_per_h", 0.0), inverse_q)


def _observe(true: _Noiseless, levels: "Noise", rate: float, generator: np.random.Generator) -> dict[str, Array]:
    """Return the columns as they are read: sensor lag, noise, rounding. The resonator's temperature stays true."""
    count = len(true.time)
    sensed = lag(true.time, true.housing, levels.housing_lag_s) if levels.housing_lag_s > 0 else true.housing
    sensed = sensed + white_noise(count, rate, levels.housing_white_K, generator) - ZERO_CELSIUS
    frequency = true.frequency + frequency_noise(levels).draw(count, rate, generator)
    bias = true.bias + bias_noise(levels).draw(count, rate, generator)
    loss = true.inverse_q * (1 + white_noise(count, rate, levels.inverse_q_white, generator))
    return {
        "housing_temperature_degC": quantise(sensed, levels.housing_resolution_degC),
        "resonator_temperature_degC": true.resonator - ZERO_CELSIUS,
        "frequency_Hz": quantise(frequency, levels.frequency_resolution_Hz),
        "bias_deg_per_h": quantise(bias, levels.bias_resolution_deg_per_h),
        "inverse_q": loss,
    }


def _apply_effects(
    instrument: "Instrument", network: Network, time: Array, housing: Array, resonator: Array
) -> dict[str, Array]:
    """Sum what the card's `[[effect]]` tables add to the resonator's temperature (K) and to the responses."""
    if not instrument.effects:
        return {}
    from studies.diagnosis.effects import apply_effects
    from studies.diagnosis.states import States

    reference = instrument.reference_temperature
    states = States(
        run=0,
        time=time - time[0],
        campaign_time=time - time[0],
        housing=housing,
        resonator=resonator,
        tau=slowest_lag(network, reference),
        reference=reference,
    )
    with naming(f"{instrument.path} [[effect]]"):
        return apply_effects([(one.name, one.response, one.parameters) for one in instrument.effects], states)


def _idle_effects(instrument: "Instrument") -> tuple[str, ...]:
    """Name the effects whose drive (amplitude, voltage, quadrature, azimuth) a virtual run does not move."""
    if not instrument.effects:
        return ()
    from studies.diagnosis.effects import find_effect

    return tuple(
        f"the effect '{effect.name}' adds nothing: a virtual run does not move its drive"
        f" ({', '.join(find_effect(effect.name).needs)})."
        for effect in instrument.effects
        if find_effect(effect.name).needs
    )


def _rows(profile: Profile, rate: float) -> Array:
    if not (np.isfinite(rate) and rate > 0):
        raise InputError(f"--rate {rate:g}: the rate must be positive (rows per second).")
    count = int(np.floor((profile.end - profile.start) * rate * (1 + 1e-12))) + 1
    if count > MOST_ROWS:
        raise InputError(f"--rate {rate:g} makes {count} rows; choose a lower rate (at most {MOST_ROWS} rows).")
    if count < 2:
        raise InputError(f"--rate {rate:g} makes a single row; choose a higher rate.")
    return np.minimum(profile.start + np.arange(count) / rate, profile.end)
