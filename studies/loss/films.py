"""Films of a card ([[loss.film]]): their numbers, their losses, and what each does to a frequency by its stiffness and mass."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from shell.damping.anisotropy import Ripple, film_weight
from shell.damping.budget import LossCause, film_causes
from shell.damping.faces import Vibration
from shell.damping.film import Film, check_film, film_shift, thickness_power
from shell.damping.heat import Heat
from shell.damping.sources import film_names, known_film
from shell.modes import Mode
from studies.errors import InputError, naming
from studies.instrument.card import Instrument
from studies.instrument.tables.loss_parts import FilmKeys

ELASTIC = ("youngs_modulus_GPa", "poisson_ratio", "density_kg_m3")
LOSSY = ("youngs_modulus_GPa", "poisson_ratio", "loss")
THERMAL = ("expansion_per_K", "conductivity_W_per_m_K")
CAPACITY = ("heat_capacity_J_per_kg_K", "density_kg_m3")
ALL = (*LOSSY, *THERMAL, *CAPACITY)


@dataclass(frozen=True)
class FilmShift:
    """What one film does to a mode: δf/f, or None with the keys that no source states of it."""

    material: str
    relative: float | None
    missing: tuple[str, ...] = ()


def film_numbers(keys: FilmKeys, names: Iterable[str]) -> dict[str, Any]:
    """Return the named numbers of a film, from the card or else from the table of films; None where neither has them."""
    known = known_film(keys.material)
    given = {name: getattr(keys, name) for name in names}
    return {name: known.get(name) if value is None else value for name, value in given.items()}


def film_shifts(instrument: Instrument, mode: Mode) -> tuple[FilmShift, ...]:
    """Return what every film of the card does to a mode, to first order in its thickness."""
    found = []
    for keys in instrument.part("loss", "loss_parts").film:
        numbers = film_numbers(keys, ALL)
        missing = tuple(name for name in ELASTIC if numbers[name] is None)
        relative = None if missing else film_shift(mode, _build_film(keys, numbers))
        found.append(FilmShift(keys.material, relative, missing))
    return tuple(found)


def film_losses(
    keys: FilmKeys, vibration: Vibration, heat: Callable[[float], Heat] | None, where: str, name: str,
    spread: Mapping[str, float],
) -> tuple[list[LossCause], list[Ripple]]:  # fmt: skip
    """Return a film's causes of loss, and how they vary around."""
    known = known_film(keys.material)
    numbers = film_numbers(keys, ALL)
    missing = [key for key in LOSSY if numbers[key] is None]
    if missing:
        listed = "" if known else f" (films of the table: {', '.join(film_names())})"
        raise InputError(f"{where}: no source states {' and '.join(missing)} of the film '{keys.material}'{listed}; add it.")  # fmt: skip
    with naming(where):
        relative = (spread.get(f"{name}.thickness_nm", 0.0), spread.get(f"{name}.loss", 0.0))
        film = _build_film(keys, numbers)
        check_film(film, vibration.thinnest)
        causes = film_causes(keys.material, film, heat, relative, str(known.get("source", "given in the card")))
        if keys.anisotropy is None:
            return causes, []
        angle = math.radians(keys.anisotropy_angle_deg)
        waves = [Ripple(causes[0].name, keys.anisotropy, angle, film_weight(film, vibration.faces))]
        if len(causes) > 1 and heat is not None:  # heat follows ε_s + ε_θ alone
            T0 = vibration.reference
            power = thickness_power(film, heat(T0), float(vibration.omega(T0)))
            waves.append(Ripple(causes[1].name, keys.anisotropy, angle, power))
        return causes, waves


def _build_film(keys: FilmKeys, numbers: Mapping[str, Any]) -> Film:
    """The film; its capacity per volume (J/(m³ K)) in the table counts where there is none per mass."""
    heat, capacity = None, known_film(keys.material).get("heat_capacity_J_per_m3_K")
    if all(numbers[key] is not None for key in CAPACITY):
        capacity = numbers["density_kg_m3"] * numbers["heat_capacity_J_per_kg_K"]
    if capacity is not None and all(numbers[key] is not None for key in THERMAL):
        heat = Heat(numbers["expansion_per_K"], capacity, numbers["conductivity_W_per_m_K"])
    return Film(
        1e-9 * keys.thickness_nm, 1e9 * numbers["youngs_modulus_GPa"], numbers["poisson_ratio"],
        numbers["loss"] or 0.0, heat, ("inner", "outer") if keys.face == "both" else (keys.face,),
        (keys.from_position, keys.to_position), keys.coverage, numbers["density_kg_m3"] or 0.0,
    )  # fmt: skip
