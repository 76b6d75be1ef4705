"""`[mount]`: the base, where its expansion differs from that of the resonator."""

from typing import TYPE_CHECKING, Annotated

from shell.constants import zero_Celsius
from studies.instrument.registry import CardPlace, CardTable
from studies.schema.keys import Keys, Note, number

if TYPE_CHECKING:
    from shell.material import Mount

FASTEST = 1e-3  # 1/K
BASE = "of the base that a stem ends in, or that a rim or face is joined to"
Expansion = Annotated[float, number(BASE, least=-FASTEST, most=FASTEST, relative_sd=0.1, example=5.1e-06)]


class MountKeys(Keys, frozen=True, kw_only=True):
    """Expansion of the base, and the temperature of the joint."""

    expansion_per_K: Expansion | None = None
    joined_at_degC: Annotated[float, number("where the joint is free of stress; the reference temperature unless given", least=-273.15, most=1500.0, example=20.0)] | None = None  # fmt: skip
    note: Note = ""

    def __post_init__(self) -> None:
        if self.expansion_per_K is None and (self.joined_at_degC is not None or self.note):
            raise ValueError("expansion_per_K of the base is missing; add it.")


def build(keys: MountKeys, place: CardPlace) -> "Mount | None":
    """The mount in SI units; None where the base expands with the resonator."""
    from shell.material import Mount

    if keys.expansion_per_K is None:
        return None
    at = place.reference_temperature if keys.joined_at_degC is None else keys.joined_at_degC + zero_Celsius
    return Mount(keys.expansion_per_K, at)


TABLE = CardTable("mount", MountKeys, build=build, optional=True)
