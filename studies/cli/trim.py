"""`hrg trim`: a plan of trimming cuts from measured frequency splits."""

from collections.abc import Mapping, Sequence
from math import degrees
from typing import Annotated, Any, Literal

import numpy as np

from compensation.constants import NINETY
from shell.constants import zero_Celsius
from shell.resonator import Resonator
from shell.trimming import SplitWave, TrimPlan
from studies.cli.arguments import MANY, Card, Temperature, open_resonator
from studies.cli.measured_splits import pair_splits, read_scan, read_unbalance
from studies.cli.output import answers, say
from studies.files.writing import write_csv
from studies.reports.digits import plain, to_error
from studies.reports.style import BLUE, GREEN, VERMILION, figure
from studies.resonator.trim import CardPlan, Teeth, Tool, error_of_gain, other_cuts, plan_for_card
from studies.results import Chapter, Drawing, Facts, Figure, Result, Sentence, Table, row_of

KINDS = {
    "mass": "unstrained mass",
    "edge": "from the rim edge",
    "inner": "from the inner face",
    "outer": "from the outer face",
}
CUTS = "number: cut | azimuth_deg: azimuth (°) .2f | height_mm: height z (mm) .3f | mass_ug: mass (µg) .3f | depth_um: depth (µm) .3f | done"
STATES = "state | harmonic: n | split_Hz: split (mHz) ×1e3 .3f | error_Hz: standard error (mHz) ×1e3 .3f | most_Hz: 95 % upper limit (mHz) ×1e3 .3f | slow_axis_deg: slow axis (°) .2f"

CELLS = {"azimuth_deg": ".4f", "position": ".6f", "height_mm": ".4f", "mass_ug": ".5f", "depth_um": ".4f"}  # of --out
NEGLIGIBLE = 1e-4  # of a known imbalance: what is left of it below counts as none
UNLIKELY = 5.0  # standard errors of the prediction, by which a measured gain is doubted
LIMIT = "Upper limit: the split is the length of a vector with this standard error in each component; the limit is exceeded with 5 % probability."


@answers("hrg.trim/1")
def trim(
    card: Card,
    *,
    split: Annotated[tuple[float, ...], MANY] = (),
    axis: Annotated[tuple[float, ...], MANY] = (),
    harmonic: Annotated[tuple[int, ...], MANY] = (2,),
    reading_error: float | None = None,
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
    temperature: Temperature = None,
    out: str | None = None,
) -> Result:
    """Plan the cuts that null measured splits with the least mass, preserve the balance, and do not overshoot.

    Make the cuts, measure, and plan the next round from the new splits. The effect of a cut depends on its place: at the edge
    or on a face it also removes strain energy; a tooth carries almost none. A narrow, deep groove relieves stress beside it, which
    can cancel or reverse its effect; the plan solves this for the planned depth. Wide, shallow cuts and teeth are the most
    predictable. An edge cut ends along the normal of the wall; ground flat, parallel to the rim, it changes the split 4 to 6 % less.

    Args:
        split: Measured splits in Hz, one for each --harmonic; by default the card's (hrg fit ringdown --save).
        axis: Azimuth in degrees of an antinode of the slower mode, one for each split.
        harmonic: Harmonic n of each split.
        reading_error: Standard error of the splits in Hz; by default that of the ring-down in the card, else 0.0001.
        scan: Output of hrg scan --json, instead of --split and --axis: the splits of --harmonic and their intervals.
        goal: Largest acceptable split in Hz.
        cut: mass (unstrained, such as teeth or lumps), edge (from the rim, through the wall), inner or outer face.
        position: Permitted positions of cuts along the meridian, 0 ... 1 (rim).
        width_mm: Width of a cut along the circumference.
        length_mm: Length of a cut along the meridian.
        depth_limit: Largest depth of a cut, as a fraction of the wall.
        teeth: Number of teeth at the rim; cuts are then made on teeth only.
        tooth_azimuth: Azimuth of the first tooth in degrees.
        tooth_limit_ug: Largest mass to remove from a tooth.
        unbalance: Known mass imbalance to correct by the same cuts, as far as they may be deep, by harmonic: 1:120@35 (k = 1, 120 µg at 35°).
            It takes about twice its mass besides. Others are kept.
        removal_error: Relative standard error of the mass of each cut.
        gain_error: Relative standard error common to all cuts.
        gain: Measured over predicted change of the split in the last round; negative if in the opposite direction.
        out: Write the cuts as CSV, for the machine.
    """
    instrument, T, resonator, elastic = open_resonator(card, temperature)
    if scan is not None:
        measured = read_scan(scan, harmonic)
    else:
        measured = pair_splits(split, axis, harmonic, reading_error, instrument)
    tool = Tool(1e-3 * width_mm, 1e-3 * length_mm, depth_limit)
    known = read_unbalance(unbalance)
    planned = plan_for_card(
        resonator, elastic, measured, goal=goal, heights=position, tool=tool, kind=cut,
        teeth=Teeth(teeth, np.deg2rad(tooth_azimuth), 1e-9 * tooth_limit_ug) if teeth else None,
        removal_error=removal_error, gain_error=gain_error, gain=gain, unbalance=known,
    )  # fmt: skip
    plan = planned.plan
    others = other_cuts(resonator, elastic, measured[0][0], cut)
    payload: dict[str, Any] = {
        "card": instrument.name,
        "temperature_degC": T - zero_Celsius,
        "goal_Hz": goal,
        "cut": cut,
        "before": [_state(s) for s in plan.before],
        "rounds": [_round(planned, resonator)],
        "mass_ug": 1e9 * plan.mass,
        "gains": gains(planned),
        "other_cuts": others,
        "measure": [*doubt_gain(planned, gain, gain_error), *measure_after(planned)],
    }
    if out is not None:
        rows = (
            [f"{c[key]:{form}}" if c[key] is not None else "" for key, form in CELLS.items()]
            for c in payload["rounds"][0]["cuts"]
        )
        write_csv(out, ["round", *CELLS], (["1", *row] for row in rows))
        say(f"wrote {out}")
    return Result(
        payload,
        f"Trimming plan for {instrument.name}",
        "The cuts of this round, what to measure after them, and the split expected. The next round is planned from that measurement.",
        _parts(planned, payload, known),
    )


