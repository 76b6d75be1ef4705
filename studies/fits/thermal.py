"""Thermal time constants of a resonator from records of its frequency and the temperature of its housing.

The calibration of a polynomial card: f = f₀ (1 + a₁ x + a₂ x² + a₃ x³), x = T_r − T_ref, the resonator behind its housing through lags in series
with radiation along or past them (`studies.inference.heat_path`), each run with a start of its own, in noise that may drift.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from compensation.arrays import Array
from studies.calibration.estimates import TOLD, find_groups
from studies.calibration.fit import fit
from studies.calibration.priors import from_standard
from studies.errors import InputError
from studies.inference.diagnosis import build_problem
from studies.inference.heat_path import (
    DELAY,
    LAGS,
    OF_LUMPS,
    SENSOR,
    WORTH,
    HeatPath,
    by_thermometer,
    cubic_of,
    find_heat_path,
    left_rms,
    slow_share,
    wanders,
)
from studies.inference.polynomial_card import polynomial_card
from studies.inference.records import driving, make_ready
from studies.inference.signatures import SHARE
from studies.instrument.card import Instrument
from studies.record import Record
from studies.resonator.law import law_of

NAMES = {f"law.{key}": f"time_constant_{k}" for k, key in enumerate(LAGS, 1)} | {
    SHARE: "radiated_share", **{f"law.{key}": key for key in OF_LUMPS}, SENSOR: "sensor_time_constant", DELAY: "delay", "law.f0_Hz": "offset", "law.a1_per_K": "slope", "law.a2_per_K2": "curvature", "law.a3_per_K3": "third_order"
}  # fmt: skip

SHARES = ("radiated_share", "base_radiated_share")

RESTS = 1.0
"""Kelvin that a housing must cover before the records say anything of the slope: else it is what resonators usually have."""


@dataclass(frozen=True)
class ThermalEstimate:
    """A constant with its interval; `value` is None where the records do not determine it."""

    value: float | None
    low: float
    high: float


@dataclass(frozen=True)
class ThermalFit:
    """What records say of the heat path: `estimates` by name (s; Hz, per K and K²), the initial `departures` (K) of the lumps of each run."""

    path: HeatPath
    confidence: float
    estimates: dict[str, ThermalEstimate]
    undetermined: tuple[tuple[str, ...], ...]
    departures: tuple[tuple[float, ...], ...]
    notes: tuple[str, ...]

    @property
    def residual_rms(self) -> float:
        """Rms of what is left of the block averages about the mean of each run, Hz: slow noise carries the level off."""
        return left_rms(self.path.fit)

    @property
    def slow(self) -> float:
        """Rms of slow noise within a run over that of a row: what the lags do not follow is taken for it."""
        return slow_share(self.path.fit)

    @property
    def by_thermometer(self) -> float:
        """What the noise of the housing's readings makes of the frequency, Hz."""
        return by_thermometer(self.path.fit)

    @property
    def negative(self) -> list[str]:
        """Radiated shares that the records make negative, which none is: the model is not that of this gyro."""
        return [name for name in SHARES if name in self.estimates and self.estimates[name].high < 0.0]

    @property
    def left(self) -> list[tuple[Array, Array]]:
        """Times (s) and residuals (Hz) of each run."""
        found = self.path.fit
        rows, rest = found.rows["frequency_Hz"], found.state.residual["frequency_Hz"]
        return [(time, rest[own]) for time, own in zip(rows.times, rows.slices, strict=True)]


