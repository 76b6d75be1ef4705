"""A cause over the lot: which effect it is, in which devices, and which of those that could show it lack it.

Log posteriors S_d(e) of the effects that contend for one place are summed over the devices in which they stand above nothing; one cause
of the design pays its prior π once:  Σ_d (S_d − π) + π. So a set that one device cannot separate is separated by another. A device
could show the effect where the size that the others have would stand out from what it leaves open.
"""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.verdict import temper_of
from studies.effects import find_effect
from studies.fleet.device import Standing

SEEN = 2.0  # standard deviations of a limit
LESS = 0.5  # part of the usual size below which a device lacks an effect
NAMED = 1 / 3  # part of the devices that show a common cause whose own diagnosis names it
FEW = 0.1  # part of the devices that could show an effect which is an exception
Scores = Mapping[str, Mapping[str, Standing]]


@dataclass(frozen=True)
class Share:
    """One cause over the lot."""

    effect: str
    response: str
    equivalent: tuple[str, ...]  # names that no device separates from it
    kind: str  # "all" (that could show it), "all but" (the exceptions lack it), "batch", "few" (the exceptions have it), "some"
    having: tuple[str, ...]  # devices that show it, and that could and do not
    lacking: tuple[str, ...]
    odd: tuple[str, ...]  # the exceptions
    evidence: float  # twice the log posterior over none, summed
    sizes: Mapping[str, Standing]  # device -> Standing
    batch: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """The effect and its equals."""
        return (self.effect, *self.equivalent)


def compare(
    response: str, scores: Scores, batches: Mapping[str, str] | None = None, named: Container[str] | None = None
) -> Share | None:
    """Return the likeliest cause in one place of the lot; None where there is none. `scores`: device -> effect -> how it stands there.

    It is common only where a part of the devices are `named` to have it by themselves: what all their models lack adds up as well.
    """
    prior, batches = CONSTANTS["log_prior_effect"], batches or {}
    names = sorted({name for of in scores.values() for name in of})

    def total(effect: str, devices: Sequence[str]) -> float:
        own = [scores[device][effect].score if effect in scores[device] else 2.0 * prior for device in devices]
        return prior + sum(score - prior for score in own) if own else -np.inf

    having = {e: [d for d, of in scores.items() if e in of and of[e].score > 0.0] for e in names}
    effect = max(names, key=lambda e: total(e, having[e]), default="")
    if not effect or total(effect, having[effect]) < CONSTANTS["margin"]:
        return None
    shown, lead = having[effect], total(effect, having[effect])
    near = temper_of(lead / len(shown)) * -np.log(CONSTANTS["member"])
    equal = {e for e in names if e != effect and total(e, shown) > lead - near}
    equal |= set(find_effect(effect).equivalents.get(response, ()))
    usual = float(np.median([scores[d][effect].size for d in shown]))
    lacking = [
        d
        for d, of in scores.items()
        if d not in shown and effect in of and of[effect].size + SEEN * of[effect].sd < LESS * usual
    ]
    kind, odd, batch = _place(effect, shown, lacking, batches)
    if kind != "few" and named is not None and sum(d in named for d in shown) < max(2.0, NAMED * len(shown)):
        kind, odd, batch = "some", [], ""
    if kind == "few":  # one exception in many devices must be clearer than what a search of so many finds
        odd = [d for d in odd if scores[d][effect].score > CONSTANTS["margin"] + np.log(len(scores))]
    sizes = {d: scores[d][effect] for d in shown}
    if len({one.coefficient for one in sizes.values()}) > 1:  # a family in one device, a single coefficient in another
        sizes = {d: one.as_rms(response) for d, one in sizes.items()}
    devices = (tuple(shown), tuple(lacking), tuple(odd))
    return Share(effect, response, tuple(sorted(equal)), kind, *devices, 2.0 * lead, sizes, batch)


def _place(
    effect: str, shown: Sequence[str], lacking: Sequence[str], batches: Mapping[str, str]
) -> tuple[str, list[str], str]:
    """Return the kind of a cause, its exceptions, and its batch."""
    able = len(shown) + len(lacking)
    few = max(1.0, FEW * able)
    own = {batches.get(d, "") for d in shown}
    if not find_effect(effect).once:
        if not lacking:
            return ("all" if len(shown) > 1 else "some"), [], ""
        if len(own) == 1 and own != {""} and len(shown) > 2 and not any(batches.get(d) in own for d in lacking):
            return "batch", [], own.pop()
        if len(lacking) <= few and len(shown) > 2 * len(lacking):
            return "all but", list(lacking), ""
    return ("few", list(shown), "") if len(shown) <= few and lacking else ("some", [], "")
