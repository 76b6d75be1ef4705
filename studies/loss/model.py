"""Loss budget of an instrument: from its card to the causes of loss of one solved mode."""

import cmath
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from numpy.typing import ArrayLike

from shell.constants import zero_Celsius
from shell.damping.anchor import anchor_loss, unbalance_loss
from shell.damping.anisotropy import Complex, Ripple, damping_wave, surface_weight
from shell.damping.budget import (
    Budget,
    LossCause,
    activated_cause,
    bulk_cause,
    constant_cause,
    gas_cause,
    loss_budget,
    surface_cause,
    thermoelastic_cause,
)
from shell.damping.faces import Vibration
from shell.damping.gas import GASES, gas_loss, mean_free_path, most_squeezed
from shell.damping.heat import Heat
from shell.damping.sources import known_losses
from shell.gas_inertia import gas_shift
from shell.imperfection import Pair
from shell.layout import Theory
from shell.modes import Mode
from studies.errors import InputError, naming, nearest
from studies.instrument.card import Card, Instrument, load_card
from studies.instrument.tables.loss_parts import LossParts
from studies.loss.films import film_losses
from studies.resonator.splitting import solve_lowest


@dataclass(frozen=True)
class LossModel:
    """The causes of loss of one mode of an instrument."""

    vibration: Vibration  # the solved mode
    causes: tuple[LossCause, ...]  # what loses energy, with uncertainty and source
    left_out: tuple[str, ...]  # sentences on what the budget does not have, and what would bring it in
    ripples: tuple[Ripple, ...]  # how parts vary around the axis
    # bryan_factor, frequency: of the mode, Hz at the reference temperature.
    bryan_factor: float
    frequency: float

    @property
    def harmonic(self) -> int:
        """N of the mode."""
        return self.vibration.solution.system.n

    def wave(self, budget: Budget) -> Complex:
        """Δ(1/Q) exp(2 i n θ_τ) over the budget's temperatures; 0 where nothing varies around."""
        return damping_wave(budget, self.ripples, self.harmonic)

    def budget(self, temperatures: ArrayLike) -> Budget:
        """The budget at temperatures (K)."""
        return loss_budget(self.vibration, self.causes, temperatures)


def loss_model(
    card: Card, harmonic: int = 2, theory: Theory = "solid", anchor: bool = False,
    mode: Mode | None = None,
) -> LossModel:  # fmt: skip
    """Solve the lowest mode of a harmonic and gather its causes of loss; the `anchor`, what a stem sends into its base,
    takes a second or two. `mode`: where it is known, at the reference temperature.
    """
    instrument = load_card(card)
    if anchor and instrument.resonator.stem is None:
        raise InputError(f"--anchor: the anchor loss is what a stem sends into its base, and {instrument.name} has no stem; leave it out.")  # fmt: skip
    T0, material = instrument.reference_temperature, instrument.material
    mode = mode or solve_lowest(instrument.resonator, material.elastic(T0), harmonic, theory)
    vibration = Vibration(mode.solution, mode.resonator, material, T0)
    parts: LossParts = instrument.part("loss", "loss_parts")
    uncertain = [v for v in instrument.uncertain if v.name.startswith("loss.") and v.value]
    spread = {v.name: v.sd / abs(v.value) for v in uncertain}
    heat, lacking = _heat_law(instrument)
    causes: list[LossCause] = []
    left_out: list[str] = []
    ripples: list[Ripple] = []
    with naming(f"{instrument.path} [loss]"):
        if heat is None:
            left_out.append(f"thermoelastic: no source states {lacking} of {material.name}; give it in [thermal] or a material file.")  # fmt: skip
        else:
            causes.append(_thermoelastic(instrument, vibration, heat))
        causes += _of_material(instrument, parts, spread, left_out)
        for number, keys in enumerate(parts.film):
            place = f"{instrument.path} [[loss.film]] number {number + 1}"
            found, waves = film_losses(keys, vibration, heat, place, f"loss.film.{number}", spread)
            if any(cause.name == found[0].name for cause in causes):  # another film of the same material
                found = [replace(cause, name=f"{cause.name} ({number + 1})") for cause in found]
                waves = [replace(wave, part=f"{wave.part} ({number + 1})") for wave in waves]
            causes += found
            ripples += waves
        ripples += _surface_ripple(parts, vibration, causes)
        causes += _others(instrument, mode, vibration, parts, spread, left_out)
        causes += _ohmic(instrument, mode)
        first, third = _rim_harmonics(instrument, parts)
        if anchor or first or third:
            through_stem, unequal = _anchor(instrument, mode, (first, third), spread, anchor)
            causes += through_stem
            ripples += unequal
        elif instrument.resonator.stem is not None and parts.anchor_inverse_q is None:
            left_out.append("anchor: give --anchor to compute the loss through the stem into the base.")
    if not causes:
        raise InputError(f"{instrument.path} [loss]: it states no loss of energy. {' '.join(left_out)}")
    return LossModel(vibration, tuple(causes), tuple(left_out), tuple(ripples), mode.bryan_factor, mode.frequency)


