"""`hrg loss`: 1/Q over temperature as a sum of its parts, and which part to attack first.

Schema hrg.loss/1: `card`, `harmonic`, `theory`, `frequency_Hz`; over `temperature_degC`: `inverse_q` with its 90 % interval
`inverse_q_low`, `inverse_q_high`, `q`, `slope_per_K` (d ln(1/Q)/dT); `parts`, largest first, each with `name`, `inverse_q`, `low`,
`high`, `slope_per_K`, `relative_sd`, `source`; `attack_first` with `part`, `q_without`, `advice`; `least_known`; `anisotropy` (null
where nothing varies around) with `inverse_q_split`, `damping_axis_deg`, `largest_drift_deg_per_h`; `left_out`, sentences; `stated`
(null where the card states no 1/Q) with `inverse_q`, and the `explained` share of it with `explained_low`, `explained_high`.
"""

from typing import TYPE_CHECKING, Any, Literal

from studies.cli.arguments import FromDegC, ToDegC, lay_temperatures
from studies.cli.output import Answer, answers

if TYPE_CHECKING:
    from shell.damping.budget import Budget, LossPart
    from studies.loss import LossModel
    from studies.loss_account import DampingAround, StatedLoss


@answers("hrg.loss/1")
def loss(
    card: str,
    *,
    from_degC: FromDegC = -20.0,
    to_degC: ToDegC = 40.0,
    step: float = 10.0,
    harmonic: int = 2,
    theory: Literal["solid", "shell"] = "solid",
    anchor: bool = False,
    report: str | None = None,
) -> Answer:
    """Show Q over temperature, where its loss comes from, and which part to attack first.

    Heat through the wall, loss of the bulk and of the surface follow from geometry and material; films, gas, activated losses,
    imbalance and what the mount takes are keys of the card's table [loss] and of [[loss.film]] and [[loss.activated]].

    Parameters
    ----------
    card : str
        Path of a card, or the name of one that ships (hrg cards).
    from_degC : float
        Lowest temperature in °C.
    to_degC : float
        Highest temperature in °C.
    step : float
        Step in °C.
    harmonic : int
        Circumferential harmonic n.
    theory : str
        solid (three-dimensional) or shell (Naghdi).
    anchor : bool
        Compute what a stem sends into the body that it stands on (a second or two).
    report : str
        Write a page (HTML).
    """
    from studies.cli.output import say
    from studies.instrument.card import load_card
    from studies.loss import loss_model
    from studies.loss_account import damping_around, stated_loss

    temperatures = lay_temperatures(from_degC, to_degC, step)
    instrument = load_card(card)
    T = instrument.material.check(temperatures)
    model = loss_model(instrument, harmonic, theory, anchor)
    budget = model.budget(T)
    around, stated = damping_around(model, budget), stated_loss(instrument, model)
    if report is not None:
        from studies.files.writing import write_text
        from studies.reports.loss import loss_page

        write_text(report, loss_page(instrument, model, budget, theory))
        say(f"report: {report}")
    described = _describe(model, budget, theory)
    yield {
        "schema": "hrg.loss/1",
        "card": instrument.name,
        **described,
        "anisotropy": _around(around),
        "left_out": list(model.left_out),
        "stated": _stated(stated),
    }
    _print(instrument.name, model, budget, theory)
    if around is not None:
        _print_around(budget, around)
    _print_advice(model, budget)
    if stated is not None:
        _print_stated(stated)


def _describe(model: "LossModel", budget: "Budget", theory: str) -> "dict[str, Any]":
    from scipy.constants import zero_Celsius

    low, high = budget.interval
    return {
        "harmonic": model.harmonic,
        "theory": theory,
        "frequency_Hz": model.frequency,
        "temperature_degC": budget.temperatures - zero_Celsius,
        "inverse_q": budget.inverse_q,
        "inverse_q_low": low,
        "inverse_q_high": high,
        "q": 1 / budget.inverse_q,
        "slope_per_K": budget.slope,
        "parts": [_part(part) for part in budget.parts],
        "attack_first": {
            "part": budget.first.name,
            "q_without": budget.without(budget.first.name),
            "advice": budget.first.advice,
        },
        "least_known": budget.least_known.name,
    }


def _around(found: "DampingAround | None") -> "dict[str, Any] | None":
    import numpy as np

    if found is None:
        return None
    return {
        "inverse_q_split": found.split,
        "damping_axis_deg": np.degrees(found.axis),
        "largest_drift_deg_per_h": found.drift,
    }


