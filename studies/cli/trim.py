"""`hrg trim`: measured splits to a plan of cuts.

With --json one object, schema `hrg.trim/1`: `card`, `temperature_degC`, `goal_Hz`, `cut`; `before` and the round's `after`, lists of {harmonic,
frequency_Hz, split_Hz, error_Hz, most_Hz, slow_axis_deg}, `most_Hz` not exceeded in 95 of 100 cases; `rounds` of {share, mass_ug, cuts, after,
unbalance}, `cuts` of {azimuth_deg, position, height_mm, mass_ug, depth_um (null for teeth and masses)}; `mass_ug`; `gains`, for each position and n the change of the split by the
planned groove over that by the shape derivative, with its 90 % interval; `other_cuts`, what one kilogram
does as another kind of cut over what it does as this one; `measure`, what to measure after the round, in sentences. `rounds` holds
one: the next is planned from what is measured after it.
"""

from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from studies.cli.output import Answer, answers

if TYPE_CHECKING:
    from shell.resonator import Resonator
    from shell.trimming import ExpectedSplit
    from studies.trim import CardPlan

MANY = Parameter(consume_multiple=True)


@answers("hrg.trim/1")
def trim(
    card: str,
    *,
    split: Annotated[tuple[float, ...], MANY] = (),
    axis: Annotated[tuple[float, ...], MANY] = (),
    harmonic: Annotated[tuple[int, ...], MANY] = (2,),
    reading_error: float = 1e-4,
    scan: str | None = None,
    goal: float = 5e-4,
    cut: Literal["mass", "edge", "inner", "outer"] = "mass",
    position: Annotated[tuple[float, ...], MANY] = (1.0,),
    width_mm: float = 0.5,
    length_mm: float = 0.5,
    depth_limit: float = 0.3,
    teeth: int = 0,
    tooth_azimuth: float = 0.0,
    tooth_limit_ug: float = 100.0,
    unbalance: Annotated[tuple[str, ...], MANY] = (),
    removal_error: float = 0.02,
    gain_error: float = 0.03,
    gain: float = 1.0,
    temperature: float | None = None,
    out: str | None = None,
    report: str | None = None,
) -> Answer:
    """Plan the cuts that null measured splits with the least mass, keep the balance, and do not overshoot.

    Make the cuts, measure, and plan again with the new splits. What removing material does depends on where it is removed:
    off the rim's edge or a face it takes strain energy along, a tooth hardly any. A narrow, deep groove also relieves stress
    beside it, which can cancel or reverse its effect; this is solved for the planned depth. Wide, shallow cuts and teeth are
    the most predictable.

    Parameters
    ----------
    card : str
        Path of a card, or the name of one that ships (hrg cards).
    split : tuple[float, ...]
        Measured splits in Hz, one for each --harmonic.
    axis : tuple[float, ...]
        Azimuths in degrees of an antinode of the slower mode of each.
    harmonic : tuple[int, ...]
        Their harmonics n.
    reading_error : float
        Standard error of the splits in Hz.
    scan : str
        What hrg scan --json wrote, instead of --split and --axis: the splits of --harmonic with its intervals.
    goal : float
        Split in Hz that is good enough.
    cut : str
        mass (teeth, lumps, added or taken), edge (off the rim, through the wall), inner or outer (off that face).
    position : tuple[float, ...]
        Where along the meridian cuts may be made, 0 ... 1 (rim).
    width_mm : float
        Width of a cut along the circle.
    length_mm : float
        Length of a cut along the meridian.
    depth_limit : float
        Share of the wall that cuts may take.
    teeth : int
        Number of teeth at the rim, the only places for cuts then.
    tooth_azimuth : float
        Azimuth of the first tooth in degrees.
    tooth_limit_ug : float
        Most that may be taken off each tooth.
    unbalance : tuple[str, ...]
        Known harmonics of the mass, such as 1:120@35 (k = 1, 120 µg at 35°); those that are not given are not changed.
    removal_error : float
        Relative standard error of the mass of each cut.
    gain_error : float
        Relative standard error that all cuts share.
    gain : float
        Measured over predicted change of the split in the last round; negative if it changed the other way.
    temperature : float
        Temperature in °C; the card's reference temperature unless given.
    out : str
        CSV of the cuts to write, for the machine.
    report : str
        Page to write, for the technician.
    """
    import numpy as np

    from shell.constants import zero_Celsius
    from studies.cli.output import say
    from studies.errors import naming
    from studies.instrument.card import load_card
    from studies.trim import Teeth, Tool, other_cuts, plan_for_card

    measured = _from_scan(scan, harmonic) if scan is not None else _given(split, axis, harmonic, reading_error)
    instrument = load_card(card)
    T = instrument.reference_temperature if temperature is None else temperature + zero_Celsius
    tool = Tool(1e-3 * width_mm, 1e-3 * length_mm, depth_limit)
    with naming(instrument.path):
        resonator, elastic = instrument.at(T)
    planned = plan_for_card(
        resonator, elastic, measured, goal=goal, heights=position, tool=tool, kind=cut,
        teeth=Teeth(teeth, np.deg2rad(tooth_azimuth), 1e-9 * tooth_limit_ug) if teeth else None,
        removal_error=removal_error, gain_error=gain_error, gain=gain, unbalance=_unbalance(unbalance),
    )  # fmt: skip
    plan = planned.plan
    others = other_cuts(resonator, elastic, measured[0][0], cut)
    payload: dict[str, Any] = {
        "schema": "hrg.trim/1",
        "card": instrument.name,
        "temperature_degC": T - zero_Celsius,
        "goal_Hz": goal,
        "cut": cut,
        "before": [_state(s) for s in plan.before],
        "rounds": [_round(planned, resonator)],
        "mass_ug": 1e9 * plan.round.mass,
        "gains": gains(planned),
        "other_cuts": others,
        "measure": measure_after(planned),
    }
    if out is not None:
        from studies.files.writing import write_text

        write_text(out, _csv(payload))
        say(f"wrote {out}")
    if report is not None:
        from studies.reports.trim import write_trim_page

        write_trim_page(report, plan, payload)
        say(f"wrote {report}")
    yield payload
    _print(payload)
    for sentence in payload["measure"]:
        say(sentence)


