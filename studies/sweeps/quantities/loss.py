"""1/Q of a mode and its parts: heat, bulk, surface, films, gas, activated losses, electrodes, and what leaves through the mount."""

from typing import TYPE_CHECKING, Annotated

from studies.schema.keys import says
from studies.sweeps.case import Case
from studies.sweeps.quantity import Column, ModeQuantity, Number

if TYPE_CHECKING:
    from shell.damping.budget import Budget

PARTS = {
    "thermoelastic": "heat conduction through the wall", "bulk": "the bulk", "surface": "the surface",
    "gas": "gas", "mount": "the mount", "films": "films", "activated": "activated losses",
    "electrodes": "bias currents of electrodes",
}  # fmt: skip
MOUNT = ("mount", "anchor", "imbalance")


class Loss(ModeQuantity, frozen=True, kw_only=True, tag="loss"):
    """1/Q from the loss budget of the card and its parts; a part that the card does not state is 0."""

    anchor: Annotated[bool, says("compute the anchor loss of a balanced mode, half a second per design")] = True

    def list_columns(self) -> tuple[Column, ...]:
        stem, words = self.stem("inverse_q"), self.words
        parts = [Column(f"{stem}_{part}", "1", f"1/Q by {name}, {words}") for part, name in PARTS.items()]
        return (Column(stem, "1", f"1/Q, {words}"), *parts)

    def evaluate(self, case: Case) -> tuple[Number, ...]:
        found = dict.fromkeys(PARTS, 0.0)
        for part in find_budget(case, self, self.anchor).parts:
            found[_kind(part.name)] += float(part.inverse_q[0])
        return tuple(Number(value) for value in (sum(found.values()), *found.values()))


def find_budget(case: Case, asked: ModeQuantity, anchor: bool) -> "Budget":
    """Return the loss budget of a design; the anchor of a stem is computed where the card states none."""
    from studies.loss.model import loss_model

    T, instrument = case.temperature(asked.temperature_degC), case.instrument
    followed = case.require_lowest(asked.harmonic, asked.theory, T)
    stem, stated = instrument.resonator.stem, instrument.part("loss", "loss_parts").anchor_inverse_q
    computed = anchor and stem is not None and len(stem.roots) == 1 and stated is None
    known = followed if T == instrument.reference_temperature else None
    return loss_model(instrument, asked.harmonic, asked.theory, computed, known).budget(T)


def _kind(name: str) -> str:
    """Return which column the part of a budget belongs to; those of films carry the name of their film."""
    if name in PARTS:
        return name
    return "mount" if name in MOUNT else "activated" if name.startswith("activated") else "films"
