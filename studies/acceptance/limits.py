"""Limits of an acceptance test, `schema = "hrg.limits/1"`: a limit for each quantity that `hrg acceptance` knows."""

from typing import Annotated, Any

import msgspec

from studies.acceptance.quantities import QUANTITIES, TestedQuantity
from studies.schema.keys import Keys, number, says

SCHEMA = "hrg.limits/1"


class WarmUp(Keys, frozen=True, kw_only=True):
    """When the output counts as settled."""

    band_deg_per_h: (
        Annotated[float, number("about the final output; three times the scatter of its means unless given", above=0.0)]
        | None
    ) = None


def _declare_quantities() -> Any:
    """Declare a key for every quantity of the test."""

    def check(limits: Any) -> None:
        if not any(getattr(limits, key) is not None for key in limits.__struct_fields__):
            raise ValueError("no limit is given; add one, such as bias_deg_per_h = 5.0.")

    def declare(q: TestedQuantity) -> Any:
        return Annotated[float, number(f"{q.words}; {'at most, in size' if q.upper else 'at least'}", above=0.0)] | None

    fields: list[Any] = [(q.key, declare(q), None) for q in QUANTITIES]
    own: dict[str, Any] = {"bases": (Keys,), "namespace": {"__post_init__": check}}
    return msgspec.defstruct("QuantityLimits", fields, **own, frozen=True, kw_only=True)


QuantityLimits: Any = _declare_quantities()


class Limits(Keys, frozen=True, kw_only=True):
    """What an acceptance test is judged by."""

    schema: Annotated[str, says("kind of file")] = SCHEMA
    limits: QuantityLimits
    warm_up: WarmUp = WarmUp()

    def of(self, key: str) -> float | None:
        """Return the limit of a quantity, None where it has none."""
        limit: float | None = getattr(self.limits, key)
        return limit
