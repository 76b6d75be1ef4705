"""Diagnosis of a steady-state table: soaked points (T, f), like the HRG paper's Table 1.

The baseline is the calibrated card, else a wide parabola. Beside it the steady form of every effect that has one is
weighed by its marginal likelihood, in white noise with a wander along the rows, which are measured in some order.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from compensation.arrays import Array
from shell.constants import zero_Celsius
from studies.calibration.calibrate import calibrate
from studies.calibration.observed import NEIGHBOURS, SETTLED, SettledTable, read_settled
from studies.calibration.scatter import find_scatter
from studies.diagnosis import table_words as words
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.table_forms import cause_of, each_once, rms, weigh_forms
from studies.diagnosis.verdict import ResponseResult, Shift, Verdict, doubted, wrong_values
from studies.errors import InputError
from studies.inference.background import Background
from studies.inference.linear import Linear
from studies.inference.polynomial_card import settled_card
from studies.inference.verdict import shifts_of
from studies.instrument.card import load_card
from studies.record import Run
from studies.resonator.law import law_of
from studies.results.shown import Shown

if TYPE_CHECKING:
    from pandas import DataFrame

    from studies.instrument.card import Instrument

FEWEST_POINTS, FEWEST_BESIDE_CARD = 5, 3
MOST_ROWS = 120
"""Longer tables are averaged over neighbouring rows."""
WANDERING = 3.0
"""Residual over white noise from which a table is not called adequate."""
UNNAMED = 2.0
"""Evidence from which on it is said how far a form falls short of being named."""
DEFAULT_LAW = "hrg-30mm"
"""Card whose law, the default of fused silica, is told beside a table where no card is given."""
COLUMNS = ("form", "sum_of_squares_Hz2", "leave_one_out_Hz", "evidence")


@dataclass(frozen=True, repr=False)
class TableDiagnosis(Shown):
    """What a table decides, and what it leaves open."""

    drawn_by = "studies.reports.diagnosis_table:table_residuals"

    verdict: Verdict
    temperature: Array  # °C, in the order of the rows
    # What is left of the readings, Hz: by the law with f₀ and slope free, or the card as given; by the baseline; beside the cause.
    law_residual: Array
    baseline_residual: Array
    extended_residual: Array
    curvature_ratio: float  # measured over the law's
    candidates: Sequence[tuple[str, float, float, float]]  # of COLUMNS
    sentences: Sequence[str]  # what was found, in words
    from_card: bool  # whether level and slope are values of a card

    def __repr__(self) -> str:
        return f"TableDiagnosis({self.verdict})"

    @property
    def law_rms(self) -> float:
        """Rms that the law leaves with f₀ and slope free, or the card as given, Hz."""
        return rms(self.law_residual)

    def to_frame(self) -> "DataFrame":
        """Return one row a form that was weighed: sum of squares (Hz²), leave-one-out rms (Hz), evidence."""
        import pandas as pd

        return pd.DataFrame([*self.candidates], columns=[*COLUMNS]).set_index("form")

    def as_dict(self) -> dict[str, object]:
        """Return the object of `hrg diagnose --json`."""
        return {
            **self.verdict.as_dict(),
            "shipped_rms_Hz" if self.from_card else "law_imposed_rms_Hz": self.law_rms,
            "curvature_over_law": self.curvature_ratio,
            "candidates": [dict(zip(COLUMNS, one, strict=True)) for one in self.candidates],
            "sentences": list(self.sentences),
        }


def diagnose_table(data: Run, card: "Instrument | str | None" = None) -> TableDiagnosis:
    """Diagnose a steady-state table, of five temperatures or three beside a card, against a card's own simulation or a parabola."""
    table = read_settled(data)
    if (distinct := np.unique(table.temperature).size) < (FEWEST_POINTS if card is None else FEWEST_BESIDE_CARD):
        given = "one temperature is" if distinct == 1 else f"{distinct} temperatures are"
        raise InputError(f"{table.path}: {given} too few for a diagnosis; {words.MORE}")
    return judge_table(table, load_card(card) if isinstance(card, str) else card)