def _stated(found: "StatedLoss | None") -> "dict[str, Any] | None":
    if found is None:
        return None
    return {
        "inverse_q": found.inverse_q,
        "explained": found.explained,
        "explained_low": found.low,
        "explained_high": found.high,
    }


def _part(part: "LossPart") -> "dict[str, Any]":
    low, high = part.interval
    return {
        "name": part.name,
        "inverse_q": part.inverse_q,
        "low": low,
        "high": high,
        "slope_per_K": part.slope,
        "relative_sd": part.relative_sd,
        "source": part.source,
    }


def _print(name: str, model: "LossModel", budget: "Budget", theory: str) -> None:
    import numpy as np
    from scipy.constants import zero_Celsius

    from studies.cli.output import print_table
    from studies.loss_account import write_quality
    from studies.reports.digits import plain

    low, high = budget.interval
    rows = [
        [
            f"{T - zero_Celsius:.1f}",
            write_quality(1 / total),
            f"{write_quality(1 / most)} … {write_quality(1 / least)}",
            f"{1e9 * total:.3g}",
            f"{rise:+.2f}",
        ]
        for T, total, least, most, rise in zip(
            budget.temperatures, budget.inverse_q, low, high, 100 * budget.slope, strict=True
        )
    ]
    title = f"{name}, n = {model.harmonic}, {model.frequency:.1f} Hz, {theory}"
    print_table(title, ["T (°C)", "Q", "90 %", "1/Q (1e-9)", "1/Q (%/°C)"], rows)
    middle = int(np.argmin(abs(budget.temperatures - model.vibration.reference)))
    shown = sorted({0, middle, len(budget.temperatures) - 1})
    table = []
    for part in budget.parts:
        least, most = (1e9 * float(end[middle]) for end in part.interval)
        share = 100 * part.inverse_q[middle] / budget.inverse_q[middle]
        table.append(
            [
                part.name,
                f"{share:.3g} %",
                *(f"{1e9 * part.inverse_q[k]:.3g}" for k in shown),
                f"{plain(least, 2)} … {plain(most, 2)}",
                f"{100 * part.slope[middle]:+.2f}",
                part.source,
            ]
        )
    degrees = [f"{budget.temperatures[k] - zero_Celsius:.0f} °C" for k in shown]
    note = f"1/Q in 1e-9; share, 90 % interval and slope at {budget.temperatures[middle] - zero_Celsius:.0f} °C."
    print_table("Parts", ["part", "share", *degrees, "90 %", "%/°C", "source"], table, note)


def _print_around(budget: "Budget", around: "DampingAround") -> None:
    import numpy as np
    from scipy.constants import zero_Celsius

    from studies.cli.output import print_table

    columns = ["T (°C)", "Δ(1/Q) (1e-9)", "axis (°)", "drift at most (°/h)"]
    lines = [
        [f"{T - zero_Celsius:.1f}", f"{1e9 * split:.3g}", f"{axis:.2f}", f"{drift:.4g}"]
        for T, split, axis, drift in zip(
            budget.temperatures, around.split, np.degrees(around.axis), around.drift, strict=True
        )
    ]
    print_table("Around the axis", columns, lines, "Axis: azimuth of the pattern that is damped most.")


def _print_advice(model: "LossModel", budget: "Budget") -> None:
    import numpy as np

    from studies.loss_account import write_quality

    middle = int(np.argmin(abs(budget.temperatures - model.vibration.reference)))
    without, first = float(budget.without(budget.first.name)[middle]), budget.first
    gain = (
        "nothing known would be left" if not np.isfinite(without) else f"without it Q would be {write_quality(without)}"
    )
    print(f"Attack first: {first.name}; {gain}. {_sentence(first.advice)}")
    known = budget.least_known.name
    print("It is also the least known." if known == first.name else f"Least known: {known}.")
    for sentence in model.left_out:
        print(f"Not in the budget: {sentence}")


def _print_stated(stated: "StatedLoss") -> None:
    from studies.loss_account import write_quality

    share, low, high = (100 * part for part in (stated.explained, stated.low, stated.high))
    print(
        f"The card states Q = {write_quality(1 / stated.inverse_q)}: the parts explain {share:.0f} % of its loss (90 %: {low:.0f} … {high:.0f} %)."
    )
    if stated.verdict:
        print(stated.verdict)


def _sentence(words: str) -> str:
    return words[:1].upper() + words[1:] + "." if words else ""
