"""Diagnosis of a steady-state table: soaked points (T, f), like the HRG paper's Table 1.

No time and, mostly, no second run: the question is how far such a table can decide at all. The material law with free f₀
and slope is imposed first, then the curvature is freed (the baseline), then the steady form of every effect that has one is
weighed by its marginal likelihood, in white noise (at least what rounding leaves) with a wander along the rows: a
table is measured in some order, and its rows know of each other.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.constants import zero_Celsius
from scipy.special import logsumexp
from scipy.stats import f as f_distribution

from compensation.decimation import average_groups
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.relative_law import Law
from studies.diagnosis.table_noise import Scale, make_scale
from studies.diagnosis.verdict import NINETY, Cause, Interval, ResponseResult, Verdict, doubted, weigh
from studies.effects import Effect, library
from studies.effects.states import FloatArray
from studies.shown import Shown

if TYPE_CHECKING:
    from pandas import DataFrame

FEWEST_POINTS = 5
MOST_ROWS = 120
"""Longer tables are averaged over neighbouring rows."""
WANDERING = 3.0
"""Residual over white noise from which a table is not called adequate."""
TURN = 0.1
"""Part of the covered range that a table must go back for its order to show a direction."""


@dataclass(frozen=True, repr=False)
class TableDiagnosis(Shown):
    """What a table decides, and what it leaves open.

    Attributes
    ----------
    temperature, law_residual, baseline_residual, extended_residual : (N,) arrays
        °C and Hz, in the order of the rows.
    law_rms, curvature_ratio : float
        rms that the law leaves with f₀ and slope free, Hz; measured over the law's curvature.
    candidates : sequence of (form, sum of squares, leave-one-out rms, evidence)
    sentences : sequence of str
        What was found, in words.
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
            "law_imposed_rms_Hz": self.law_rms,
            "curvature_over_law": self.curvature_ratio,
            "candidates": [
                {"form": form, "sum_of_squares_Hz2": ssq, "leave_one_out_Hz": loo, "evidence": score}
                for form, ssq, loo, score in self.candidates
            ],
            "sentences": list(self.sentences),
        }


@dataclass(frozen=True)
class _Candidate:
    effect: Effect
    shape: tuple[float, ...]
    columns: FloatArray
    log_evidence: float
    ssq: float
    loo: float
    residual: FloatArray

    @property
    def words(self) -> str:
        return self.effect.steady_words.format(*self.shape)


def diagnose_table(path: str, card: str | None = None) -> TableDiagnosis:
    """Diagnose a steady-state table, against a card's law or the default law of fused silica."""
    from studies.diagnosis.relative_law import relative_law
    from studies.instrument.card import load_card
    from studies.record import read_frequency_table, reading_resolution

    data = read_frequency_table(path)
    T, f = data.values["temperature_degC"], data.values["frequency_Hz"]
    instrument = load_card("hrg-30mm" if card is None else card)
    law = relative_law(instrument, T + zero_Celsius)
    named = f"{instrument.material.name}, law '{instrument.material.law}'" if card else "fused silica, the default law"
    return study_steady_table(T, f, reading_resolution(f), law, named)


