"""Uncertain values of a material: what a card leaves to the material table, and what of its law card and table leave open together."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from studies.instrument.heat_path import FROM_MATERIAL
from studies.instrument.tables.material import GIVEN
from studies.instrument.uncertain import UncertainValue
from studies.instrument.units import unit_of

if TYPE_CHECKING:
    from shell.material import Material
    from studies.instrument.card import Instrument
    from studies.instrument.tables.thermal import Thermal

LAW = "material.deviation."


def uncertain_of_law(material: "Material", stated: Collection[str]) -> Iterator[UncertainValue]:
    """Yield the coefficients of the law's deviation that act on the frequency, by the material's prior unless the card states it."""
    from shell.law import ACTING

    given = {f"{_scaled_by(material, name)}." for key, (name, _) in GIVEN.items() if f"material.{key}" in stated}
    for name, sd in zip(material.prior.names, material.prior.sd, strict=True):
        quantity, coefficient = name.split(".")
        settled = f"{quantity}." in given and coefficient in ("value", "log_value")
        if quantity in ACTING and LAW + name not in stated and not settled:
            value = material.coefficient(name)
            yield UncertainValue(LAW + name, value, float(sd), unit=unit_of(name))


def correlations_of_law(material: "Material", names: Collection[str]) -> Mapping[tuple[str, str], float]:
    """Return the prior correlation of every pair of these names that the material's prior ties together."""
    found = {}
    for i, one in enumerate(material.prior.names):
        for j, other in enumerate(material.prior.names[:i]):
            correlation = float(material.prior.correlation[i, j])
            if abs(correlation) > 1e-12 and LAW + one in names and LAW + other in names:
                found[LAW + other, LAW + one] = correlation
    return found


def uncertain_of_heat(material: "Material", thermal: "Thermal", reference: float) -> Iterator[UncertainValue]:
    """Yield what `[thermal]` takes from the material table, with the uncertainty stated there; `reference` in K."""
    for key, name in FROM_MATERIAL.items():
        law = material.properties.get(name)
        if law is None or getattr(thermal, key) is not None:
            continue
        value = float(material.value(name, reference))
        sd = value * float(law.covariance[0, 0]) ** 0.5
        if sd > 0:
            yield UncertainValue(f"thermal.{key}", value, sd, 0.0, float("inf"), True, unit_of(key))


def known_material(instrument: "Instrument") -> "Material":
    """Return the material with what card and table leave open of its law: values that the card gives, and deviations, with the uncertainty that it states."""
    from shell.material import Prior

    material = instrument.material
    values = [one for one in instrument.uncertain if one.name.startswith("material.")]
    ways = [_moved_by(material, one, instrument.reference_temperature) for one in values]
    names = tuple(dict.fromkeys(name for way in ways for name in way))
    W = np.array([[way.get(name, 0.0) * one.sd for way, one in zip(ways, values, strict=True)] for name in names])
    R, place = np.eye(len(values)), {one.name: k for k, one in enumerate(values)}
    for (one, other), correlation in instrument.correlation.items():
        if one in place and other in place:
            R[place[one], place[other]] = R[place[other], place[one]] = correlation
    covariance = W.reshape(len(names), len(values)) @ R @ W.T.reshape(len(values), len(names))
    sd = np.sqrt(np.diag(covariance))
    return replace(material, known=Prior(names, sd, covariance / np.outer(sd, sd)))


def _moved_by(material: "Material", value: UncertainValue, reference: float) -> Mapping[str, float]:
    """Return which coefficients of the law's deviation a value of the card moves, and by how much of it."""
    if value.name.startswith(LAW):
        return {value.name.removeprefix(LAW): 1.0}
    key = value.name.removeprefix("material.")
    if key not in GIVEN:
        return {}  # of a crystal, whose mean over all directions the law is
    if key == "poisson_ratio":
        by_shear = (
            {"shear_modulus.log_value": -1.0 / (1.0 + value.value)} if "shear_modulus" in material.properties else {}
        )
        return {"poisson_ratio.value": 1.0, **by_shear}
    return {f"{_scaled_by(material, GIVEN[key][0])}.log_value": 1.0 / value.value}


def _scaled_by(material: "Material", name: str) -> str:
    """Return the property of the law that a given value rescales."""
    return "shear_modulus" if name == "youngs_modulus" and name not in material.properties else name
