"""Answers about one place of a fleet, and values of its devices held against those of the others.

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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.fleet.outcome import Share, Value
from studies.diagnosis.verdict import Interval, temper_of
from studies.effects import find_effect
from studies.effects.states import FloatArray

ALIKE = 0.2
"""Scatter of a value from device to device that is usual in one design, relative, where the others are too few to show it."""
SIZES_ALIKE = 0.5
"""Scatter of the logarithm of an effect's size from device to device."""
DECADES = 4.5
"""Over which the size of an effect may lie beforehand."""
FAR = 3.0
"""Standard deviations of what the others foretell, beyond which a device is odd."""
Answer = tuple[str, str | None, str]
"""Kind, odd device, effect."""


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
    temper = temper_of(lead / len(scores))
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
