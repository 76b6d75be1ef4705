"""`hrg loss`: 1/Q over temperature as a sum of its parts, and which part to attack first.

Schema hrg.loss/1: `card`, `harmonic`, `theory`, `frequency_Hz`; over `temperature_degC`: `inverse_q` with its 90 % interval
`inverse_q_low`, `inverse_q_high`, `q`, `slope_per_K` (d ln(1/Q)/dT); `parts`, largest first, each with `name`, `inverse_q`, `low`,
`high`, `slope_per_K`, `relative_sd`, `source`; `attack_first` with `part`, `q_without`, `advice`; `least_known`; `anisotropy` (null
where nothing varies around) with `inverse_q_split`, `damping_axis_deg`, `largest_drift_deg_per_h`; `left_out`, sentences; `stated`
(null where the card states no 1/Q) with `inverse_q`, and the `explained` share of it with `explained_low`, `explained_high`.
"""

from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from studies.cli.output import Answer, answers

if TYPE_CHECKING:
    from shell.damping.budget import Budget, LossPart
    from studies.instrument.card import Instrument
    from studies.loss import LossModel

MOST_POINTS = 10_000


@answers("hrg.loss/1")
def loss(
    card: str,
    *,
    from_degC: Annotated[float, Parameter(name="--from")] = -20.0,
    to_degC: Annotated[float, Parameter(name="--to")] = 40.0,
    step: float = 10.0,
    harmonic: int = 2,
    theory: Literal["solid", "shell"] = "solid",
    anchor: bool = False,
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
    """
    import numpy as np
    from scipy.constants import zero_Celsius

    from studies.errors import InputError
    from studies.instrument.card import load_card
    from studies.loss import loss_model

    if not step > 0 or not to_degC >= from_degC:
        raise InputError(
            f"--from {from_degC:g} --to {to_degC:g} --step {step:g}: the step must be positive and --to not below --from."
        )
    if not (to_degC - from_degC) / step < MOST_POINTS:
        raise InputError(
            f"--from {from_degC:g} --to {to_degC:g} --step {step:g}: more than {MOST_POINTS} temperatures; take a longer step."
        )
    instrument = load_card(card)
    T = instrument.material.check(np.arange(from_degC, to_degC + 1e-9 * step, step) + zero_Celsius)
    model = loss_model(instrument, harmonic, theory, anchor)
    budget = model.budget(T)
    described = _describe(model, budget, harmonic, theory)
    yield {"schema": "hrg.loss/1", "card": instrument.name, **described, "stated": _stated(instrument, model)}
    _print(instrument.name, model, budget, harmonic, theory)
    _print_stated(_stated(instrument, model))


def _describe(model: "LossModel", budget: "Budget", harmonic: int, theory: str) -> "dict[str, Any]":
    from scipy.constants import zero_Celsius

    low, high = budget.interval
    return {
        "harmonic": harmonic,
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
        "anisotropy": _anisotropy(model, budget),
        "left_out": list(model.left_out),
    }


def _anisotropy(model: "LossModel", budget: "Budget") -> "dict[str, Any] | None":
    """What varies around: Δ(1/Q), the axis that is damped most, and the largest drift of the wave; None where nothing does."""
    import numpy as np

    from compensation.wave import StandingWave
    from shell.damping.anisotropy import describe_wave

    if not model.ripples:
        return None
    split, axis = describe_wave(model.wave(budget), model.harmonic)
    omega = model.vibration.omega(budget.temperatures)
    wave = StandingWave(
        omega,
        2 / (omega * budget.inverse_q),
        omega * split / 2,
        axis,
        harmonic=model.harmonic,
        bryan_factor=model.bryan_factor,
    )
    worst = np.degrees(wave.drift(axis + np.pi / (4 * model.harmonic))) * 3600
    return {"inverse_q_split": split, "damping_axis_deg": np.degrees(axis), "largest_drift_deg_per_h": worst}


def _stated(instrument: "Instrument", model: "LossModel") -> "dict[str, Any] | None":
    """What the card says of 1/Q at its reference temperature beside what the parts explain of it; None where it says nothing."""
    if "inverse_q" not in instrument.content.get("loss", {}) or model.harmonic != 2:
        return None
    stated = instrument.loss.inverse_q
    budget = model.budget(instrument.reference_temperature)
    low, high = (float(end[0]) for end in budget.interval)
    return {
        "inverse_q": stated,
        "explained": float(budget.inverse_q[0]) / stated,
        "explained_low": low / stated,
        "explained_high": high / stated,
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


def _print(name: str, model: "LossModel", budget: "Budget", harmonic: int, theory: str) -> None:
    import numpy as np
    from scipy.constants import zero_Celsius

    from studies.cli.output import print_table

    low, high = budget.interval
    rows = [
        [
            f"{T - zero_Celsius:.1f}",
            _plain(1 / total),
            f"{_plain(1 / most)} … {_plain(1 / least)}",
            f"{1e9 * total:.3g}",
            f"{rise:+.2f}",
        ]
        for T, total, least, most, rise in zip(
            budget.temperatures, budget.inverse_q, low, high, 100 * budget.slope, strict=True
        )
    ]
    title = f"{name}, n = {harmonic}, {model.frequency:.1f} Hz, {theory}"
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
                f"{least:.2g} … {most:.2g}",
                f"{100 * part.slope[middle]:+.2f}",
                part.source,
            ]
        )
    degrees = [f"{budget.temperatures[k] - zero_Celsius:.0f} °C" for k in shown]
    note = f"1/Q in 1e-9; share, 90 % interval and slope at {budget.temperatures[middle] - zero_Celsius:.0f} °C."
    print_table("Parts", ["part", "share", *degrees, "90 %", "%/°C", "source"], table, note)
    around = _anisotropy(model, budget)
    if around is not None:
        columns = ["T (°C)", "Δ(1/Q) (1e-9)", "axis (°)", "drift at most (°/h)"]
        fields = ("inverse_q_split", "damping_axis_deg", "largest_drift_deg_per_h")
        lines = [
            [f"{T - zero_Celsius:.1f}", f"{1e9 * split:.3g}", f"{axis:.2f}", f"{drift:.4g}"]
            for T, split, axis, drift in zip(budget.temperatures, *(around[field] for field in fields), strict=True)
        ]
        print_table("Around the axis", columns, lines, "Axis: azimuth of the pattern that is damped most.")
    without, first = float(budget.without(budget.first.name)[middle]), budget.first
    gain = "nothing known would be left" if not np.isfinite(without) else f"without it Q would be {_plain(without)}"
    print(f"Attack first: {first.name}; {gain}. {_sentence(first.advice)}")
    known = budget.least_known.name
    print("It is also the least known." if known == first.name else f"Least known: {known}.")
    for sentence in model.left_out:
        print(f"Not in the budget: {sentence}")


def _print_stated(stated: "dict[str, Any] | None") -> None:
    if stated is None:
        return
    share, low, high = (100 * stated[key] for key in ("explained", "explained_low", "explained_high"))
    print(
        f"The card states Q = {_plain(1 / stated['inverse_q'])}: the parts explain {share:.0f} % of its loss (90 %: {low:.0f} … {high:.0f} %)."
    )
    if high < 100:
        print("More is lost than these parts allow: look for a cause that the card does not have.")
    elif low > 100:
        print("Less is lost than these parts say: one of them is too large.")


def _plain(value: float) -> str:
    """Three digits, 7.28e6 for 7.28e+06."""
    return f"{value:.3g}".replace("e+0", "e").replace("e+", "e")


def _sentence(words: str) -> str:
    return words[:1].upper() + words[1:] + "." if words else ""