def _thermoelastic(instrument: Instrument, vibration: Vibration, heat: Callable[[float], Heat]) -> LossCause:
    T0, material = instrument.reference_temperature, instrument.material
    prior = dict(zip(material.prior.names, material.prior.sd, strict=True))
    thermal = {
        one.name: one.sd / one.value for one in instrument.uncertain if one.name.startswith("thermal.") and one.value
    }
    expansion = float(prior.get("expansion.value", 0.0)) / abs(float(material.value("expansion", T0)) or 1.0)
    capacity = thermal.get("thermal.heat_capacity_J_per_kg_K", 0.0)
    relative = expansion, capacity, thermal.get("thermal.conductivity_W_per_m_K", 0.0)
    return thermoelastic_cause(
        vibration, heat, relative, f"heat conduction through the wall; {material.name}, law {material.law}"
    )


def _heat_law(instrument: Instrument) -> tuple[Callable[[float], Heat] | None, str]:
    material, thermal = instrument.material, instrument.thermal
    given = {"conductivity": thermal.conductivity_W_per_m_K, "heat_capacity": thermal.heat_capacity_J_per_kg_K}
    lacking = [name for name in ("expansion", "density") if name not in material.properties]
    lacking += [name for name, value in given.items() if value is None and name not in material.properties]
    if lacking:
        return None, " or ".join(name.replace("_", " ") for name in lacking)

    def value(name: str, temperature: float) -> float:
        stated = given.get(name)
        return float(material.value(name, temperature)) if stated is None else stated

    def heat(temperature: float) -> Heat:
        capacity = value("density", temperature) * value("heat_capacity", temperature)
        return Heat(value("expansion", temperature), capacity, value("conductivity", temperature))

    return heat, ""


def _of_material(
    instrument: Instrument, parts: LossParts, spread: Mapping[str, float], left_out: list[str]
) -> list[LossCause]:

    known, causes = known_losses(instrument.material.name), []
    bulk: Mapping[str, Any] = known.get("bulk", {})
    if parts.bulk_coefficient is not None:
        exponent = parts.bulk_exponent if parts.bulk_exponent is not None else bulk.get("exponent", 0.0)
        causes.append(
            bulk_cause(parts.bulk_coefficient, exponent, spread.get("loss.bulk_coefficient", 0.0), "given in the card")
        )
    elif bulk:
        causes.append(bulk_cause(bulk["coefficient"], bulk["exponent"], bulk["relative_sd"], bulk["source"]))
    else:
        left_out.append(f"bulk: no source states that of {instrument.material.name}; give bulk_coefficient.")
    treatment = parts.surface_treatment
    surface: Mapping[str, Any] = known.get("surface", {})
    if treatment is not None:
        of_treatment: Mapping[str, Any] = known.get("treatment", {})
        if parts.surface_layer_pm is not None or treatment not in of_treatment:
            raise InputError(
                f"{instrument.path} [loss]: surface_treatment = '{treatment}' stands alone and is of those that hrg materials"
                f" {instrument.material.name} lists; else give surface_layer_pm{nearest(treatment, of_treatment)}"
            )
        surface = of_treatment[treatment]
    if parts.surface_layer_pm is not None:
        depth = 1e-12 * parts.surface_layer_pm
        causes.append(surface_cause(depth, spread.get("loss.surface_layer_pm", 0.0), "given in the card"))
    elif surface:
        causes.append(surface_cause(surface["depth_m"], surface["relative_sd"], surface["source"]))
    else:
        left_out.append(f"surface: no source states that of {instrument.material.name}; give surface_layer_pm.")
    return causes


def _ohmic(instrument: Instrument, mode: Mode) -> list[LossCause]:
    """What the bias currents of charged electrodes lose in the resistances of [electrodes]."""
    card = instrument.part("electrodes")
    if not (card.are_charged and card.keys.resistance_ohm and mode.harmonic):
        return []
    value = card.on(Pair(mode), instrument.reference_temperature).ohmic_loss(card.keys.resistance_ohm)
    source = "bias currents through resistance_ohm of [electrodes], as given in the card"
    return [constant_cause("electrodes", value, GAP_SD, source, "less bias, a wider gap or a smaller resistance")]


def _surface_ripple(parts: LossParts, vibration: Vibration, causes: Sequence[LossCause]) -> list[Ripple]:
    if parts.surface_anisotropy is None or not any(cause.name == "surface" for cause in causes):
        return []
    angle = math.radians(parts.surface_anisotropy_angle_deg)
    return [Ripple("surface", parts.surface_anisotropy, angle, surface_weight(vibration.surfaces))]


