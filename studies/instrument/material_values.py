"""Uncertain values that a card leaves to the material table.

The material's law becomes uncertain here: its slope and curvature go by names "material.…" of keys that `[material]` has.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from studies.instrument.heat_path import FROM_MATERIAL
from studies.instrument.uncertain import UncertainValue
from studies.instrument.units import unit_of

if TYPE_CHECKING:
    from shell.materials import Material
    from studies.instrument.tables.thermal import Thermal


def uncertain_of_material(material: "Material", thermal: "Thermal", reference: float) -> Iterator[UncertainValue]:
    """Yield what `[thermal]` takes from the material table, with the uncertainty stated there; `reference` in K."""
    for key, name in FROM_MATERIAL.items():
        law = material.properties.get(name)
        if law is None or getattr(thermal, key) is not None:
            continue
        value = float(material.value(name, reference))
        sd = law.uncertainty.get("value", 0.0) * abs(value / float(law.numbers.get("value", value)))
        if sd > 0:
            yield UncertainValue(f"thermal.{key}", value, sd, 0.0, float("inf"), True, unit_of(key))
