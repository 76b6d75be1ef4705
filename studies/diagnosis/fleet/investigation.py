"""Devices of one design diagnosed together: each alone, then what every contender would stand at in each, and their values."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from shell.constants import zero_Celsius
from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.fleet.comparison import Standing, against_others, compare
from studies.diagnosis.fleet.outcome import Fleet, Share, Value
from studies.diagnosis.inquiry import Inquiry
from studies.diagnosis.investigate import Diagnosis, investigate
from studies.diagnosis.model import exact_forms
from studies.diagnosis.scan import applicable, build_bank, scan
from studies.diagnosis.search import drop, polish
from studies.diagnosis.verdict import Interval
from studies.effects import find_effect
from studies.effects.effect import UNITS
from studies.errors import InputError
from studies.record import Record

if TYPE_CHECKING:
    from studies.instrument.card import Instrument

Progress = Callable[[str], None]


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
        raise InputError("a fleet needs at least two devices: --device A=a1.csv,a2.csv --device B=b1.csv.")
    found: dict[str, Diagnosis] = {}
    for name, records in devices.items():

        def tell(words: str, name: str = name) -> None:
            progress(f"{name}: {words}")

        campaign = load_campaign(records, None if card is None else card.reference_temperature - zero_Celsius)
        found[name] = investigate(campaign, score_held_out=score_held_out, advise=False, progress=tell, card=card)
    progress("common causes")
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
    return bool(applicable(inquiry.problem, inquiry.plain, [find_effect(name)]))


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
