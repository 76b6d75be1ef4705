"""What a gyro reads at given temperatures: frequency, zero-rate output and loss.

    f = f(T_r) (1 + …):  ln f = ln f(T_r) − ½ (ρ'/ρ + 3 α) (T_k − T_r) + ν' Σ n (T − T_r) + α Σ g (T − T_r) + s α_b (T_b − T_r) + effects,

T_r the mean temperature of the shell weighed with the mode's elastic energy, T_k with its kinetic energy, T_b that of the cell
next to the base, n the mode's density of ∂ ln f/∂ν, g and s its shares of expansion and of the base (shell.prestress): to first order in the unevenness of the shell, and nothing is divided by the whole slope, which vanishes in
an Elinvar alloy. The bias follows the *thermal* frequency: a spring or a clock moves only the reading.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from compensation.applied_rate import AppliedRate
from compensation.arrays import Array
from shell.constants import zero_Celsius
from studies.effects import apply_effects
from studies.effects.states import Lags, States
from studies.errors import InputError, naming
from studies.resonator.splitting import mean_shift
from studies.simulation.drive import Drive
from studies.simulation.heat_path import SENSOR, relax_behind_housing
from studies.simulation.loop import DEG_PER_H, settled_columns
from thermal.meridian import cell_names, energy_weights
from thermal.network import Network
from thermal.sweeping import cubic

if TYPE_CHECKING:
    from shell.law import FrequencyLaw
    from studies.instrument.card import Instrument
    from studies.instrument.tables.effect import EffectEntry
    from studies.loss.damping_law import DampingLaw


@dataclass(frozen=True)
class Temperatures:
    """Temperatures at the rows and their rates, (N, 6), K and K/s: housing, mean T_r, T_k − T_r, Σ n (T − T_r), Σ g (T − T_r), T_b − T_r."""

    value: Array
    rate: Array

    def moved(self, slope: Array, rate: Array, step: float) -> "Temperatures":
        """Return the temperatures a step along a derivative."""
        return Temperatures(self.value + step * slope, self.rate + step * rate)


def observed_rows(instrument: "Instrument", law: "FrequencyLaw", nodes: tuple[str, ...]) -> Array:
    """Sums over the nodes that make `Temperatures` and what the housing's sensor reads, (7, nodes); empty where they are no nodes."""
    rows = np.zeros((7, len(nodes)))
    if "housing" in nodes:
        rows[0, nodes.index("housing")] = 1.0
        rows[6, nodes.index(SENSOR if instrument.noise.housing_lag_s > 0 else "housing")] = 1.0
    if instrument.polynomial is not None:
        rows[1, [nodes.index(name) for name in cell_names(1)]] = 1.0
        return rows
    elastic = cell_weights(instrument, law)
    shares = (law.along.kinetic, law.along.nu, law.prestress.shares, law.prestress.held)
    cells = [nodes.index(name) for name in cell_names(len(elastic))]
    rows[1, cells] = elastic
    for row, share in zip(rows[2:6], shares, strict=True):
        found = to_cells(instrument, law, share)
        row[cells] = found - found.sum() * elastic
    return rows


def cell_weights(instrument: "Instrument", law: "FrequencyLaw") -> Array:
    """Share of the mode's elastic energy in each cell of the shell, from its root to its free end; they add up to 1."""
    weights = to_cells(instrument, law, law.along.elastic)
    return np.asarray(weights / weights.sum())


def to_cells(instrument: "Instrument", law: "FrequencyLaw", share: Array) -> Array:
    """Give what belongs to the stations of the mode to the cells of the shell, from its root to its free end."""
    cells, resonator = instrument.heat_path.cells, instrument.resonator
    from_start = 1 - law.along.position if resonator.support == "clamped-rim" else law.along.position
    root = resonator.length - cells.edge[-1]
    return energy_weights(cells, resonator.length * from_start - root, share)


def lags_of(instrument: "Instrument", law: "FrequencyLaw", network: Network) -> Lags:
    """Return the modes of the resonator behind its housing at the reference temperature: w = (c·v)(vᵀg)τ of the housing, (c·v)²τ of heat, c the cells' shares."""
    found = relax_behind_housing(network, instrument.reference_temperature)
    shares = np.ones(1) if instrument.polynomial is not None else cell_weights(instrument, law)
    seen = shares @ found.shapes[[found.nodes.index(name) for name in cell_names(len(shares))]]
    weights = np.stack([found.shapes.T @ found.coupling.sum(axis=1), seen]) * seen * found.time_constants
    weights /= weights.sum(axis=1, keepdims=True)
    kept = np.abs(weights).max(axis=0) > LEAST_MODE
    kept[0] = True
    housing, heat = (weights[:, kept] / weights[:, kept].sum(axis=1, keepdims=True)).tolist()
    return Lags(tuple(found.time_constants[kept].tolist()), tuple(housing), tuple(heat))


LEAST_MODE = 1e-3
"""Part that a mode of the heat path must have in what the resonator follows."""


