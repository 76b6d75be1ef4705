"""Diagnosis of a steady-state table: soaked points (T, f), like the HRG paper's Table 1.

With a card the table is a record of settled states: the card's prediction, its values within their priors as `hrg calibrate`
finds them, level and slope among them. Without one the law of fused silica with free level, slope and curvature is the baseline. On either
the steady form of every effect that has one is weighed by its marginal likelihood, in white noise (at least what rounding leaves,
at most what the readings leave of their own parabola) with a wander along the rows: a table is measured in some order,
and its rows know of each other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from compensation.decimation import average_groups
from shell.constants import zero_Celsius
from studies.calibration.observed import SETTLED, SettledTable, read_settled
from studies.calibration.scatter import Scatter, find_scatter
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.table_forms import Candidate, best_by_words, rms, span_alike, weigh_forms
from studies.diagnosis.table_noise import TableBaseline, make_scale
from studies.diagnosis.table_words import MORE, bends_beyond_a_cubic, next_table, table_sentences
from studies.diagnosis.verdict import (
    NINETY,
    Cause,
    Interval,
    ResponseResult,
    Shift,
    Verdict,
    doubted,
    weigh,
    wrong_values,
)
from studies.effects import library
from studies.effects.states import FloatArray
from studies.errors import InputError
from studies.instrument.display import display_name
from studies.results.shown import Shown

if TYPE_CHECKING:
    from collections.abc import Callable

    from pandas import DataFrame

    from studies.calibration.calibrate import Calibration
    from studies.instrument.card import Instrument

FEWEST_POINTS = 5
MOST_ROWS = 120
"""Longer tables are averaged over neighbouring rows."""
WANDERING = 3.0
"""Residual over white noise from which a table is not called adequate."""
TOUCHED = 0.05
"""Prior standard deviations, and part of the prior width, by which data must move a value to be said to know of it."""
TIE = 0.1
"""Evidence within which two forms explain a table equally."""
UNNAMED = 2.0
"""Evidence from which on it is said how far a form falls short of being named."""
DEFAULT_LAW = "hrg-30mm"
"""Card whose law, the default of fused silica, stands where none is given."""


@dataclass(frozen=True, repr=False)
class TableDiagnosis(Shown):
    """What a table decides, and what it leaves open.

    Attributes
    ----------
    temperature, law_residual, baseline_residual, extended_residual : (N,) arrays
        °C and Hz, in the order of the rows.
    law_rms, curvature_ratio : float
        rms that the law leaves with f₀ and slope free, or the card as given, Hz; measured over the law's curvature.
    candidates : sequence of (form, sum of squares, leave-one-out rms, evidence)
    sentences : sequence of str
        What was found, in words.
    from_card : bool
        Whether level and slope are values of a card.
    """

    drawn_by = "studies.reports.diagnosis_table:table_residuals"

    verdict: Verdict
    temperature: FloatArray
    law_residual: FloatArray
    baseline_residual: FloatArray
    extended_residual: FloatArray
    law_rms: float
    curvature_ratio: float
    candidates: Sequence[tuple[str, float, float, float]]
    sentences: Sequence[str]
    from_card: bool = False

    def __repr__(self) -> str:
        return f"TableDiagnosis({self.verdict})"

    def to_frame(self) -> "DataFrame":
        """Return one row a form that was weighed: sum of squares (Hz²), leave-one-out rms (Hz), evidence."""
        import pandas as pd

        columns = ["form", "sum_of_squares_Hz2", "leave_one_out_Hz", "evidence"]
        return pd.DataFrame([*self.candidates], columns=columns).set_index("form")

    def as_dict(self) -> dict[str, object]:
        """Return the object of `hrg diagnose --json`."""
        return {
            **self.verdict.as_dict(),
            "shipped_rms_Hz" if self.from_card else "law_imposed_rms_Hz": self.law_rms,
            "curvature_over_law": self.curvature_ratio,
            "candidates": [
                {"form": form, "sum_of_squares_Hz2": ssq, "leave_one_out_Hz": loo, "evidence": score}
                for form, ssq, loo, score in self.candidates
            ],
            "sentences": list(self.sentences),
        }


def diagnose_table(path: str, card: "Instrument | str | None" = None) -> TableDiagnosis:
    """Diagnose a steady-state table, against a card's own simulation or the default law of fused silica.

    Raises
    ------
    InputError
        With a card: a table whose level or slope is further than six standard deviations from it. Without one: fewer than
        five temperatures.
    """
    from studies.instrument.card import load_card
    from studies.resonator.law import law_of

    table = read_settled(path)
    if card is None and (distinct := np.unique(table.temperature).size) < FEWEST_POINTS:
        raise InputError(f"{path}: {distinct} temperatures are too few for a diagnosis; {MORE}")
    instrument = load_card(card or DEFAULT_LAW) if card is None or isinstance(card, str) else card
    instrument.material.check(table.temperature)
    if card is None:
        law = law_of(instrument)
        T = table.temperature - zero_Celsius
        own = lambda T: law.frequency(T, extrapolate=True)  # noqa: E731
        return study_steady_table(T, table.frequency, table.resolution, own, "fused silica, the default law")
    from studies.calibration.calibrate import calibrate

    return study_calibrated_table(calibrate(instrument, [], [table], profile=False))


def study_steady_table(
    T: FloatArray,
    f: FloatArray,
    resolution: float,
    law: "Callable[[FloatArray], FloatArray]",
    law_name: str = "the law",
) -> TableDiagnosis:
    """Diagnose temperatures (°C) and frequencies (Hz), in the order of the rows, read to `resolution` (Hz), beside a law of free size."""
    T, f = _averaged(T, f)
    law_values = law(T + zero_Celsius)
    x = T - float(0.5 * (T.min() + T.max()))
    base = TableBaseline(f, np.stack([np.ones_like(T), law_values, x**2], axis=1), np.empty((T.size, 0)))
    rounding = max(resolution / np.sqrt(12.0), 1e-9 * float(np.abs(f).max()))
    law_left = replace(base, free=base.free[:, :2]).solve(np.empty((T.size, 0)), rounding)[0]
    left, lone, _, _ = base.solve(np.empty((T.size, 0)), rounding)
    law_rms, ratio = rms(law_left), _curvature(T, f) / _curvature(T, law_values)
    slope = float(np.polyfit(T, f, 1)[0])
    said = [
        f"Residual with the curvature of the law ({law_name}): {law_rms:.3f} Hz rms, "
        f"equivalent to a temperature error of {law_rms / max(abs(slope), 1e-12):.2f} K.",
        f"The measured curvature is {ratio:.1f} times the law's. With a free curvature the residual is {rms(left):.3f} Hz rms "
        f"({rms(lone):.3f} Hz leave-one-out); rounding alone would give {rounding:.4f} Hz.",
    ]
    scatter = float(np.linalg.norm(left)) / np.sqrt(max(T.size - 3, 1))
    loose = find_scatter(SettledTable("the table", T + zero_Celsius, f, resolution), law_values)
    fits = _Fits(T, f, rounding, scatter, law_left, left, lone, law_rms, ratio, loose)
    return _study(base, fits, said, (), None)


def study_calibrated_table(found: "Calibration") -> TableDiagnosis:
    """Diagnose the one table that a card was calibrated with: what is left beside its values, and which of them are wrong."""
    problem, state = found.fit.problem, found.fit.state
    (table,), (compared,) = problem.tables, found.settled
    shipped = problem.evaluate(np.zeros(problem.count), slopes=False).residual[SETTLED]
    slopes = state.slope[SETTLED]
    columns = [shipped, state.residual[SETTLED], *slopes.T]
    T, f, shipped, left, *known = _averaged(table.temperature - zero_Celsius, table.frequency, *columns)
    J = np.stack(known, axis=1)
    base = TableBaseline(left + J @ found.fit.point, np.empty((T.size, 0)), J)
    rounding = max(table.rounding, 1e-9 * float(np.abs(f).max()))
    noise = found.fit.noise[SETTLED].white
    lone = base.solve(np.empty((T.size, 0)), noise)[1]
    law = problem.law.frequency(T + zero_Celsius, extrapolate=True)
    ratio = _curvature(T, f) / _curvature(T, law)
    moved = [one for one in found.estimates if abs(one.shift_sd) > TOUCHED or one.width < 1.0 - TOUCHED]
    moved.sort(key=lambda one: -abs(one.shift_sd))
    shifts = tuple(Shift(m.parameter, m.card, m.value, m.low, m.high, m.shift_sd) for m in moved)
    said = list(compared.sentences)
    if far := [one for one in shifts[:2] if abs(one.shift_sd) > TOUCHED]:
        most = ", ".join(f"{display_name(one.parameter)} ({one.shift_sd:+.2f} standard deviations)" for one in far)
        said.append(f"Largest changes in the calibration: {most}.")
    said.append(
        f"Residual with the card as given, rms over the rows: {rms(shipped):.3f} Hz; calibrated: {rms(left):.3f} Hz; rounding alone would give {rounding:.4f} Hz."
    )
    fits = _Fits(
        T, f, rounding, max(table.scatter, rounding), shipped, left, lone, rms(shipped), ratio, compared.scatter
    )
    return _study(base, fits, said, shifts, found)


@dataclass(frozen=True)
class _Fits:
    """Readings, and what is left of them without any effect."""

    temperature: FloatArray
    frequency: FloatArray
    rounding: float
    scatter: float
    law_left: FloatArray
    left: FloatArray
    lone: FloatArray
    law_rms: float
    ratio: float
    loose: Scatter | None


def _study(
    base: TableBaseline, fits: _Fits, sentences: list[str], shifts: tuple[Shift, ...], found: "Calibration | None"
) -> TableDiagnosis:
    """Weigh the steady form of every effect beside a baseline."""
    T, f, left, rounding = fits.temperature, fits.frequency, fits.left, fits.rounding
    details = {} if found is None else {"settled": found.settled[0].as_dict()}
    shipped = None if found is None else fits.law_rms

    def answer(
        state: str,
        causes: tuple[Cause, ...],
        result: ResponseResult,
        following: str | None,
        extended: FloatArray = left,
        forms: Any = (),
    ) -> TableDiagnosis:
        verdict = Verdict(
            state,
            causes,
            {"frequency_Hz": replace(result, shipped=shipped)},
            following,
            calibration=shifts,
            details=details,
        )
        return TableDiagnosis(
            verdict, T, fits.law_left, left, extended, fits.law_rms, fits.ratio, forms, sentences, found is not None
        )

    base_rms, lone = rms(left), rms(fits.lone)
    loose = fits.loose
    sentences += [] if loose else table_sentences(T, f, rounding)
    scale = make_scale(base, rounding, fits.scatter, float(np.ptp(f)))
    nothing = scale.log_evidence(np.empty((T.size, 0)))
    x = T - float(0.5 * (T.min() + T.max()))
    every = [
        c
        for effect in library().values()
        if effect.steady
        for c in weigh_forms(effect, x, base, scale, rounding, fits.scatter)
    ]
    best = {
        name: max((c for c in every if c.effect.name == name), key=lambda c: c.log_evidence)
        for name in dict.fromkeys(c.effect.name for c in every)
    }
    prior = CONSTANTS["log_prior_effect"]
    needed = -2.0 * prior
    ranked = sorted(best.values(), key=lambda c: -c.log_evidence)
    forms = [(c.words, c.ssq, c.loo, 2.0 * (c.log_evidence - nothing)) for c in best_by_words(every)]
    short = 2.0 * (ranked[0].log_evidence - nothing) if ranked else 0.0
    nearest = " and ".join(c.words for c in ranked if 2.0 * (c.log_evidence - nothing) > short - TIE)
    # one row cannot tell a mistake from an effect; of others a cause must leave what rows may scatter
    if loose and (short < needed or loose.row is not None or rms(ranked[0].residual) > loose.limit):
        sentences.insert(0, loose.sentence)
        result = ResponseResult("unexplained", base_rms, (base_rms, lone), None, "structure")
        return answer("unexplained", (), result, next_table(T, loose), forms=forms)
    # noise that has a shape beyond rounding is not called noise
    shaped = short > UNNAMED and base_rms > WANDERING * rounding and bends_beyond_a_cubic(T, f, rounding)
    white = scale.white()
    wanders = base_rms > WANDERING * white
    if short < needed and (wanders or not shaped):
        values = doubted(wrong_values(shifts))
        state = "unexplained" if wanders else "explained" if values else "adequate"
        if wanders:
            sentences.append(
                f"The rows drift: the residual is {base_rms:.3g} Hz rms, but neighbouring rows agree to {white:.2g} Hz. One table"
                " cannot distinguish a drift between the rows from a slow effect of temperature."
            )
        elif short > UNNAMED:
            sentences.append(
                f"The remaining residual of {base_rms:.3g} Hz rms is treated as noise: the evidence of {nearest} is {short:.1f}; a cause"
                f" needs {needed:.0f}."
            )
        result = ResponseResult(state, base_rms, (base_rms, lone), None, "structure" if wanders else "none")
        return answer(state, values, result, next_table(T) if wanders else None, forms=forms)
    if short < needed:
        sentences.append(
            f"The remaining residual of {base_rms:.3g} Hz rms is {base_rms / rounding:.0f} times what rounding leaves, so something is missing."
            f" What comes nearest, {nearest}, has an evidence of {short:.1f}: less than the {needed:.0f} that proves a cause, so the set of causes"
            " is given with its probability and none of them is proven."
        )
    winner = ranked[0]
    members, probability = weigh([c.effect.name for c in ranked], [c.log_evidence + prior for c in ranked], nothing)
    # in a steady state a scale error of the thermometer and a curvature of the frequency are the same data
    twins = [c.effect.name for c in ranked if span_alike(x, base, c.columns, winner.columns)]
    names = list(dict.fromkeys([winner.effect.name, *members, *twins]))
    noise = max(rms(winner.residual), rounding)
    size = float(np.ptp(base.made_by(winner.columns, noise)))
    spread = NINETY * float(np.sqrt(winner.ssq / max(T.size - 3 - winner.columns.shape[1], 1)))
    named = Cause(
        winner.effect.name,
        "frequency_Hz",
        probability,
        tuple(sorted(names[1:])),
        {"peak_to_peak_Hz": Interval(size, max(size - spread, 0.0), size + spread)},
        2.0 * (winner.log_evidence - nothing),
        peak=size,
    )
    if found is not None:
        shifts = _beside(found, base, winner, noise, shifts)
    causes = sorted((named, *wrong_values(shifts)), key=lambda one: -one.evidence)
    state = "not-identifiable" if len(names) > 1 else "explained"
    result = ResponseResult(state, noise, (base_rms, lone), (rms(winner.residual), winner.loo), "none")
    return answer(state, doubted(causes), result, next_table(T), winner.residual, forms)


def _beside(
    found: "Calibration", base: TableBaseline, winner: Candidate, noise: float, shifts: Sequence[Shift]
) -> tuple[Shift, ...]:
    """Return where the card's values are beside an effect."""
    from studies.calibration.priors import from_standard

    priors = found.fit.problem.priors
    _, _, u, C = base.solve(winner.columns, noise)
    z, sd = priors.standard(u), np.sqrt(np.diag(priors.covariance(C)))
    out = []
    for one in shifts:
        k = priors.names.index(one.parameter)
        value, low, high = (from_standard(priors.values[k], float(z[k] + n * sd[k])) for n in (0.0, -NINETY, NINETY))
        out.append(Shift(one.parameter, one.card, value, low, high, float(z[k])))
    return tuple(sorted(out, key=lambda one: -abs(one.shift_sd)))


def _averaged(*columns: FloatArray) -> list[FloatArray]:
    """Return columns over the rows in their order, neighbours averaged where there are many."""
    group = -(-columns[0].size // MOST_ROWS)
    place = np.arange(columns[0].size) // group
    return [one if group == 1 else average_groups(one, place) for one in columns]


def _curvature(T: FloatArray, f: FloatArray) -> float:
    return float(2.0 * np.polynomial.Polynomial.fit(T, np.log(f), 2).convert().coef[2])