def study_steady_table(
    T: FloatArray, f: FloatArray, resolution: float, law: Law, law_name: str = "the law"
) -> TableDiagnosis:
    """Diagnose temperatures (°C) and frequencies (Hz), in the order of the rows, read to `resolution` (Hz)."""
    T, f = _averaged(T, f)
    law_values = law(T + zero_Celsius)
    free = np.stack([np.ones_like(T), law_values], axis=1)
    middle = float(0.5 * (T.min() + T.max()))
    x = T - middle
    base = np.concatenate([free, (x**2)[:, None]], axis=1)
    law_left, left = _left(free, f), _left(base, f)
    law_rms, base_rms = (float(np.sqrt(np.mean(part**2))) for part in (law_left, left))
    ratio = _curvature(T, f) / _curvature(T, law_values)
    distinct = np.unique(T).size
    if distinct < FEWEST_POINTS:
        remark = f"{distinct} temperatures; a baseline of three numbers needs five or more to be tested"
        result = ResponseResult("not-identifiable", None, (base_rms, None), None, "none", remark=remark)
        verdict = Verdict("not-identifiable", (), {"frequency_Hz": result}, _MORE)
        return TableDiagnosis(verdict, T, law_left, left, left, law_rms, ratio, (), (remark + ".",))
    rounding = max(resolution / np.sqrt(12.0), 1e-9 * float(np.abs(f).max()))
    scale = make_scale(base, f, rounding)
    nothing = scale.log_evidence(np.empty((T.size, 0)))
    found = [c for effect in library().values() if effect.steady for c in _candidates(effect, x, base, f, scale)]
    best = {
        name: max((c for c in found if c.effect.name == name), key=lambda c: c.log_evidence)
        for name in dict.fromkeys(c.effect.name for c in found)
    }
    prior = CONSTANTS["log_prior_effect"]
    ranked = sorted(best.values(), key=lambda c: -c.log_evidence)
    forms = [
        (c.words, c.ssq, c.loo, 2.0 * (c.log_evidence - nothing))
        for c in sorted(_by_words(found), key=lambda c: -c.log_evidence)
    ]
    base_loo = _leave_one_out(base, f)
    sentences = _sentences(T, f, law_rms, ratio, base_rms, base_loo, rounding, law_name)
    if not ranked or ranked[0].log_evidence + prior < nothing:
        white = scale.white()
        wanders = base_rms > WANDERING * white
        state = "not-identifiable" if wanders else "adequate"
        if wanders:
            sentences.append(
                f"The rows drift: the residual is {base_rms:.3g} Hz rms where neighbouring rows agree to {white:.2g} Hz. A drift"
                " between the rows and a slow effect of temperature look alike in one table."
            )
        result = ResponseResult(state, base_rms, (base_rms, base_loo), None, "structure" if wanders else "none")
        verdict = Verdict(state, (), {"frequency_Hz": result}, _next(T) if wanders else None)
        return TableDiagnosis(verdict, T, law_left, left, left, law_rms, ratio, forms, sentences)
    winner = ranked[0]
    members, probability = weigh([c.effect.name for c in ranked], [c.log_evidence + prior for c in ranked], nothing)
    # in a steady state a scale error of the thermometer and a curvature of the frequency are the same data
    twins = [c.effect.name for c in ranked if _spans(base, c.columns, winner.columns)]
    names = list(dict.fromkeys([winner.effect.name, *members, *twins]))
    size = float(
        np.ptp(winner.columns @ np.linalg.lstsq(np.concatenate([base, winner.columns], 1), f, rcond=None)[0][3:])
    )
    spread = NINETY * float(np.sqrt(winner.ssq / max(T.size - 3 - winner.columns.shape[1], 1)))
    cause = Cause(
        winner.effect.name,
        "frequency_Hz",
        probability,
        tuple(sorted(names[1:])),
        {"peak_to_peak_Hz": Interval(size, max(size - spread, 0.0), size + spread)},
        2.0 * (winner.log_evidence - nothing),
        peak=size,
    )
    state = "not-identifiable" if len(names) > 1 else "explained"
    reached = float(np.sqrt(np.mean(winner.residual**2)))
    result = ResponseResult(state, max(reached, rounding), (base_rms, base_loo), (reached, winner.loo), "none")
    if len(names) > 1:
        sentences.append(f"The table cannot separate these: {', '.join(names)}.")
    verdict = Verdict(state, doubted((cause,)), {"frequency_Hz": result}, _next(T))
    return TableDiagnosis(verdict, T, law_left, left, winner.residual, law_rms, ratio, forms, sentences)


_MORE = "Measure at five temperatures or more, from below and from above."
_SOAK = "soak time shows an unsettled resonator, the thermometer separates a scale error from a curvature of f"


def _next(T: FloatArray) -> str:
    """Return what to measure next, which is not what the table has already."""
    if _turns(T):
        return f"Repeat the table with two soak times and a second thermometer: {_SOAK}."
    return (
        "Approach the same temperatures from above and from below, with two soak times and a second thermometer: direction "
        f"shows hysteresis and stress, {_SOAK}."
    )


def _candidates(effect: Effect, x: FloatArray, base: FloatArray, f: FloatArray, scale: Scale) -> list[_Candidate]:
    assert effect.steady is not None
    assert effect.steady_grid is not None
    shapes = list(effect.steady_grid(float(x.min()), float(x.max())))
    out = []
    for shape in shapes:
        columns = effect.steady(x, shape)
        both = np.concatenate([base, columns], axis=1)
        if columns.shape[1] + 4 > f.size or not np.all(np.linalg.norm(_left(base, columns), axis=0) > 1e-9):
            continue
        residual = _left(both, f)
        value = scale.log_evidence(columns) - float(np.log(len(shapes)))
        ssq = float(np.sum(residual**2))
        out.append(_Candidate(effect, tuple(shape), columns, value, ssq, _leave_one_out(both, f), residual))
    if out and len(out) > 1 and effect.shape:  # one form at many places: the mean over them
        total = float(logsumexp([c.log_evidence for c in out]))
        best = max(out, key=lambda c: c.log_evidence)
        out = [c if c is not best else _Candidate(**{**vars(c), "log_evidence": total}) for c in out]
    return out


