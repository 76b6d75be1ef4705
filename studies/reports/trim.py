"""Picture of a trimming plan: cuts and splits over azimuth."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from shell.trimming import TrimPlan
from studies.reports.digits import plain
from studies.reports.style import BLUE, GREEN, VERMILION, figure
from studies.results import Drawing


def polar(plan: TrimPlan, cuts: Sequence[dict[str, Any]]) -> Drawing:
    """Return the cuts as bars on the rim, and the splits as curves around it, before and as expected after the cuts."""
    theta = np.linspace(0, 2 * np.pi, 721)
    with figure(1, 2, 4.2, subplot_kw={"projection": "polar"}) as (made, axes):
        titles = ("measured, with the cuts", "expected after the cuts")
        for ax, states, title in zip(axes, (plan.before, plan.round.after), titles, strict=True):
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
