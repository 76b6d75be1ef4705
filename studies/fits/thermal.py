"""Thermal time constants of a resonator from records of its frequency and the temperature of its housing.

The joint inference beside a polynomial card, f = f₀ (1 + a₁ x + a₂ x²), x = T_r − T_ref, with only the heat path's effects in question: a
second path, T_r = (1 − w) lag(T_h; τ₁) + w lag(T_h; τ₂), and radiation. Two lags in series are w = −τ₂/(τ₁ − τ₂).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from studies.calibration.estimates import TOLD, find_groups
from studies.calibration.priors import from_standard
from studies.effects import find_effect
from studies.errors import InputError
from studies.inference.causes import parameters_of
from studies.inference.diagnosis import Inference, infer
from studies.inference.polynomial_card import polynomial_card
from studies.inference.records import make_ready
from studies.record import Record

if TYPE_CHECKING:
    from studies.instrument.card import Instrument

SECOND, RADIATION = "second-lag", "radiation"
LAW = {"law.lag_s": "time_constant_1", "law.f0_Hz": "offset", "law.a1_per_K": "slope", "law.a2_per_K2": "curvature"}
OF_TERMS = {"second_time_constant_s": "time_constant_2", "weight": "weight_2", "radiated_share": "radiated_share"}
VAGUE = 0.5
"""Half width of the interval of a share, from which on the records do not determine it."""


@dataclass(frozen=True)
class ThermalEstimate:
    """A constant with its interval; `value` is None where the records do not determine it."""

    value: float | None
    low: float
    high: float


@dataclass(frozen=True)
class ThermalFit:
    """What records say of the heat path.

    Attributes
    ----------
    estimates : by name: time_constant_1 (s), radiated_share, offset, slope, curvature (Hz, per K and K²); with a second path
        time_constant_2 (s) and weight_2
    undetermined : names of constants that the records cannot separate
    departures : K, of the resonator from its housing at the start of each run
    """

    inference: Inference
    confidence: float
    estimates: dict[str, ThermalEstimate]
    undetermined: tuple[tuple[str, ...], ...]
    departures: tuple[float, ...]

    @property
    def residual_rms(self) -> float:
        """Rms of what is left of the rows, Hz, about the mean of each run: slow noise carries the level off."""
        return self.inference.rows["frequency_Hz"].within


def fit_thermal_constants(
    records: Sequence[Record],
    instrument: "Instrument | None" = None,
    lags: int = 2,
    confidence: float = 0.9,
    progress: Callable[[str], None] = lambda _: None,
) -> ThermalFit:
    """Find the lags of the resonator behind its housing, each run with an initial state of its own.

    Args:
        records: Runs with `frequency_Hz` and the temperature of the housing, else of the chamber.
        instrument: Gives the curvature of the frequency over temperature; without it the curvature is fitted.
        lags: 1 for one heat path; with 2 a second is taken where the records show it.
        confidence: Of the intervals.
        progress: Told in words what comes next.
    """
    if lags not in (1, 2):
        raise InputError(f"--lags {lags}: the number of lags is 1 or 2.")
    for record in records:
        if "frequency_Hz" not in record:
            raise InputError(
                f"{record.path}: thermal constants need frequency_Hz and housing_temperature_degC (or"
                f" chamber_temperature_degC); it has {', '.join(record.columns)}."
            )
    others = ("bias_deg_per_h", "measured_rate_deg_per_s", "inverse_q")
    campaign = make_ready(
        [replace(one, columns={key: own for key, own in one.columns.items() if key not in others}) for one in records]
    )
    if not campaign.records:
        why = "; ".join(campaign.skipped.values()) or "too few rows"
        raise InputError(f"{records[0].path or 'record'}: nothing can be identified: {why}.")
    card = polynomial_card(campaign.records)
    law = card.content["law"] | {"delay_s": {"value": 0.0, "sd": 0.0}}
    if instrument is not None:
        law |= curvature_of(instrument, card.reference_temperature)
    among = (SECOND, RADIATION) if lags == 2 else (RADIATION,)
    found = infer(card.with_table("law", law), campaign, progress, among)
    times = float(scipy.stats.norm.ppf(0.5 + 0.5 * confidence))
    estimates = dict(_of_terms(found, times)) | dict(_of_law(found, times))
    problem, point = found.search.linear.problem, found.numbers.point
    priors, starts = problem.priors, point[len(problem.priors.values) :]
    return ThermalFit(
        found,
        confidence,
        dict(sorted(estimates.items(), key=lambda one: not one[0].startswith("time_constant"))),
        tuple(
            tuple(LAW[name] for name in group if name in LAW)
            for group in find_groups(priors, found.background.posterior[1])
            if any(estimates[LAW[name]].value is None for name in group if name in LAW)
        ),
        tuple(
            sd * float(z)
            for (_, name, sd), z in zip(problem.starts, starts, strict=True)
            if name == "initial.resonator"
        ),
    )


def curvature_of(instrument: "Instrument", reference: float) -> dict[str, dict[str, float]]:
    """Return the bends a₂ and a₃ of a card's own law about a temperature (K), exact."""
    from studies.resonator.law import law_of

    law = law_of(instrument, reference - 60.0, reference + 60.0)
    T = np.linspace(max(law.lowest, reference - 60.0), min(law.highest, reference + 60.0), 61)
    f = np.polynomial.Polynomial.fit(T - reference, law.frequency(T), 3).convert().coef
    return {f"a{k}_per_K{k}": {"value": float(f[k] / f[0]), "sd": 0.0} for k in (2, 3)}


def _of_law(found: Inference, times: float) -> Iterator[tuple[str, ThermalEstimate]]:
    """Constants of the law and its lag; one that the records narrow by less than half is not determined."""
    priors, (mean, C) = found.search.linear.problem.priors, found.background.posterior
    count = len(priors.values)
    z, sd = priors.standard(mean[:count]), np.sqrt(np.diag(priors.covariance(C)))
    at = {value.name: k for k, value in enumerate(priors.values)}
    level = from_standard(priors.values[at["law.f0_Hz"]], float(z[at["law.f0_Hz"]]))
    for key, name in LAW.items():
        if key in at:
            value, own, width = priors.values[at[key]], float(z[at[key]]), float(sd[at[key]])
            scale = level if name in ("slope", "curvature") else 1.0
            best, low, high = (scale * from_standard(value, own + n * width) for n in (0.0, -times, times))
            yield name, ThermalEstimate(None if width > TOLD else best, low, high)


def _of_terms(found: Inference, times: float) -> Iterator[tuple[str, ThermalEstimate]]:
    """Constants of the effects that were found; the share that is radiated also where it is nothing beyond its error."""
    background, signatures = found.background, found.search.signatures
    names = [term.effect.name for term in background.terms]
    if RADIATION not in names:
        share_of_form, exchange = 0.0, 1.0
        term = found.search.term(find_effect(RADIATION), "frequency_Hz", (share_of_form, exchange))
        background = replace(background, terms=(*background.terms, replace(term, scale=1.0)))
    for k in range(len(background.terms)):
        for key, own in parameters_of(background, signatures, k).items():
            if key in OF_TERMS:
                half = times * own.sd
                low, high = (own.value - half, own.value + half)
                known = high - low < 2.0 * VAGUE or key == "second_time_constant_s"
                yield OF_TERMS[key], ThermalEstimate(own.value if known else None, low, high)