def fit_thermal_constants(
    records: Sequence[Record], instrument: Instrument | None = None, lags: int | None = None, confidence: float = 0.9,
    progress: Callable[[str], None] = lambda _: None,
) -> ThermalFit:  # fmt: skip
    """Find the lags of the resonator behind its housing, as many as the records support, each run with an initial state of its own."""
    if lags is not None and not 1 <= lags <= len(LAGS):
        raise InputError(f"--lags {lags}: the number of lags lies between 1 and {len(LAGS)}.")
    for record in records:
        if "frequency_Hz" not in record:
            raise InputError(
                f"{record.path}: thermal constants need frequency_Hz and housing_temperature_degC (or chamber_temperature_degC); it has {', '.join(record.columns)}."
            )
    others = ("bias_deg_per_h", "measured_rate_deg_per_s", "inverse_q")
    campaign = make_ready(
        [replace(one, columns={key: own for key, own in one.columns.items() if key not in others}) for one in records]
    )
    if not campaign.records:
        why = "; ".join(campaign.skipped.values()) or "too few rows"
        raise InputError(f"{records[0].path or 'record'}: nothing can be identified: {why}.")
    card = polynomial_card(campaign.records)
    law = card.content["law"] | cubic_of(card)
    if max(float(np.ptp(driving(record))) for record in campaign.records) < RESTS:
        law = {key: own for key, own in law.items() if not key.startswith("a")}
    if instrument is not None:
        law |= curvature_of(instrument, card.reference_temperature)
    progress("one lag")

    def find(law: dict[str, Any]) -> HeatPath:
        return find_heat_path(fit(build_problem(card.with_table("law", law), campaign.records)), lags, {}, progress)

    # Seconds by which a sensor or a clock is late look like radiation, like slow noise, or like lumps that load each other.
    path = find(law)
    delay, error = path.value(DELAY)
    if delay**2 < 4.0 * WORTH * error**2 or wanders(path.fit) or _has_lumps(path):
        prompt = find(law | {"delay_s": {"value": 0.0, "sd": 0.0}})
        worth = WORTH * (_has_lumps(path) >= _has_lumps(prompt))
        path = path if path.evidence > prompt.evidence + worth else prompt
    estimates = dict(_estimates(path, float(scipy.stats.norm.ppf(0.5 + 0.5 * confidence))))
    groups = (
        [NAMES[name] for name in group if name in NAMES]
        for group in find_groups(path.fit.problem.priors, path.fit.covariance)
    )
    return ThermalFit(
        path,
        confidence,
        estimates,
        tuple(tuple(group) for group in groups if any(estimates[name].value is None for name in group)),
        tuple(_departures(path)),
        campaign.notes,
    )


def _has_lumps(path: HeatPath) -> bool:
    return any(f"law.{key}" in path.fit.problem.priors.names for key in OF_LUMPS)


def curvature_of(instrument: Instrument, reference: float) -> dict[str, dict[str, float]]:
    """Return the bends a₂ and a₃ of a card's own law about a temperature (K), exact."""
    law = law_of(instrument, reference - 60.0, reference + 60.0)
    T = np.linspace(max(law.lowest, reference - 60.0), min(law.highest, reference + 60.0), 61)
    f = np.polynomial.Polynomial.fit(T - reference, law.frequency(T), 3).convert().coef
    return {f"a{k}_per_K{k}": {"value": float(f[k] / f[0]), "sd": 0.0} for k in (2, 3)}


def _estimates(path: HeatPath, times: float) -> Iterator[tuple[str, ThermalEstimate]]:
    """Yield the constants; one whose prior the records narrow by less than half, or a share below 0, is not determined."""
    priors = path.fit.problem.priors
    z, sd = path.fit.away, np.sqrt(np.diag(priors.covariance(path.fit.covariance)))
    level = path.value("law.f0_Hz")[0]
    for name, told in NAMES.items():
        if name in priors.names:
            k = priors.names.index(name)
            scale = level if told in ("slope", "curvature", "third_order") else 1.0
            best, low, high = (
                scale * from_standard(priors.values[k], float(z[k] + n * sd[k])) for n in (0.0, -times, times)
            )
            negative = told in SHARES and high < 0.0
            if told in SHARES and not negative:  # a share is 0 at least
                best, low = max(best, 0.0), max(low, 0.0)
            yield told, ThermalEstimate(None if sd[k] > TOLD or negative else best, low, high)


def _departures(path: HeatPath) -> Iterator[tuple[float, ...]]:
    problem = path.fit.problem
    free = path.fit.point[len(problem.priors.values) :]
    for k in range(len(problem.parts)):
        yield tuple(
            sd * float(z)
            for (part, name, sd), z in zip(problem.starts, free, strict=True)
            if part == k and name.startswith("initial.")
        )