def _by_words(found: Sequence[_Candidate]) -> list[_Candidate]:
    """The best shape of every form, by its words without the place."""
    best: dict[str, _Candidate] = {}
    for c in found:
        key = c.words if c.effect.name in best or "{0:.0f}" in c.effect.steady_words else c.effect.steady_words
        if key not in best or c.log_evidence > best[key].log_evidence:
            best[key] = c
    return list(best.values())


def _spans(base: FloatArray, one: FloatArray, two: FloatArray) -> bool:
    """Whether two forms are the same data beside the baseline."""
    a, b = _left(base, one), _left(base, two)
    return bool(np.linalg.norm(_left(a, b)) < 0.05 * np.linalg.norm(b)) if a.size else False


def _averaged(T: FloatArray, f: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rows in their order, neighbours averaged where there are many."""
    group = -(-T.size // MOST_ROWS)
    if group == 1:
        return T, f
    place = np.arange(T.size) // group
    return average_groups(T, place), average_groups(f, place)


def _sentences(
    T: FloatArray,
    f: FloatArray,
    law_rms: float,
    ratio: float,
    base_rms: float,
    base_loo: float,
    rounding: float,
    law_name: str,
) -> list[str]:
    slope = float(np.polyfit(T, f, 1)[0])
    out = [
        f"Misfit with the law's curvature fixed ({law_name}): {law_rms:.3f} Hz rms, "
        f"equivalent to a temperature error of {law_rms / max(abs(slope), 1e-12):.2f} °C.",
        f"The measured curvature is {ratio:.1f} times the law's. With a free curvature the misfit is {base_rms:.3f} Hz rms "
        f"({base_loo:.3f} Hz leave-one-out); rounding alone would leave {rounding:.4f} Hz.",
    ]
    order = np.argsort(T, kind="stable")
    t, g = _merged(T[order], f[order])
    if t.size >= 5:
        local = np.diff(g) / np.diff(t) / (0.5 * (g[1:] + g[:-1])) * 1e6
        lowest = int(np.argmin(local))
        if t.size <= 30 and 0 < lowest < local.size - 1:
            middle = 0.5 * (t[lowest] + t[lowest + 1])
            out.append(
                f"The local slope falls to {local[lowest]:.1f} ppm/°C near {middle:.0f} °C and rises again to {local[-1]:.1f} ppm/°C."
            )
    if 7 <= T.size and t.size >= 7:
        cubic, quartic = (float(np.sum((f - np.polyval(np.polyfit(T, f, p), T)) ** 2)) for p in (3, 4))
        freedom = T.size - 5
        ratio_f = (cubic - quartic) / max(quartic / freedom, rounding**2)
        chance = float(f_distribution.sf(max(ratio_f, 0.0), 1, freedom))
        said = "a cubic is not sufficient" if chance < 0.05 else "a cubic is sufficient"
        if cubic < T.size * rounding**2:
            out.append("A cubic fits within the rounding of the readings; a cubic is sufficient.")
        else:
            out.append(
                f"Cubic against quartic: {cubic:.3g} and {quartic:.3g} Hz², F(1, {freedom}) = {max(ratio_f, 0.0):.3g}, "
                f"chance {chance:.2g}; {said}."
            )
    both = _turns(T)
    out.append(
        f"{T.size} rows, "
        + (
            "approached from both sides: hysteresis is tested; ageing and a linear scale error stay hidden."
            if both
            else "approached from one side: they cannot tell hysteresis from a curve, nor show ageing or a linear scale error, and an"
            " unsettled soak stays in the slope."
        )
    )
    return out


def _merged(T: FloatArray, f: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Average readings at one temperature."""
    distinct, place = np.unique(T, return_inverse=True)
    return distinct, average_groups(f, place)


def _turns(T: FloatArray) -> bool:
    """Whether the rows go up and down again by more than a tenth of their range."""
    wide = TURN * float(np.ptp(T))
    back_down = float((np.maximum.accumulate(T) - T).max())
    back_up = float((T - np.minimum.accumulate(T)).max())
    return min(back_down, back_up) > wide


def _left(columns: FloatArray, f: FloatArray) -> FloatArray:
    size = np.linalg.norm(columns, axis=0)
    unit = columns / np.where(size > 0, size, 1.0)
    return np.asarray(f - unit @ np.linalg.lstsq(unit, f, rcond=None)[0])


def _leave_one_out(columns: FloatArray, f: FloatArray) -> float:
    unit = columns / np.linalg.norm(columns, axis=0)
    hat = unit @ np.linalg.pinv(unit, rcond=1e-14)
    lever = np.clip(np.diag(hat), 0.0, 1.0 - 1e-9)
    return float(np.sqrt(np.mean((_left(columns, f) / (1.0 - lever)) ** 2)))


def _curvature(T: FloatArray, f: FloatArray) -> float:
    return float(2.0 * np.polynomial.Polynomial.fit(T, np.log(f), 2).convert().coef[2])