def gains(planned: "CardPlan") -> list[dict[str, float]]:
    """The change by each planned groove over that by the shape derivative, with its 90 % interval."""
    from studies.trim import SURE

    return [
        {
            "position": x,
            "harmonic": n,
            "value": cut.gain(n),
            "low": cut.gain(n) - SURE * cut.error * abs(cut.gain(n)),
            "high": cut.gain(n) + SURE * cut.error * abs(cut.gain(n)),
        }
        for x, cut in planned.cuts.items()
        for n in cut.splits
    ]


def _round(planned: "CardPlan", resonator: "Resonator") -> dict[str, Any]:
    import numpy as np

    one, cuts = planned.plan.round, planned.cuts

    return {
        "share": one.share,
        "mass_ug": 1e9 * one.mass,
        "cuts": [
            {
                "azimuth_deg": float(np.rad2deg(c.azimuth)),
                "position": c.position,
                "height_mm": 1e3 * float(resonator.at([c.position * resonator.length]).z[0]),
                "mass_ug": 1e9 * c.mass,
                "depth_um": 1e6 * cuts[c.position].depth(c.mass) if cuts else None,
            }
            for c in one.cuts
        ],
        "after": [_state(s) for s in one.after],
        "unbalance": {str(k): [1e9 * abs(u), float(np.rad2deg(np.angle(u)))] for k, u in one.unbalance.items()},
    }


def _print(payload: dict[str, Any]) -> None:
    from studies.cli.output import print_table

    rounds = [*enumerate(payload["rounds"], 1)]
    cuts = [
        [
            str(k),
            f"{c['azimuth_deg']:.2f}",
            f"{c['height_mm']:.3f}",
            f"{c['mass_ug']:.3f}",
            "" if c["depth_um"] is None else f"{c['depth_um']:.3f}",
        ]
        for k, one in rounds
        for c in one["cuts"]
    ]
    note = f"{payload['mass_ug']:.3g} µg in all. Make these cuts, measure, and plan again."
    columns = ["round", "azimuth (°)", "height (mm)", "mass (µg)", "depth (µm)"]
    print_table(f"{payload['card']}: cuts", columns, cuts, note)
    splits = [
        [
            label,
            str(s["harmonic"]),
            *(f"{1e3 * s[key]:.3f}" for key in ("split_Hz", "error_Hz", "most_Hz")),
            f"{s['slow_axis_deg']:.2f}",
        ]
        for label, states in [("measured", payload["before"]), *((str(k), one["after"]) for k, one in rounds)]
        for s in states
    ]
    columns = ["after round", "n", "split (mHz)", "error (mHz)", "95 % below (mHz)", "slow axis (°)"]
    print_table("Splits as expected", columns, splits)


