"""Several devices of one design: causes that they share, values of each, and the device that is not like the others.

Every device is diagnosed alone. For each cause that any of them shows, the log posteriors S_d(e) of every effect e in its place
are gathered over the devices d, above nothing being there, and five kinds of answer are compared:

    all           log π + Σ_d [S_d(e) − log π + alike_d]            one cause of the design pays its prior π once
    all but k     the same over d ≠ k + what else k has + log ω      the device k differs
    k alone       S_k(e) + log ω
    each its own  Σ_d [max_e S_d(e) + log ω] over the devices where it would be named
    none          0

where alike_d says how well the size in d agrees with that in the others. So a set which one device cannot separate is separated by another. A device is odd, too, when a value of it (a size of
the common cause, a lag, a slope, a value of the card) lies far from what the others, as scattered as they are, foretell.
"""

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.constants import zero_Celsius

from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.inquiry import Inquiry
from studies.diagnosis.investigate import Diagnosis, investigate
from studies.diagnosis.model import exact_forms
from studies.diagnosis.scan import build_bank, scan
from studies.diagnosis.search import drop, polish
from studies.diagnosis.verdict import Interval
from studies.effects import find_effect
from studies.effects.effect import UNITS
from studies.effects.states import FloatArray
from studies.errors import InputError
from studies.record import Record, read_record

if TYPE_CHECKING:
    from studies.instrument.card import Instrument

ALIKE = 0.2
"""Scatter of a value from device to device that is usual in one design, relative, where the others are too few to show it."""
SIZES_ALIKE = 0.5
"""Scatter of the logarithm of an effect's size from device to device."""
DECADES = 4.5
"""Over which the size of an effect may lie beforehand."""
FAR = 3.0
"""Standard deviations of what the others foretell, beyond which a device is odd."""
Progress = Callable[[str], None]
Answer = tuple[str, str | None, str]
"""Kind, odd device, effect."""


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


def read_fleet(devices: Sequence[str] = (), manifest: str | None = None) -> dict[str, list[Record]]:
    """Read the records of a fleet: from words such as "A=a1.csv,a2.csv", or from a TOML file with a table [devices].

    Raises
    ------
    InputError
        A device twice, without records, or a file that says something else.
    """
    paths: dict[str, list[str]] = {}
    for words in devices:
        name, equals, files = words.partition("=")
        if not (name and equals and files) or name in paths:
            raise InputError(f"--device {words}: say a name, once, and its records, as in A=a1.csv,a2.csv.")
        paths[name] = files.split(",")
    if manifest is not None:
        paths |= _read_manifest(manifest, set(paths))
    return {name: [read_record(path) for path in own] for name, own in paths.items()}