_unbalance = lru_cache(maxsize=8)(unbalance_loss)  # kept, since many values of a card leave it as it is


def _others(
    instrument: Instrument, mode: Mode, vibration: Vibration, parts: LossParts, spread: Mapping[str, float],
    left_out: list[str],
) -> list[LossCause]:  # fmt: skip
    """Gas, activated losses, and what leaves through the mount as the card gives it."""
    causes = []
    if parts.pressure_Pa is None:
        left_out.append("gas: give pressure_Pa of the sealed housing.")
    elif parts.pressure_Pa > 0:
        sd = spread.get("loss.pressure_Pa", 0.0)
        gas, p, T0 = GASES[parts.gas], parts.pressure_Pa, vibration.reference
        causes.append(gas_cause(vibration, gas, p, sd, parts.accommodation))
        if mode.theory == "solid" and mode.harmonic and mean_free_path(gas, p, T0) < vibration.resonator.size:
            sound = -2 * gas_shift(mode, gas, p, T0).imag
            left_out.append(f"sound: a closed housing keeps it in; in the open it adds 1/Q = {sound:.2g}.")
        if "electrodes" in instrument.content:
            keys = instrument.part("electrodes").keys
            most = most_squeezed(vibration, keys.face, 1e-6 * keys.gap_um, p, T0)
            times = most / gas_loss(vibration, gas, p, T0, parts.accommodation)
            words = "gas squeezed in the gap of the electrodes, most of it near their ends: it adds at most"
            left_out.append(f"{words} 1/Q = {most:.2g} at {keys.gap_um:g} µm, {times:.2g} times the gas counted.")
    for number, peak in enumerate(parts.activated):
        sd = spread.get(f"loss.activated.{number}.height", 0.0)
        found = activated_cause(peak.height, peak.energy_eV, peak.peak_degC + zero_Celsius, sd, "given in the card")
        causes.append(found)
    if parts.anchor_inverse_q is not None:
        sd = spread.get("loss.anchor_inverse_q", 0.0)
        causes.append(constant_cause("mount", parts.anchor_inverse_q, sd, "given in the card", MOUNT_ADVICE))
    return causes


GAP_SD = 0.2  # relative, of the loss by electrodes: it goes as 1/g⁴, and a gap is known to 5 %
MOUNT_ADVICE = "a longer or thinner stem, a stiffer joint, balance of the rim's first and third harmonic"


def _anchor(
    instrument: Instrument, mode: Mode, rim: tuple[complex, complex], spread: Mapping[str, float], balanced: bool
) -> tuple[list[LossCause], list[Ripple]]:
    """What the stem sends into a half-space of the resonator's own material: of the balanced mode, and of its imbalance."""
    elastic, causes, ripples = instrument.material.elastic(instrument.reference_temperature), [], []
    source = "waves in a half-space of the same material, with an absorbing layer"
    if balanced:
        causes.append(constant_cause("anchor", anchor_loss(mode, elastic).inverse_q, 0.5, source, MOUNT_ADVICE))
    if any(rim) and mode.harmonic == 2:
        found = _unbalance(mode, elastic)
        loss, wave = found.inverse_q(*rim), found.wave(*rim)
        # the squares of the masses count
        sd = 2 * max(spread.get(f"loss.{key}", 0.0) for key in ("unbalance_mg", "third_unbalance_mg"))
        causes.append(constant_cause("imbalance", loss, sd, source, MOUNT_ADVICE))
        if wave:
            # between a pattern that loses twice the mean and one that loses nothing at most
            ripples.append(Ripple("imbalance", min(abs(wave) / (2 * loss), 1.0), cmath.phase(wave) / 4, 2.0))
    return causes, ripples


def _rim_harmonics(instrument: Instrument, parts: LossParts) -> tuple[complex, complex]:
    """Σ m exp(iθ) and Σ m exp(3iθ) of the rim (kg): as the card gives them, and of its small masses there."""
    given = (
        (parts.unbalance_mg, parts.unbalance_azimuth_deg, 1),
        (parts.third_unbalance_mg, parts.third_unbalance_azimuth_deg, 3),
    )
    first, third = (1e-6 * (mass or 0.0) * cmath.exp(1j * k * math.radians(at)) for mass, at, k in given)
    imperfection = instrument.part("imperfection")
    if imperfection is not None and imperfection.fields is not None and instrument.resonator.stem is not None:
        for one in imperfection.fields.masses:
            if one.position > ON_RIM:
                first += one.mass * cmath.exp(1j * one.azimuth)
                third += one.mass * cmath.exp(3j * one.azimuth)
    return first, third


ON_RIM = 0.95  # position beyond which a small mass moves as the rim does