def judge_table(whole: SettledTable, card: "Instrument | None" = None) -> TableDiagnosis:
    """Judge settled readings beside a card, or beside a parabola."""
    shipped = card or load_card(DEFAULT_LAW)
    shipped.material.check(whole.temperature)
    table = whole.averaged(MOST_ROWS)
    found = calibrate(card or settled_card(table), [], [table], profile=False)
    own, compared = found.fit.problem.law, found.settled[0]
    model = Background(Linear.of(found.fit), (), found.fit.noise)
    f, left = table.frequency, found.fit.state.residual[SETTLED]
    law = (own if card else law_of(shipped)).frequency(table.temperature, extrapolate=True)
    law_left = f - (law if card else np.polyval(np.polyfit(law, f, 1), law))
    ratio = _curvature(table, f) / _curvature(table, law)
    base, law_rms = (rms(left), rms(model.left_out(SETTLED))), rms(law_left)
    shifts = _moved(model) if card else ()
    if card:
        said = words.card_sentences(compared, shifts, table, law_rms, base)
    else:
        said = words.law_sentences(table, law_rms, ratio, base)
    forms, white = weigh_forms(model.linear, table)
    best, lead = (forms[0], forms[0].evidence) if forms else (None, 0.0)
    needed = -2.0 * CONSTANTS["log_prior_effect"]
    # rows that follow no law: averages of neighbours may hide it, and then no effect explains it
    loose = find_scatter(whole, own.frequency(whole.temperature, extrapolate=True))
    said += [] if loose else words.table_sentences(table)
    near = table.between_neighbours(left)
    # noise that has a shape beyond rounding is not called noise
    shaped = lead > UNNAMED and base[0] > WANDERING * table.rounding and words.bends_beyond_a_cubic(table)
    state, causes, rest, extended = "unexplained", doubted(wrong_values(shifts)), left, None
    following: str | None = words.next_table(table, loose)
    # one row cannot tell a mistake from an effect; of others a cause must leave what rows may scatter
    explained = best and lead >= needed and compared.scatter and rms(best.residual) <= compared.scatter.limit
    if loose and (loose.row is not None or not explained):
        said.insert(0, loose.sentence)
        causes = ()
    elif lead < needed and base[0] > WANDERING * white:
        said.append(words.drift_sentence(base[0], white))
    elif (best is None or (lead < needed and not shaped)) and base[0] > NEIGHBOURS * near:
        said.append(words.step_sentence(base[0], near))
    elif best is None or (lead < needed and not shaped):
        state, following = "explained" if any(one.is_wrong_value for one in causes) else "adequate", None
        said += [words.short_sentence(forms, base[0], needed)] if lead > UNNAMED else []
    else:
        said += [words.unproven_sentence(forms, base[0], table, needed)] if lead < needed else []
        near = min(near, table.between_neighbours(best.residual))
        if rms(best.residual) > NEIGHBOURS * near:
            said.append(words.step_sentence(rms(best.residual), near, best.words))
        else:
            named, rest, shifts = cause_of(forms), best.residual, _moved(best.model) if card else ()
            causes = doubted(sorted((named, *wrong_values(shifts)), key=lambda one: -one.evidence))
            state = "not-identifiable" if named.equivalent else "explained"
            extended = rms(rest), best.left_out
    noise = max(rms(rest), table.rounding) if extended else base[0]
    left_over = "structure" if state == "unexplained" else "none"
    result = ResponseResult(state, noise, base, extended, left_over, shipped=law_rms if card else None)
    details = {"settled": compared.as_dict()} if card else {}
    verdict = Verdict(state, causes, {"frequency_Hz": result}, following, calibration=shifts, details=details)
    shown = [(one.words, float(one.residual @ one.residual), one.left_out, one.evidence) for one in each_once(forms)]
    T = table.temperature - zero_Celsius
    return TableDiagnosis(verdict, T, law_left, left, rest, ratio, shown, said, card is not None)


def _moved(model: Background) -> tuple[Shift, ...]:
    """Return the values of the card that a table has moved, the furthest first."""
    return tuple(sorted(shifts_of(model), key=lambda one: -abs(one.shift_sd)))


def _curvature(table: SettledTable, f: Array) -> float:
    return float(2.0 * np.polynomial.Polynomial.fit(table.temperature, np.log(f), 2).convert().coef[2])
