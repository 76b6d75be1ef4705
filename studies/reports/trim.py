"""The page of a trimming plan, for a technician: polar pictures before and after, the table of cuts, what to measure."""

from typing import TYPE_CHECKING, Any

import numpy as np

from studies.reports.page import Chapter, Facts, Picture, Table, Text, draw, render_page
from studies.reports.style import BLUE, GREEN, VERMILION, figure

if TYPE_CHECKING:
    from shell.trimming import TrimPlan

LEAD = "Make these cuts, let the shell return to temperature, measure, and plan the next round from the measurement."


def write_trim_page(path: str, plan: "TrimPlan", payload: dict[str, Any]) -> None:
    """Write the page, whole or not at all."""
    from studies.files.writing import write_text

    write_text(path, render_page(f"Trimming plan for {payload['card']}", LEAD, _chapters(plan, payload)))


def _chapters(plan: "TrimPlan", payload: dict[str, Any]) -> list[Chapter]:
    before, last, first = payload["before"], payload["rounds"][0]["after"], payload["rounds"][0]
    axes = ", ".join(f"n = {s['harmonic']} at {s['slow_axis_deg']:.1f}°" for s in before)
    facts = Facts([
        ("Split now", ", ".join(f"{1e3 * s['split_Hz']:.3g} mHz" for s in before), f"slow axis of {axes}"),
        ("This round takes", f"{first['mass_ug']:.3g} µg", f"{len(first['cuts'])} cuts, {100 * first['share']:.0f} % of the split"),
        ("Expected after it", f"below {1e3 * max(s['most_Hz'] for s in last):.2g} mHz", f"goal {1e3 * plan.goal:.2g} mHz" + ("" if plan.is_enough else ": a further round is needed")),
    ])  # fmt: skip
    measure = [Text(sentence) for sentence in payload["measure"]]
    kinds = ", ".join(f"{kind} {value:+.2f}" for kind, value in payload["other_cuts"].items()).replace("-", "−")
    warning = Text(
        f"Planned as '{payload['cut']}'. The same mass at the rim moves the split, relative to this kind of cut, by: {kinds}. A negative "
        "number moves it the other way. If the cuts show another effect than predicted, plan the next round with `--gain`.",
        "note",
    )
    return [
        Chapter("What to do", [facts, _cuts(payload), *measure, warning]),
        Chapter("Where", [_polar(plan, payload)]),
        Chapter("What is expected", [_states(payload)]),
    ]


def _cuts(payload: dict[str, Any]) -> Table:
    one = payload["rounds"][0]
    columns, rows = ["Cut", "Azimuth (°)", "Height z (mm)", "Mass (µg)"], []
    deep = one["cuts"][0]["depth_um"] is not None
    columns += ["Depth (µm)"] * deep + ["Done"]
    for k, c in enumerate(_in_order(one["cuts"]), 1):
        row = [str(k), f"{c['azimuth_deg']:.2f}", f"{c['height_mm']:.3f}", f"{c['mass_ug']:.3f}"]
        rows.append([*row, *([f"{c['depth_um']:.3f}"] if deep else []), "☐"])
    return Table("Cut this", columns, rows, f"{one['mass_ug']:.4g} µg together.")


def _in_order(cuts: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return sorted(cuts, key=lambda cut: (cut["azimuth_deg"], cut["position"]))


def _states(payload: dict[str, Any]) -> Table:
    stages = [
        ("measured", payload["before"]),
        ("after the cuts, expected", payload["rounds"][0]["after"]),
    ]
    rows = [
        [label, str(s["harmonic"]), f"{1e3 * s['split_Hz']:.3f}", f"{1e3 * s['error_Hz']:.3f}", f"{1e3 * s['most_Hz']:.3f}", f"{s['slow_axis_deg']:.1f}"]
        for label, states in stages
        for s in states
    ]  # fmt: skip
    return Table("Splits", ["State", "n", "Split (mHz)", "Error (mHz)", "95 % below (mHz)", "Slow axis (°)"], rows)


def _polar(plan: "TrimPlan", payload: dict[str, Any]) -> Picture:
    """Cuts as wedges on the rim; the split as a rose around it, before and as expected after round 1."""
    first, cuts = plan.round, _in_order(payload["rounds"][0]["cuts"])
    theta = np.linspace(0, 2 * np.pi, 721)
    with figure(1, 2, 4.2, subplot_kw={"projection": "polar"}) as (made, axes):
        for ax, states, title in zip(
            axes,
            (plan.before, first.after),
            ("Now, with the cuts", "After the cuts, as expected"),
            strict=True,
        ):
            size = max(s.hertz for s in plan.before)
            ax.plot(theta, np.ones_like(theta), color="#888888", lw=1)
            for state, colour in zip(states, (VERMILION, BLUE, GREEN, "black"), strict=False):
                rose = 1 + 0.35 * state.hertz / size * np.cos(2 * state.harmonic * (theta - state.slow_axis))
                ax.plot(theta, rose, color=colour, lw=1.6, label=f"n = {state.harmonic}: {1e3 * state.hertz:.3g} mHz")
                for k in range(2 * state.harmonic):
                    at = state.slow_axis + k * np.pi / state.harmonic
                    ax.plot([at, at], [0, 0.9], color=colour, lw=0.8, ls="--")
            if states is plan.before:
                most = max(cut["mass_ug"] for cut in cuts)
                for number, cut in enumerate(cuts, 1):
                    azimuth, length = np.deg2rad(cut["azimuth_deg"]), 0.25 * cut["mass_ug"] / most + 0.03
                    ax.bar(azimuth, length, width=0.06, bottom=1.0, color="black", alpha=0.75)
                    ax.text(azimuth, 1.44, str(number), ha="center", va="center", fontsize=8)
            ax.set_ylim(0, 1.55)
            ax.set_yticks([])
            ax.set_title(title, fontsize=10)
            ax.legend(loc="lower center", bbox_to_anchor=(0.5, -0.28), fontsize=8)
        caption = "The rim over azimuth. Waves stand out where the slower mode swings (dashed: its antinodes); black: the cuts of the table."
        return draw(made, caption, "polar pictures of the split before and after the cuts")