def _read_manifest(manifest: str, known: set[str]) -> dict[str, list[str]]:
    try:
        content = tomllib.loads(Path(manifest).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{manifest}: not a readable manifest: {error}.") from None
    table = content.get("devices")
    if set(content) != {"devices"} or not isinstance(table, dict):
        raise InputError(
            f'{manifest}: a manifest has one table [devices], with lines such as A = ["a1.csv", "a2.csv"].'
        )
    out = {}
    for name, files in table.items():
        if not (isinstance(files, list) and files and all(isinstance(one, str) for one in files)) or name in known:
            raise InputError(f'{manifest}: {name} needs a list of records, once, such as ["a1.csv", "a2.csv"].')
        out[name] = [str(Path(manifest).parent / one) for one in files]
    return out


def diagnose_fleet(
    devices: Mapping[str, Sequence[Record]],
    card: "Instrument | None" = None,
    score_held_out: bool = True,
    progress: Progress = lambda words: None,
) -> Fleet:
    """Diagnose devices of one design together.

    Parameters
    ----------
    devices : mapping from name to records
    card : Instrument, optional
        The design: its own simulation is the baseline of every device.
    score_held_out : bool
        Measure gains, and refuse causes that do not pay on rows that the fit has not seen.
    progress : callable, optional

    Raises
    ------
    InputError
        Fewer than two devices, or records that cannot be used.
    """
    if len(devices) < 2:
        raise InputError("a fleet has two devices or more: --device A=a1.csv,a2.csv --device B=b1.csv.")
    found: dict[str, Diagnosis] = {}
    for name, records in devices.items():

        def tell(words: str, name: str = name) -> None:
            progress(f"{name}: {words}")

        campaign = load_campaign(records, None if card is None else card.reference_temperature - zero_Celsius)
        found[name] = investigate(campaign, score_held_out=score_held_out, advise=False, progress=tell, card=card)
    progress("what they share")
    shares = []
    for response, names in _places(found):
        scored = {
            device: _scores(one.inquiries[response], names)
            for device, one in found.items()
            if response in one.inquiries
        }
        if (share := compare(response, scored)) is not None:
            shares.append(replace(share, **_sizes(share, scored)))
    return Fleet(found, tuple(shares), (*_values_of(found), *_size_values(shares)))


@dataclass(frozen=True)
class Standing:
    """An effect in its place in one device.

    `score`: log posterior over nothing being there; `size`, `sd`: rms of what it makes of the response in the records, and how
    well that is known; `first`: its coefficient, where it has one, else `size`, for the members of a family stand in for each
    other.
    """

    score: float
    size: float
    sd: float
    first: Interval | None = None


def _places(found: Mapping[str, Diagnosis]) -> list[tuple[str, tuple[str, ...]]]:
    """Return the responses and the effects that contend for one place, over all devices: sets that meet are one."""
    groups: list[tuple[str, set[str]]] = []
    for one in found.values():
        for cause in one.verdict.causes:
            if cause.kind != "physics":
                continue
            names = set(cause.names)
            for other in [g for g in groups if g[0] == cause.response and g[1] & names]:
                names |= other[1]
                groups.remove(other)
            groups.append((cause.response, names))
    return [(response, tuple(sorted(names))) for response, names in groups]


def _scores(inquiry: Inquiry, names: Sequence[str]) -> dict[str, Standing]:
    """Return what every effect would stand at in one device, its other causes kept."""
    base = inquiry.selection.final
    for index in reversed(range(len(base.fit.terms))):
        if base.fit.terms[index].name in names:
            base = drop(base, index)
    out = {}
    bank = build_bank(base.fit, [find_effect(name) for name in names if _acts(inquiry, name)])
    for seen in scan(base.fit, bank):
        model = exact_forms((own := polish(base, seen)).fit)
        places = model.columns_of(len(model.terms) - 1)
        value, C = model.solved.coefficients[places], model.solved.covariance[np.ix_(places, places)]
        size = float(np.sqrt(np.mean((model.linear.columns[:, places] @ value) ** 2)))
        times = float(np.sqrt(max(value @ np.linalg.solve(C + 1e-12 * np.diag(np.diag(C)), value), 1e-12)))
        first = _interval(value[0], C[0, 0]) if value.size == 1 else _interval(size, (size / times) ** 2)
        out[seen.term.name] = Standing(own.score - base.score, size, size / times, first)
    return out


def _acts(inquiry: Inquiry, name: str) -> bool:
    from studies.diagnosis.scan import applicable

    return bool(applicable(inquiry.problem, inquiry.plain, [find_effect(name)]))


def alike(own: Standing, others: Sequence[Standing]) -> float:
    """Return how much likelier a size is where the others have theirs than anywhere in the decades that an effect may have.

    ln a ~ N(ln m, 0.5²), m the others' median; of a size that is not seen only its limit counts.
    """
    usual = float(np.median([other.size for other in others]))
    seen = own.size > 2.0 * own.sd
    away = float(np.log(max(own.size if seen else 2.0 * own.sd, 1e-300) / max(usual, 1e-300)))
    if not seen and away > 0.0:
        return 0.0
    variance = SIZES_ALIKE**2 + (own.sd / own.size if seen else 0.0) ** 2
    return float(-0.5 * np.log(2.0 * np.pi * variance) - away**2 / (2.0 * variance) + np.log(DECADES * np.log(10.0)))


def compare(response: str, scores: Mapping[str, Mapping[str, Standing]]) -> Share | None:
    """Return the likeliest answer about one place of the fleet; None where that is that nothing is there.

    Parameters
    ----------
    response : str
    scores : mapping device -> effect -> what it would stand at there
    """
    prior, different = CONSTANTS["log_prior_effect"], CONSTANTS["log_prior_odd"]
    names = sorted({name for of in scores.values() for name in of})
    best = {device: max((one.score for one in of.values()), default=0.0) for device, of in scores.items()}
    having = [device for device, score in best.items() if score > CONSTANTS["margin"]]
    answers: dict[Answer, float] = {("none", None, ""): 0.0}
    if len(having) > 1:
        answers["own", None, ""] = sum(best[device] + different for device in having)

    def shared(effect: str, devices: Sequence[str]) -> float:
        of = {device: scores[device].get(effect) for device in devices}
        standing = {device: one for device, one in of.items() if one is not None}
        if len(standing) < len(of) or find_effect(effect).once:
            return -np.inf
        total = prior
        for device, own in standing.items():
            total += own.score - prior + alike(own, [one for name, one in standing.items() if name != device])
        return total

    for effect in names:
        answers["all", None, effect] = shared(effect, list(scores))
        for odd, of in scores.items():
            others = [device for device in scores if device != odd]
            answers["alone", odd, effect] = of[effect].score + different if effect in of else -np.inf
            if len(others) > 1:
                instead = max((one.score for name, one in of.items() if name != effect), default=0.0)
                answers["all but", odd, effect] = shared(effect, others) + max(instead, 0.0) + different
    kinds = list(answers)
    values = np.array([answers[kind] for kind in kinds])
    lead = float(values.max())
    temper = CONSTANTS["temper"] + CONSTANTS["misfit"] * max(lead, 0.0) / len(scores)
    weight = np.exp((values - lead) / temper)
    kind, apart, effect = kinds[int(np.argmax(values))]
    if kind == "none":
        return None
    if kind == "own":
        effect = max(names, key=lambda name: sum(max(of[name].score, 0.0) for of in scores.values() if name in of))
    level = [k for k, other in enumerate(kinds) if other[:2] == (kind, apart) and weight[k] >= CONSTANTS["member"]]
    equivalent = {kinds[k][2] for k in level} - {effect, ""}
    if kind != "own":
        equivalent |= set(find_effect(effect).equivalents.get(response, ()))
    probability = float(weight[level].sum() / weight.sum()) * (1.0 - CONSTANTS["doubt"])
    return Share(effect, response, tuple(sorted(equivalent)), kind, apart, probability, 2.0 * lead, "", {})


def _sizes(share: Share, scored: Mapping[str, Mapping[str, Standing]]) -> dict[str, Any]:
    """Return the size of the effect in every device that has it, and its name."""
    effect = find_effect(share.effect)
    name = effect.coefficient_names(share.response)[0] if effect.spread.size == 1 else f"rms_{UNITS[share.response]}"
    having = [share.odd] if share.kind == "alone" else [device for device in scored if device != share.odd]
    found = {str(device): scored[str(device)].get(share.effect) for device in having}
    sizes = {device: one.first for device, one in found.items() if one is not None and one.score > 0.0}
    return {"sizes": sizes, "coefficient": name}


def _interval(value: float, variance: float) -> Interval:
    return Interval.about(float(value), float(np.sqrt(max(variance, 0.0))))


def _values_of(found: Mapping[str, Diagnosis]) -> list[Value]:
    """Return the values of the baselines: slope and lag of the frequency without a card, with one what was calibrated of it."""
    own: dict[str, dict[str, Interval]] = {}
    for device, one in found.items():
        for shift in one.verdict.calibration:
            own.setdefault(shift.parameter, {})[device] = Interval(shift.value, shift.low, shift.high)
        clock = next((i.final for i in one.inquiries.values() if i.problem.response.thermometer), None)
        tau = None if clock is None else getattr(clock.moved(), "tau", None)
        if clock is None or tau is None or one.verdict.calibration:
            continue
        values, names = clock.values(), clock.tangent.names
        C, level = clock.solved.covariance, values["level"]
        slope, bend = names.index("slope"), names.index("log lag")
        scale = 1e5 / level  # per 10 K in ppm per K
        own.setdefault("slope_ppm_per_K", {})[device] = _interval(values["slope"] * scale, C[slope, slope] * scale**2)
        own.setdefault("time_constant_s", {})[device] = _interval(float(tau), C[bend, bend] * float(tau) ** 2)
    return [against_others(name, of) for name, of in own.items() if len(of) > 1]


def _size_values(shares: Sequence[Share]) -> list[Value]:
    return [
        against_others(f"{share.effect}: {share.coefficient}", share.sizes)
        for share in shares
        if share.kind in ("all", "all but") and len(share.sizes) > 1
    ]


def against_others(name: str, of: Mapping[str, Interval]) -> Value:
    """Hold every device against the mean and the scatter of the others: of at least three, else nobody is odd."""
    devices = list(of)
    value = np.array([of[d].value for d in devices])
    sd = np.array([of[d].sd for d in devices])
    odd: dict[str, float] = {}
    for k, device in enumerate(devices if len(devices) > 2 else []):
        rest: FloatArray = np.delete(value, k)
        usual = max(float(np.std(rest, ddof=1)), ALIKE * abs(float(np.median(rest))))
        middle = float(np.median(rest))
        spread = float(np.sqrt(sd[k] ** 2 + usual**2 + np.mean(np.delete(sd, k) ** 2) / rest.size))
        far = (value[k] - middle) / max(spread, 1e-300)
        if abs(far) > FAR:
            odd[device] = float(far)
    inside = [k for k, device in enumerate(devices) if device not in odd] or list(range(len(devices)))
    scatter = float(np.std(value[inside], ddof=1)) if len(inside) > 1 else 0.0
    return Value(name, of, float(np.mean(value[inside])), scatter, odd)
