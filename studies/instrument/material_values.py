"""Uncertain values that a card leaves to the material table: the deviation of its law, and the heat values of `[thermal]`."""

from collections.abc import Collection, Iterator, Mapping
from typing import TYPE_CHECKING

from studies.instrument.heat_path import FROM_MATERIAL
from studies.instrument.tables.material import GIVEN
from studies.instrument.uncertain import UncertainValue
from studies.instrument.units import unit_of

if TYPE_CHECKING:
    from shell.material import Material
    from studies.instrument.tables.thermal import Thermal

LAW = "material.deviation."


def uncertain_of_law(material: "Material", stated: Collection[str]) -> Iterator[UncertainValue]:
    """Yield the coefficients of the law's deviation that act on the frequency, by the material's prior unless the card states it."""
    from shell.law import ACTING

    given = {f"{scaled_by(material, name)}." for key, (name, _) in GIVEN.items() if f"material.{key}" in stated}
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


def scaled_by(material: "Material", name: str) -> str:
    """Return the property of the law that a given value rescales."""
    return "shear_modulus" if name == "youngs_modulus" and name not in material.properties else name
