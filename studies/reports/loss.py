"""Pictures of a loss budget: its parts, their course over temperature, and what the wall takes part in."""

import numpy as np

from shell.constants import zero_Celsius
from shell.damping.budget import Budget, LossPart
from studies.loss.account import StatedLoss
from studies.loss.model import LossModel
from studies.reports import style
from studies.results import Drawing

DASHES = ("-", "--", ":")
SMALLEST = 1e-6  # of the sum: smaller parts are in the tables, not in the pictures


def bars(budget: Budget, at: int) -> Drawing:
    """The parts at one temperature with their intervals, largest on top."""
    parts = _shown(budget, at)
    with style.figure(height=0.34 * len(parts) + 1.0, x="1/Q (1e−9)") as (made, axis):
        place = np.arange(len(parts))[::-1]
        values = 1e9 * np.array([part.inverse_q[at] for part in parts])
        low, high = (1e9 * np.array([part.interval[end][at] for part in parts]) for end in (0, 1))
        axis.barh(place, values, color=[style.COLOURS[k % 7] for k in range(len(parts))], height=0.6)
        ends = {"fmt": "none", "ecolor": style.BLACK, "capsize": 3, "linewidth": 1.0}
        axis.errorbar(values, place, xerr=[values - low, high - values], **ends)
        shares = [100 * part.inverse_q[at] / budget.inverse_q[at] for part in parts]
        axis.set_yticks(place, [f"{part.name}, {share:.3g} %" for part, share in zip(parts, shares, strict=True)])
        axis.set_xlim(left=0.0)
        return made


def course(budget: Budget, stated: StatedLoss | None, reference: float) -> Drawing:
    """1/Q and its parts over temperature."""
    degrees, middle = budget.temperatures - zero_Celsius, len(budget.temperatures) // 2
    low, high = budget.interval
    with style.figure(height=4.0, x="temperature (°C)", y="1/Q") as (made, axis):
        axis.fill_between(degrees, low, high, color=style.BLACK, alpha=0.12, linewidth=0)
        axis.plot(degrees, budget.inverse_q, color=style.BLACK, linewidth=2.2, label="sum, with its 90 % interval")
        for k, part in enumerate(_shown(budget, middle)):
            course = np.where(part.inverse_q > 0, part.inverse_q, np.nan)
            axis.plot(degrees, course, DASHES[k // 7 % 3], color=style.COLOURS[k % 7], label=part.name)
        if stated is not None:
            axis.plot(reference - zero_Celsius, stated.inverse_q, "k*", markersize=11, label="stated in the card")
        axis.set_yscale("log")
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=9)
        return made


def along(model: LossModel) -> Drawing:
    """What the faces of the wall take part in, both together, over the meridian."""
    faces = model.vibration.faces
    area, order = faces[0].area + faces[1].area, np.argsort(faces[0].position)
    shares = {
        "energy": [face.energy for face in faces],
        "area strain": [face.stretch**2 for face in faces],
        "normal motion": [face.moved[2] ** 2 for face in faces],
    }
    x, y = "position on the meridian, 0 where it starts, 1 where it ends", "per area, over its mean"
    with style.figure(height=3.0, x=x, y=y) as (made, axis):
        for (words, parts), dash, colour in zip(shares.items(), DASHES, style.COLOURS, strict=False):
            density = np.sum(parts, axis=0)
            mean = float(np.sum(density * area) / np.sum(area)) or 1.0
            axis.plot(faces[0].position[order], density[order] / mean, dash, color=colour, label=words)
        axis.set_ylim(bottom=0.0)
        return made


def _shown(budget: Budget, at: int) -> list["LossPart"]:
    return [part for part in budget.parts if part.inverse_q[at] > SMALLEST * budget.inverse_q[at]]