def measure_after(planned: "CardPlan") -> list[str]:
    """How sure the cuts are, what to measure after them, and what to make of it."""
    from studies.reports.digits import to_error

    plan, found = planned.plan, []
    for entry in gains(planned):
        value, error = entry["value"], (entry["high"] - entry["low"]) / 2
        number, spread = to_error(value, error)
        found.append(
            f"A groove of this depth at position {entry['position']:g} changes the split of n = {entry['harmonic']} by {number} ± {spread} (90 %) of what "
            "a wide, shallow cut of its mass does."
        )
        if abs(value - 1) > 0.15 or error > 0.15:
            found.append(
                "It relieves much stress beside it: wider, shallower cuts (`--width-mm`) or teeth are more predictable."
            )
    for state in plan.round.after:
        spread_Hz = state.error * state.frequency
        expected = " ± ".join(to_error(1e3 * state.hertz, 1e3 * spread_Hz))
        found.append(
            f"After the cuts measure the split of n = {state.harmonic} to ± {1e3 * min(plan.goal / 4, max(spread_Hz / 5, plan.goal / 10)):.2g} mHz, and its axis. "
            f"Expected: {expected} mHz. If it lies outside twice that, plan the next round with `--gain`, the measured over the predicted change "
            "(negative if the split changed the other way)."
        )
    found.append(
        "Let the shell return to its temperature before each reading, and read the same mode on the same electrodes."
    )
    return found


def _given(
    split: tuple[float, ...], axis: tuple[float, ...], harmonic: tuple[int, ...], error: float
) -> list[tuple[int, float, float, float]]:
    from math import radians

    from studies.errors import InputError

    if not split or not len(split) == len(axis) == len(harmonic):
        raise InputError(
            f"{len(split)} splits, {len(axis)} axes and {len(harmonic)} harmonics were given: each split in Hz (--split) needs its axis "
            "in degrees (--axis) and its n (--harmonic)."
        )
    if min(harmonic) < 1:
        raise InputError(f"--harmonic {min(harmonic)}: pairs have harmonics from 1 up.")
    return [(n, s, radians(a), error) for n, s, a in zip(harmonic, split, axis, strict=True)]


def _from_scan(path: str, harmonic: tuple[int, ...]) -> list[tuple[int, float, float, float]]:
    from json import loads
    from math import radians

    from studies.errors import InputError
    from studies.files.reading import read_bytes
    from studies.files.toml import check_number

    refused = InputError(f'{path}: is not what hrg scan --json writes (schema "hrg.scan/1").')
    data = read_bytes(path)
    try:
        content = loads(data)
        if content["schema"] != "hrg.scan/1":
            raise refused
        entries = {entry["harmonic"]: entry for entry in content["splits"]}
    except (ValueError, KeyError, TypeError, RecursionError):
        raise refused from None
    found = []
    for n in harmonic:
        if n not in entries:
            raise InputError(f"{path}: has no split of n = {n}: it has {', '.join(str(k) for k in entries)}.")
        try:
            axis, size = entries[n]["slow_axis_deg"], entries[n]["split_Hz"]
            if axis is None:
                raise InputError(
                    f"{path}: the split of n = {n} cannot be distinguished from 0: measure better, do not cut."
                )
            numbers = [size["value"], axis["value"], size["low"], size["high"]]
        except (KeyError, TypeError):
            raise refused from None
        split, degrees, low, high = (check_number(x, f"{path}: the split of n = {n}") for x in numbers)
        found.append((n, split, radians(degrees), (high - low) / 3.29))
    return found


def _unbalance(words: tuple[str, ...]) -> dict[int, complex]:
    import cmath
    import re
    from math import radians

    from studies.errors import InputError

    found = {}
    for word in words:
        match = re.fullmatch(r"([123]):([0-9.]+(?:e-?[0-9]+)?)@(-?[0-9.]+)", word)
        try:
            k, size, angle = match.groups() if match else ("", "", "")
            found[int(k)] = 1e-9 * float(size) * cmath.exp(1j * int(k) * radians(float(angle)))
            if not cmath.isfinite(found[int(k)]):
                raise ValueError
        except ValueError:
            raise InputError(f"--unbalance {word}: write k:µg@degrees, such as 1:120@35, with k 1, 2 or 3.") from None
    return found


def _state(state: "ExpectedSplit") -> dict[str, Any]:
    from math import degrees

    return {
        "harmonic": state.harmonic,
        "frequency_Hz": state.frequency,
        "split_Hz": state.hertz,
        "error_Hz": state.error * state.frequency,
        "most_Hz": state.most,
        "slow_axis_deg": degrees(state.slow_axis),
    }


def _csv(payload: dict[str, Any]) -> str:
    lines = ["round,azimuth_deg,position,height_mm,mass_ug,depth_um"]
    for k, one in enumerate(payload["rounds"], 1):
        for c in one["cuts"]:
            depth = "" if c["depth_um"] is None else f"{c['depth_um']:.4f}"
            lines.append(
                f"{k},{c['azimuth_deg']:.4f},{c['position']:.6f},{c['height_mm']:.4f},{c['mass_ug']:.5f},{depth}"
            )
    return "\n".join(lines) + "\n"