def _parts(planned: CardPlan, payload: dict[str, Any], known: Mapping[int, complex]) -> list[Chapter]:
    first, plan = payload["rounds"][0], planned.plan
    in_order = sorted(first["cuts"], key=lambda one: (one["azimuth_deg"], one["position"]))
    cuts = [{"number": k, "done": "☐"} | one for k, one in enumerate(in_order, 1)]
    states = [
        {"state": label} | one
        for label, splits in (("measured", payload["before"]), ("expected after the cuts", first["after"]))
        for one in splits
    ]
    axes = ", ".join(f"n = {one['harmonic']} at {one['slow_axis_deg']:.1f}°" for one in payload["before"])
    limit = f"below {plain(1e3 * max(one['most_Hz'] for one in first['after']))} mHz"
    met = max(one["most_Hz"] for one in payload["before"]) <= plan.goal
    goal = f"goal {plain(1e3 * plan.goal)} mHz" + ("" if plan.is_enough else ": another round is needed")
    kinds = ", ".join(f"{KINDS[kind]} {value:+.2f}" for kind, value in payload["other_cuts"].items()).replace("-", "−")
    return [
        Chapter("Cuts", [
            Facts([
                ("Measured split", ", ".join(f"{plain(1e3 * one['split_Hz'], 4)} mHz" for one in payload["before"]), f"slow axis of {axes}"),
                ("Mass to remove", f"{first['mass_ug']:.3g} µg", f"{len(cuts)} cuts, {100 * first['share']:.0f} % of the split" + (", to avoid overshoot" if first["share"] < 1 else "")),
                ("Expected split", limit, f"95 % limit; {goal}"),
            ]),
            "The measured split is within the goal: no cut is needed; these would lower it further." if met else None,
            Table("Cuts of this round", cuts, CUTS, f"Total {first['mass_ug']:.4g} µg."),
            _balance(known, plan),
            *payload["measure"],
            Sentence(f"Type of cut in this plan: {KINDS[payload['cut']]}. Effect of the same mass at the rim by type of cut, relative to this one: {kinds}."
                " Negative: the split changes in the opposite direction.", "note", "page"),
        ]),
        Chapter("Position of the cuts", [Figure(lambda: _draw_polar(plan, cuts),
            "The rim seen along the axis. Coloured curves: the split of each mode, outermost at the antinodes of the slower mode (dashed). Black bars: the cuts of the table, length by mass.")]),
        Chapter("Expected result", [Table("Splits before and after the cuts", states, STATES, LIMIT)]),
    ]  # fmt: skip


def gains(planned: CardPlan) -> list[dict[str, float]]:
    """The change by each planned groove over that by the shape derivative, with its 90 % interval."""
    found = [
        (x, n, g := cut.gain(n), NINETY * cut.error * abs(g)) for x, cut in planned.cuts.items() for n in cut.splits
    ]
    return [{"position": x, "harmonic": n, "value": v, "low": v - reach, "high": v + reach} for x, n, v, reach in found]


def _round(planned: CardPlan, resonator: Resonator) -> dict[str, Any]:
    one, cuts = planned.plan, planned.cuts
    return {
        **row_of(one, "share", mass_ug=("mass", 1e9)),
        "cuts": [
            row_of(c, "position", azimuth_deg=("azimuth", degrees(1)), mass_ug=("mass", 1e9))
            | {"height_mm": 1e3 * float(resonator.at([c.position * resonator.length]).z[0])}
            | {"depth_um": 1e6 * cuts[c.position].depth(c.mass) if cuts else None}
            for c in one.cuts
        ],
        "after": [_state(s) for s in one.after],
        "unbalance": {str(k): [1e9 * abs(u), degrees(float(np.angle(u)) / k)] for k, u in one.unbalance.items()},
    }


