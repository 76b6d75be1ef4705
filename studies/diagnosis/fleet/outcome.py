"""What a fleet shows: the causes and values that its devices share, and which device is not like the others."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from studies.diagnosis.investigate import Diagnosis
from studies.diagnosis.verdict import Interval


@dataclass(frozen=True)
class Share:
    """One cause over the fleet.

    Attributes
    ----------
    effect, response : str
    equivalent : names that no device separates from it
    kind : "all", "all but" or "alone" (one device), "own" (each device its own)
    odd : str or None
        The device that lacks it, or has it alone.
    probability : of this answer among the kinds and effects that were compared
    evidence : twice the log posterior over none, summed
    sizes : of every device that has it, with its name: its coefficient, or the rms of what a family of several makes
    """

    effect: str
    response: str
    equivalent: tuple[str, ...]
    kind: str
    odd: str | None
    probability: float
    evidence: float
    coefficient: str
    sizes: Mapping[str, Interval]


@dataclass(frozen=True)
class Value:
    """A value of every device, and what they have in common: its mean, how it scatters, who is far from the others."""

    name: str
    of: Mapping[str, Interval]
    common: float
    scatter: float
    odd: Mapping[str, float]


@dataclass(frozen=True)
class Fleet:
    """What a fleet shows: shared causes and values, each device's own diagnosis, and why which device is the odd one out."""

    devices: Mapping[str, Diagnosis]
    shares: tuple[Share, ...]
    values: tuple[Value, ...]

    @property
    def reasons(self) -> dict[str, list[str]]:
        """Why a device is not like the others; none for those that are."""
        out: dict[str, list[str]] = {name: [] for name in self.devices}
        for share in self.shares:
            if share.odd is not None:
                words = "lacks" if share.kind == "all but" else "alone has"
                out[share.odd].append(f"{words} {' or '.join([share.effect, *share.equivalent])} in {share.response}")
        for value in self.values:
            for name, far in value.odd.items():
                own = value.of[name].value
                out[name].append(f"{value.name} is {own:.4g}, {abs(far):.1f} standard deviations from the others")
        return out

    @property
    def odd(self) -> str | None:
        """The device with the most reasons, where one has more than every other."""
        counts = sorted(((len(why), name) for name, why in self.reasons.items()), reverse=True)
        return counts[0][1] if counts[0][0] and (len(counts) == 1 or counts[0][0] > counts[1][0]) else None

    def as_dict(self) -> dict[str, Any]:
        """Return the object of `hrg diagnose --device --json`."""
        return {
            "schema": "hrg.fleet/1",
            "odd_one_out": self.odd,
            "common_causes": [
                {
                    "effect": one.effect,
                    "response": one.response,
                    "equivalent": list(one.equivalent),
                    "kind": one.kind,
                    "device": one.odd,
                    "probability": round(one.probability, 4),
                    "evidence": one.evidence,
                    "coefficient": one.coefficient,
                    "sizes": {name: size.as_dict() for name, size in one.sizes.items()},
                }
                for one in self.shares
            ],
            "values": [
                {
                    "name": value.name,
                    "common": value.common,
                    "scatter": value.scatter,
                    "devices": {name: own.as_dict() for name, own in value.of.items()},
                    "odd": dict(value.odd),
                }
                for value in self.values
            ],
            "devices": {
                name: {**one.verdict.as_dict(), "odd": self.reasons[name]} for name, one in self.devices.items()
            },
        }
