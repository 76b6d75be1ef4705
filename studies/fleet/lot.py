"""What a lot is: values with mean, scatter, batches and outliers, causes that devices share, and why which device differs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from functools import cached_property
from typing import Any

import numpy as np

from studies.fleet.comparison import Share, compare
from studies.fleet.device import Answer, Measured, Standing, interval
from studies.fleet.folder import Device
from studies.fleet.population import FEWEST, Quantity, Scatters, Trend
from studies.instrument.display import display_name, spell_parameter
from studies.results import row_of

DESIGN = 0.05  # relative distance of a frequency from the lot's, beyond which a device is of another design
TOLD = 0.6  # part of the devices whose records must tell a value for it to be one of the lot


@dataclass(frozen=True)
class Lot:
    """Answers of all devices, with those that could not be had, and what they say together."""

    answers: Mapping[str, Answer]  # serial -> Answer
    failed: Mapping[str, str]  # serial -> why there is none
    made: Mapping[str, date]  # serial -> date, and batch, where they are known
    batches: Mapping[str, str]
    quantities: tuple[Quantity, ...]  # values over the lot
    shares: tuple[Share, ...]  # causes over the lot

    @cached_property
    def reasons(self) -> dict[str, list[str]]:
        """Why a device is not like the others; nothing for those that are."""
        out: dict[str, list[str]] = {serial: [] for serial in self.answers}
        for share in self.shares:
            words = "lacks" if share.kind == "all but" else "it alone has" if len(share.odd) == 1 else "has"
            for serial in share.odd:
                out[serial].append(f"{words} {' or '.join(share.names)} in {display_name(share.response)}")
        for one in self.quantities:
            for serial, p in one.odd.items():
                own = one.of[serial].value
                out[serial].append(f"{_words(one)} is {own:.5g}, in the lot {one.population.mean:.5g}; chance {p:.1g}")
        return out

    @property
    def odd(self) -> list[str]:
        """Devices that differ, those with the most reasons first."""
        return sorted((s for s, why in self.reasons.items() if why), key=lambda s: (-len(self.reasons[s]), s))

    @cached_property
    def bad_batches(self) -> dict[str, list[str]]:
        """Batches that differ, with the reasons."""
        out: dict[str, list[str]] = {}
        for one in self.quantities:
            for name, chance in one.bad_batches.items():
                inside = one.among([s for s in one.of if one.batches.get(s) == name])
                apart = (
                    f"{_words(one)} is {inside.mean:.5g}, in the lot {one.population.mean:.5g} (chance {chance:.1g})"
                )
                out.setdefault(name, []).append(apart)
        for share in self.shares:
            if share.kind == "batch":
                out.setdefault(share.batch, []).append(
                    f"has {' or '.join(share.names)} in {display_name(share.response)}"
                )
        return out

    @cached_property
    def trends(self) -> dict[str, Trend]:
        """How values change with the date of the devices, where that is not chance."""
        return {one.name: found for one in self.quantities if (found := one.trend(self.made)) is not None}

    def as_dict(self) -> dict[str, Any]:
        """Return the object of `hrg fleet --json`."""
        return {
            "schema": "hrg.fleet/2",
            "odd": self.odd,
            "bad_batches": self.bad_batches,
            "common_causes": [_cause(one) for one in self.shares],
            "values": [_value(one, self.trends.get(one.name)) for one in self.quantities],
            "devices": {
                serial: {
                    **one.verdict,
                    "odd": self.reasons[serial],
                    "date": str(self.made[serial]) if serial in self.made else None,
                    "batch": self.batches.get(serial) or None,
                }
                for serial, one in self.answers.items()
            },
            "failed": dict(self.failed),
        }


def _words(one: Quantity) -> str:
    return one.name if " " in one.name else display_name(one.name)


def _cause(one: Share) -> dict[str, Any]:
    row = row_of(one, "effect", "response", "equivalent", "kind", "having", "lacking", "odd", "evidence")
    sizes = {serial: interval(size.first, size.first_sd) for serial, size in one.sizes.items()}
    return row | {"batch": one.batch or None, "coefficient": next(iter(one.sizes.values())).coefficient, "sizes": sizes}


def _value(one: Quantity, trend: Trend | None) -> dict[str, Any]:
    return {
        **row_of(one, "name", "odd", "bad_batches", mean="population.mean", mean_sd="population.mean_sd"),
        "scatter": one.population.scatter,
        "per_30_days": trend and interval(trend.per_month, trend.sd),
        "devices": {serial: interval(own.value, own.sd) for serial, own in one.of.items()},
        "with_lot": {s: interval(own.value, own.sd) for s in one.of for own in [one.with_lot(s)]},
    }


def gather(devices: Sequence[Device], answers: Mapping[str, Answer], failed: Mapping[str, str]) -> Lot:
    """Hold the answers of devices of one design against each other; those of another design are put aside."""
    levels = {serial: own.level for serial, own in answers.items() if own.level}
    usual = float(np.median(list(levels.values()))) if levels else 0.0
    other = {s: f for s, f in levels.items() if abs(np.log(f / usual)) > DESIGN}
    failed = dict(failed) | {
        s: f"device {s}: its frequency is near {f:.5g} Hz, that of the lot near {usual:.5g} Hz; it is of another design: give it a lot of its own."
        for s, f in other.items()
    }
    alike = {s: own for s, own in answers.items() if s not in other}
    made = {one.serial: one.made for one in devices if one.made is not None}
    batches = {one.serial: one.batch for one in devices if one.batch}
    shares = _shares(alike, batches)
    return Lot(alike, failed, made, batches, _quantities(alike, batches, shares), shares)


def _quantities(
    answers: Mapping[str, Answer], batches: Mapping[str, str], shares: Sequence[Share]
) -> tuple[Quantity, ...]:
    """Return values of the card, settled readings, and coefficients of causes: of families, whose size hangs on the runs, none."""
    names = dict.fromkeys(name for own in answers.values() for name in own.measured)
    of = {name: {s: own.measured[name] for s, own in answers.items() if name in own.measured} for name in names}
    for share in shares:
        for key in {one.coefficient for one in share.sizes.values() if " " not in one.coefficient}:
            words, factor = spell_parameter(key)
            sizes = {s: one for s, one in share.sizes.items() if one.coefficient == key}
            own = {s: Measured(factor * one.first, factor * one.first_sd) for s, one in sizes.items()}
            of[f"{share.effect}: {words}"] = own
    told = {n: own for n, own in of.items() if sum(one.told for one in own.values()) >= max(2.0, TOLD * len(answers))}
    looks = sum(len(own) for own in told.values() if len(own) >= FEWEST)
    scatters = Scatters(told)
    return tuple(Quantity(name, own, max(looks, 1), batches, scatters) for name, own in told.items())


def _shares(answers: Mapping[str, Answer], batches: Mapping[str, str]) -> tuple[Share, ...]:
    shares = []
    for response, names in _places(answers):
        scores = {serial: _standing_there(one.standings.get(response, {}), names) for serial, one in answers.items()}
        named = {serial for serial, one in answers.items() if names & _named(one, response)}
        share = compare(response, {s: of for s, of in scores.items() if of}, batches, named)
        if share is not None:
            shares.append(share)
    return tuple(sorted(shares, key=lambda one: -one.evidence))


def _named(own: Answer, response: str) -> set[str]:
    """Return the effects that the diagnosis of one device names in a response."""
    causes = [one for one in own.verdict["causes"] if one["response"] == response]
    return {name for one in causes for name in (one["effect"], *one["equivalent"])}


def _standing_there(standings: Mapping[str, Mapping[str, Standing]], names: set[str]) -> dict[str, Standing]:
    """Return how effects of one place stand in a device: in the stead of one of them, or beside all; not in that of another cause."""
    own = [of for place, of in standings.items() if place in names or not place]
    best = {
        name: max((of[name] for of in own if name in of), key=lambda one: one.score, default=None) for name in names
    }
    return {name: one for name, one in best.items() if one is not None}


def _places(answers: Mapping[str, Answer]) -> list[tuple[str, set[str]]]:
    """Return the responses and the effects that contend for one place, over all devices: sets that meet are one."""
    groups: list[tuple[str, set[str]]] = []
    for own in answers.values():
        for cause in own.verdict["causes"]:
            if cause["kind"] != "physics":
                continue
            response, names = cause["response"], {cause["effect"], *cause["equivalent"]}
            for other in [g for g in groups if g[0] == response and g[1] & names]:
                names |= other[1]
                groups.remove(other)
            groups.append((response, names))
    return groups