def _balance(known: Mapping[int, complex], plan: TrimPlan) -> str | None:
    """Return how much of the known imbalance the cuts leave."""
    if not known:
        return None
    rest = {k: abs(plan.unbalance[k]) for k in known}
    left = {k: rest[k] if rest[k] > NEGLIGIBLE * abs(u) else 0.0 for k, u in known.items()}
    parts = [f"k = {k}: {plain(1e9 * abs(u))} → {plain(1e9 * left[k])} µg" for k, u in known.items()]
    more = " These cuts can take no more: longer, wider or more cuts (teeth with a higher limit) correct the rest."
    return f"Mass imbalance before → after the cuts: {', '.join(parts)}.{more if any(left.values()) else ''}"


def doubt_gain(planned: CardPlan, gain: float, error: float) -> list[str]:
    """Return the sentence on a measured gain that the prediction of the last round all but excludes."""
    known = error_of_gain(planned.cuts, error)
    if abs(gain - 1.0) <= UNLIKELY * known:
        return []
    return [
        f"--gain {gain:g}: the prediction is known to ± {100 * known:.2g} %, so the last round should have given about 1. Check the masses, the"
        " readings and the axis before the next cuts: was the mode measured with the same electrodes?"
    ]


def measure_after(planned: CardPlan) -> list[str]:
    """Return how certain the cuts are, what to measure after them, and how to use it."""
    plan, found = planned.plan, []
    for entry in gains(planned):
        value, error = entry["value"], (entry["high"] - entry["low"]) / 2
        number, spread = to_error(value, error)
        found.append(
            f"A groove of this depth at position {entry['position']:g} has {number} ± {spread} (90 %) times the effect of "
            f"a wide, shallow cut of the same mass on the split of n = {entry['harmonic']}."
            + (" Cuts side by side count as one groove." if planned.cuts[entry["position"]].touching > 1.01 else "")
        )
        if abs(value - 1) > 0.15 or error > 0.15:
            found.append("Stress relief beside the groove is large; wider, shallower cuts (--width-mm) or teeth are surer.")  # fmt: skip
    for state in plan.after:
        spread_Hz = state.error * state.frequency
        expected = " ± ".join(to_error(1e3 * state.hertz, 1e3 * spread_Hz))
        found.append(
            f"After the cuts, measure the split of n = {state.harmonic} to ± {1e3 * min(plan.goal / 4, max(spread_Hz / 5, plan.goal / 10)):.2g} mHz, and its axis. "
            f"Expected: {expected} mHz. If the measured split differs from it by more than twice that error, plan the next round with --gain, the ratio of measured to predicted change "
            "(negative if the split changed in the opposite direction)."
        )
    still = "Let the shell return to thermal equilibrium before each reading, and measure the same mode with the same electrodes."
    return [*found, still]


def _state(state: SplitWave) -> dict[str, Any]:
    row = row_of(state, "harmonic", frequency_Hz="frequency", split_Hz="hertz", most_Hz="most")
    return row | {"error_Hz": state.error * state.frequency, "slow_axis_deg": degrees(state.slow_axis)}


def _draw_polar(plan: TrimPlan, cuts: Sequence[dict[str, Any]]) -> Drawing:
    theta = np.linspace(0, 2 * np.pi, 721)
    with figure(1, 2, 4.2, subplot_kw={"projection": "polar"}) as (made, axes):
        titles = ("measured, with the cuts", "expected after the cuts")
        for ax, states, title in zip(axes, (plan.before, plan.after), titles, strict=True):
            size = max(s.hertz for s in plan.before)
            ax.plot(theta, np.ones_like(theta), color="#888888", lw=1)
            for state, colour in zip(states, (VERMILION, BLUE, GREEN, "black"), strict=False):
                rose = 1 + 0.35 * state.hertz / size * np.cos(2 * state.harmonic * (theta - state.slow_axis))
                label = f"n = {state.harmonic}: {plain(1e3 * state.hertz)} mHz"
                ax.plot(theta, rose, color=colour, lw=1.6, label=label)
                for k in range(2 * state.harmonic):
                    at = state.slow_axis + k * np.pi / state.harmonic
                    ax.plot([at, at], [0, 0.9], color=colour, lw=0.8, ls="--")
            if states is plan.before:
                most = max(cut["mass_ug"] for cut in cuts)
                for number, cut in enumerate(cuts, 1):
                    azimuth, length = np.deg2rad(cut["azimuth_deg"]), 0.25 * cut["mass_ug"] / most + 0.03
                    ax.bar(azimuth, length, width=0.06, bottom=1.0, color="black", alpha=0.75)
                    ax.text(azimuth, 1.44, str(number), ha="center", va="center", fontsize=8)
            ax.set(ylim=(0, 1.55), yticks=[])
            ax.tick_params(labelsize=8, pad=1)  # so that 0° of one and 180° of the other stand apart
            ax.set_title(title, fontsize=10)
            ax.legend(loc="lower center", bbox_to_anchor=(0.5, -0.28), fontsize=8)
        return made