def read_out(
    instrument: "Instrument",
    law: "FrequencyLaw",
    drive: Drive,
    found: Temperatures,
    lags: Lags,
    damping: "DampingLaw | None" = None,
    more_loss: float = 0.0,
) -> dict[str, Array]:
    """Columns of the record, without noise: °C, Hz, deg/h, 1, and quadrature; `lags` behind the housing, `more_loss` added to 1/Q."""
    reference = instrument.reference_temperature
    housing, resonator, *uneven = found.value.T
    if instrument.polynomial is not None:
        resonator = _earlier(drive.time, resonator, found.rate[:, 1], instrument.polynomial.delay)
    changes = _apply_effects(instrument, drive, housing, resonator, found.rate[:, 1], lags)
    warmed, rate = resonator, found.rate[:, 1]
    if "resonator_temperature" in changes:
        warmed = resonator + changes["resonator_temperature"]
        rate = rate + np.gradient(changes["resonator_temperature"], drive.time)
    slopes = law.uneven
    thermal = np.exp(law.logarithm(warmed) + slopes @ np.array(uneven))
    softened = thermal * (1 + mean_shift(instrument, warmed, drive.commands.get("voltage_squared")))
    frequency = softened + changes.get("frequency_Hz", 0.0)
    own = instrument.loss.at(warmed - reference) if damping is None else damping.inverse_q(warmed)
    inverse_q = own + changes.get("inverse_q", 0.0) + more_loss
    if not (inverse_q > 0).all():
        raise InputError(f"{instrument.path} [loss]: 1/Q becomes negative here; correct its slope or curvature.")
    wave = None if damping is None or damping.wave is None else damping.wave(warmed)
    change = thermal - float(law.frequency(reference))
    if instrument.polynomial is not None:
        change = instrument.polynomial.change_of_bias(change, warmed)
    slope, angle = (
        thermal * (law.slope(warmed) * rate + found.rate[:, 2:] @ slopes),
        drive.commands.get("pattern_angle"),
    )
    read = {"frequency_Hz": frequency, "inverse_q": inverse_q}
    if instrument.loop is None:
        read["bias_deg_per_h"] = instrument.bias.at(
            change, slope, frequency, inverse_q, law.bryan_factor, pattern_angle=angle, wave=wave
        ) + changes.get("bias_deg_per_h", 0.0)
    else:
        felt = instrument.bias.polynomial(change, slope) + changes.get("bias_deg_per_h", 0.0)
        free = instrument.loop.mode == "whole-angle"  # such a wave turns with all that feigns a rate
        applied, turning = drive.applied, drive.rate or AppliedRate.of(0.0, drive.time)
        read = settled_columns(
            instrument, frequency, inverse_q, law.bryan_factor, angle, wave, drive.time,
            turning.plus(drive.time, felt / DEG_PER_H) if free else applied, drive.wander, drive.means,
        )  # fmt: skip
        read["bias_deg_per_h"] += (0.0 if free else felt) - applied * DEG_PER_H
    return {"resonator_temperature_degC": warmed - zero_Celsius, **read}


def _earlier(time: Array, value: Array, rate: Array, delay: float) -> Array:
    """Values of a curve so much earlier (s), by the cubics through its values and rates; before its first row a straight line."""
    if not delay:
        return value
    at = np.maximum(time - delay, time[0])
    k = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    h = time[k + 1] - time[k]
    within = cubic((at - time[k]) / h, h, value[k], value[k + 1], rate[k], rate[k + 1])[0]
    return np.asarray(within + rate[0] * (time - delay - at))


def begun_in(effect: "EffectEntry", drive: Drive) -> float:
    """Time of an effect (s) at the start of a run: since its date, where both have one, else since the first run of the campaign."""
    return drive.start if effect.since is None or drive.moment is None else max(drive.moment - effect.since, 0.0)


def _apply_effects(
    instrument: "Instrument", drive: Drive, housing: Array, resonator: Array, rate: Array, lags: Lags
) -> Mapping[str, Array]:
    """Sum what the card's effects add to the resonator's temperature (K) and to the responses; they need even rows."""
    if not instrument.effects:
        return {}
    time = drive.time - drive.time[0]
    step = np.diff(time)
    even = time
    if np.ptp(step) > 1e-6 * step.max():
        even = np.linspace(0.0, time[-1], int(np.ceil(time[-1] / np.median(step))) + 1)

    def onto(values: Array) -> Array:
        return values if even is time else np.interp(even, time, values)

    standing = {"pattern_angle": np.full(len(time), np.radians(instrument.bias.pattern_angle_deg))}
    driven: dict[str, Any] = {name: onto(values) for name, values in (standing | dict(drive.commands)).items()}
    states = States(
        run=0,
        time=even,
        campaign_time=even + drive.start,
        housing=onto(housing),
        resonator=onto(resonator),
        known_rate=onto(rate),
        lags=lags,
        reference=instrument.reference_temperature,
        **driven,
    )
    with naming(f"{instrument.path} [[effect]]"):
        changes = apply_effects(
            [(one.name, one.response, one.parameters, begun_in(one, drive)) for one in instrument.effects], states
        )
    return changes if even is time else {name: np.interp(time, even, values) for name, values in changes.items()}
