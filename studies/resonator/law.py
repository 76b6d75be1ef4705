"""The frequency law of an instrument: what a simulation, a diagnosis, a study and a page take f(T) from."""

from collections.abc import Mapping
from dataclasses import replace
from math import inf
from typing import TYPE_CHECKING, cast

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from shell.errors import ShellError
from studies.errors import InputError, naming
from studies.instrument.card import load_card
from studies.instrument.material_values import LAW, scaled_by
from studies.instrument.tables.material import GIVEN

if TYPE_CHECKING:
    from shell.law import FrequencyLaw
    from shell.layout import Theory
    from shell.material import Material, Mount
    from studies.instrument.card import Card, Instrument
    from studies.instrument.uncertain import UncertainValue

BEYOND = 1.0  # K by which a run may leave the records
SLOPE_KEYS = {"youngs_modulus": "log_slope_per_K", "shear_modulus": "log_slope_per_K", "expansion": "value"}


def law_of(
    card: "Card", lowest: float = -inf, highest: float = inf, theory: "Theory" = "solid", harmonic: int = 2
) -> "FrequencyLaw":
    """Build the frequency law of a card between two temperatures (K), within its material's range: over all of it unless given."""
    instrument = load_card(card)
    if instrument.polynomial is not None:
        return cast("FrequencyLaw", instrument.polynomial.between(lowest, highest))
    from shell.law import build_law

    T0, mount = instrument.reference_temperature, mount_of(instrument, theory, harmonic)
    return build_law(instrument.resonator, known_material(instrument), T0, lowest, highest, theory, harmonic, mount)


def known_material(instrument: "Instrument") -> "Material":
    """Return the material with what card and table leave open of its law: values that the card gives, and deviations, with the uncertainty that it states."""
    from shell.material import Prior

    material = instrument.material
    values = [one for one in instrument.uncertain if one.name.startswith("material.")]
    ways = [_moved_by(material, one) for one in values]
    names = tuple(dict.fromkeys(name for way in ways for name in way))
    moves = [way.get(name, 0.0) * one.sd for name in names for way, one in zip(ways, values, strict=True)]
    W = np.reshape(moves, (len(names), len(values)))
    covariance = W @ instrument.correlation_of(values) @ W.T
    sd = np.sqrt(np.diag(covariance))
    return replace(material, known=Prior(names, sd, covariance / np.outer(sd, sd)))


def _moved_by(material: "Material", value: "UncertainValue") -> Mapping[str, float]:
    """Return which coefficients of the law's deviation a value of the card moves, and by how much of it."""
    if value.name.startswith(LAW):
        return {value.name.removeprefix(LAW): 1.0}
    key = value.name.removeprefix("material.")
    if key not in GIVEN:
        return {}  # of a crystal, whose mean over all directions the law is
    if key == "poisson_ratio":
        held = {"shear_modulus.log_value": -1.0 / (1.0 + value.value)}  # at the same E
        return {"poisson_ratio.value": 1.0} | (held if "shear_modulus" in material.properties else {})
    return {f"{scaled_by(material, GIVEN[key][0])}.log_value": 1.0 / value.value}


def mount_of(instrument: "Instrument", theory: "Theory", harmonic: int) -> "Mount | None":
    """Return the base that an instrument is joined to, of a mode whose stress by it can be computed; None without one."""
    from shell.prestress import check_mount

    mount: Mount | None = instrument.part("mount")
    if mount is not None:
        with naming(f"{instrument.path} [mount]"):
            check_mount(instrument.resonator, theory, harmonic)
            instrument.material.check(mount.joined_at)
    return mount


def unknown_slope(instrument: "Instrument") -> str:
    """Say why the slope of the frequency is not known, and which keys would tell it; empty where it is known."""
    missing = () if instrument.polynomial is not None else instrument.material.constant
    if not missing:
        return ""
    from shell.materials import read_materials

    named = {"youngs_modulus": "Young's modulus", "shear_modulus": "shear modulus", "expansion": "expansion"}
    said = "no source states" if instrument.material.name in read_materials() else "the card does not say"
    keys = {name: f"[material.deviation.{name}] {key} (1/K)" for name, key in SLOPE_KEYS.items()}
    return (
        f"{said} how the {' and the '.join(named[name] for name in missing)} of '{instrument.material.name}' change{'s' if len(missing) == 1 else ''} with temperature, so the slope of the"
        f" frequency is not known. Give {' and '.join(keys[name] for name in missing)}, or a material of the table (hrg materials) or of your own ('file') whose law is not constant."
    )


def check_slope_known(instrument: "Instrument") -> None:
    """Refuse a material that is given at one temperature only: the slope of its frequency is not 0 but unknown."""
    if why := unknown_slope(instrument):
        raise InputError(f"{instrument.path} [material]: {why}")


def beyond_records(instrument: "Instrument", temperatures: Array, what: str) -> tuple[str, ...]:
    """Say of what the records behind a polynomial card know nothing: responses that they lack, and temperatures (K) that leave theirs."""
    told, said = instrument.part("posterior"), []
    if told.unseen:
        said.append(
            f"no record behind this card had {' or '.join(told.unseen)}: it says nothing of {'it' if len(told.unseen) == 1 else 'them'}."
        )
    if told.covered_degC is not None:
        low, high = told.covered_degC
        by = max(low - float(np.min(temperatures)) + zero_Celsius, float(np.max(temperatures)) - zero_Celsius - high)
        if by > BEYOND:
            said.append(
                f"the records behind the polynomial of this card reach from {low:g} to {high:g} °C, and {what} goes {by:.0f} K beyond: its numbers there are a guess."
            )
    return tuple(said)


def moved_law(law: "FrequencyLaw", instrument: "Instrument") -> "FrequencyLaw":
    """Return the law of an instrument whose material or mount has moved; solved anew where Poisson's ratio has left the law's."""
    if instrument.polynomial is not None:
        return law_of(instrument, law.lowest, law.highest)
    try:
        return replace(law.with_material(instrument.material), mount=instrument.part("mount"))
    except ShellError:
        return law_of(instrument, law.lowest, law.highest, law.theory, law.harmonic)
