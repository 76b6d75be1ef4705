"""Generic forms: families of many columns and no physics (in temperature, rate, history, drive, time) that show unexplained structure."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from studies.effects import Coefficient, Effect, Parameter, Span
from studies.effects.states import States, lag, play
from studies.record import Record
from studies.simulation.drive import COLUMN

TEMPERATURE_ORDERS, TIME_ORDERS = 24, 24
LAGS = tuple(2.0**k for k in range(-4, 4))
"""Time constants of a heat path over that of the resonator."""
STRONG = {"frequency_Hz": 1e-4, "bias_deg_per_h": 10.0, "inverse_q": 0.3}


def _powers(x: Array, orders: int) -> Array:
    return np.stack([np.cos(k * np.arccos(np.clip(x, -1.0, 1.0))) for k in range(orders)], axis=1)


def _generic(
    name: str,
    columns: Callable[[States, Sequence[float], str], Array],
    spread: Sequence[float] | Array,
    needs: tuple[str, ...] = (),
) -> Effect:
    return Effect(
        name=name,
        summary="",
        source="",
        isolate="",
        coefficients=(Coefficient("size_{unit}", tuple(float(v) for v in spread)),),
        columns=columns,
        grid=lambda span, response: [()],
        sizes=STRONG,
        needs=needs,
        alike=True,
    )


def generic_forms(span: Span, runs: Sequence[States]) -> list[Effect]:
    """Return the generic forms of a campaign: of a drive, what it does where it leaves its mean, and no curve of the temperature."""
    low, high = span.temperature_low, span.temperature_high

    def place(states: States) -> Array:
        return np.asarray(np.clip((states.resonator - low) / max(high - low, 1e-9), 0.0, 1.0))

    def temperature(states: States, shape: Sequence[float], response: str) -> Array:
        return np.cos(np.pi * place(states)[:, None] * np.arange(2, TEMPERATURE_ORDERS))

    def rate(states: States, shape: Sequence[float], response: str) -> Array:
        fast = states.rate / max((high - low) / 3600.0, 1e-12)
        x = 2.0 * place(states) - 1.0
        curve = _powers(x, 4)
        return np.concatenate(
            [curve * fast[:, None], curve * (fast**2)[:, None], curve * np.abs(fast)[:, None]], axis=1
        )

    def history(states: States, shape: Sequence[float], response: str) -> Array:
        wide = high - low
        loops = play(states.resonator, [wide * part for part in (0.01, 0.03, 0.1, 0.25)])
        slow = [lag(states.resonator, states.step, span.longest_run * part) for part in (0.01, 0.04, 0.15, 0.6)]
        return np.asarray((np.concatenate([loops, np.stack(slow, 1)], axis=1) - states.resonator[:, None]) / wide)

    def time(states: States, shape: Sequence[float], response: str) -> Array:
        t = (states.time - states.time[0]) / max(float(np.ptp(states.time)), 1e-9)
        waves = np.cos(np.pi * t[:, None] * np.arange(1, TIME_ORDERS + 1))
        out = np.zeros((t.size, len(runs) * TIME_ORDERS))
        out[:, states.run * TIME_ORDERS : (states.run + 1) * TIME_ORDERS] = waves
        return out

    def drive(field: str) -> Callable[[States, Sequence[float], str], Array]:
        every = [own for run in runs if (own := getattr(run, field)) is not None]
        largest = max((float(np.abs(own).max()) for own in every), default=0.0) or 1e-12

        def powers(states: States) -> Array:
            values = np.asarray(getattr(states, field), dtype=float)
            if field == "pattern_angle":
                return np.stack([np.sin(4 * values), np.cos(4 * values)], axis=1)
            unit = values / largest
            return np.stack([unit, unit**2, unit**3, lag(unit, states.step, states.tau)], axis=1)

        # a drive that a run lacks has no form
        means = np.mean(np.concatenate([powers(run) for run in runs]), axis=0) if len(every) == len(runs) else 0.0

        def columns(states: States, shape: Sequence[float], response: str) -> Array:
            curve = _powers(2.0 * place(states) - 1.0, 4)
            return np.concatenate([curve * power[:, None] for power in (powers(states) - means).T], axis=1)

        return columns

    orders = np.arange(2, TEMPERATURE_ORDERS)
    forms = [
        _generic("temperature", temperature, 2.0 / orders),
        _generic("rate and temperature", rate, [1.0] * 12),
        _generic("history of the temperature", history, [1.0] * 8),
        replace(_generic("time", time, np.tile(1.0 / (1.0 + np.arange(TIME_ORDERS)), len(runs))), by_clock=True),
    ]
    for field, column in (
        ("voltage_squared", "electrode_bias_V"),
        ("amplitude_squared", "drive_amplitude_V"),
        ("quadrature", "quadrature_V"),
        ("pattern_angle", "pattern_angle_deg"),
    ):
        count = 16 if field != "pattern_angle" else 8
        forms.append(_generic(column, drive(field), [1.0] * count, (field,)))
    return forms


def beside_chamber(span: Span, records: Sequence[Record]) -> Effect:
    """Return the form of what the chamber does past the housing (sun, a gradient, the air in the electronics): its lead x of the housing, through lags, times 1 and the temperature."""
    wide = max(span.temperature_high - span.temperature_low, 1e-9)

    def columns(states: States, shape: Sequence[float], response: str) -> Array:
        time, air = records[states.run]["time_s"], records[states.run][COLUMN["chamber"]]
        known = np.isfinite(air)
        x = (np.interp(states.time + time[0], time[known], air[known]) + zero_Celsius - states.housing) / wide
        behind = np.stack([x, *(lag(x, states.step, span.tau * part) for part in (0.25, 1.0, 4.0))], axis=1)
        place = 2.0 * np.clip((states.resonator - span.temperature_low) / wide, 0.0, 1.0) - 1.0
        return np.concatenate([behind, behind * place[:, None]], axis=1)

    return _generic("the chamber's lead over the housing", columns, [1.0] * 8)


def any_lags(span: Span) -> Effect:
    """Return the form of a heat path of any kind: the housing through lags of all lengths, and that times the temperature, in which radiation and capacities go."""

    def columns(states: States, shape: Sequence[float], response: str) -> Array:
        x = (states.resonator - states.reference) / max(span.temperature_range, 1e-3)
        behind = np.stack([lag(states.housing, states.step, span.tau * part) for part in LAGS], axis=1)
        away = behind - states.resonator[:, None]
        return np.concatenate([away, away * x[:, None]], axis=1)

    form = _generic("a heat path", columns, [1.0] * 2 * len(LAGS))
    return replace(form, acts_on="temperature", sizes={"frequency_Hz": 1.0})


def offsets(count: int) -> Effect:
    """Return the form of runs that lie apart: a level of each."""

    def levels(states: States, shape: Sequence[float], response: str) -> Array:
        return np.tile(np.arange(count) == states.run, (states.time.size, 1)).astype(float)

    return _generic("offsets of the runs", levels, [1.0] * count)


def _step(states: States, shape: Sequence[float], response: str) -> Array:
    run, moment = shape
    return np.asarray(np.clip((states.time - moment) / states.step + 0.5, 0.0, 1.0)[:, None] * (states.run == int(run)))


STEP = replace(
    _generic("step", _step, [1.0]),
    shape=(Parameter("run", 0.0, 1e4, "run", False, True), Parameter("time_s", 0.0, 1e9, "moment", False, True)),
    grid=lambda span, response: [
        (float(k), float(t) + span.step / 2) for k, times in enumerate(span.bins) for t in times
    ],
)


def _bump(states: States, shape: Sequence[float], response: str) -> Array:
    """A bump at one temperature, what shifts it and what widens it: Hermite's functions of order 0, 1 and 2."""
    centre, width = shape
    z = (states.resonator - centre) / width
    return np.asarray(np.stack([np.ones_like(z), z, z * z - 1.0], axis=1) * np.exp(-0.5 * z * z)[:, None])


def _bumps(span: Span, response: str) -> list[tuple[float, ...]]:
    """Centres a width apart; wider ones are curves, which the other forms have."""
    low, high = span.temperature_low, span.temperature_high
    widths = [(high - low) * part for part in BUMPS]
    return [(float(centre), width) for width in widths for centre in np.arange(low, high, max(width, 1e-3))]


BUMPS = tuple(2.0 ** (-0.5 * k) for k in range(8, 14))
"""Widths of bumps in parts of the covered range: a sixteenth to a ninetieth."""
BUMP = replace(
    _generic("temperature: a narrow feature", _bump, [1.0, 0.5, 0.5]),
    shape=(Parameter("centre", 0.0, 1e4, "centre", False, True), Parameter("width", 0.0, 1e4, "width", True, True)),
    grid=_bumps,
)


def _no_form(states: States, shape: Sequence[float], response: str) -> Array:
    """Nothing that a state tells: its path is read from the rows."""
    return np.zeros((states.time.size, 1))


SWITCH = _generic("time: switching between two levels", _no_form, [1.0])
