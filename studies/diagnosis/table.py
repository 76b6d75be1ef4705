"""Diagnosis of a steady-state table: a few soaked points (T, f), like the HRG paper's Table 1.

No time, no direction, no second run: the question is how far such a table can decide at all. The material law with
free f₀ and slope is imposed first, then the curvature is freed (the baseline), then every candidate that can act in steady
state is added, and counted with all its parameters.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2
from scipy.stats import f as f_distribution

from studies.diagnosis.baseline import Law
from studies.diagnosis.extension import relative_law
from studies.diagnosis.fit import Interval
from studies.diagnosis.states import FloatArray
from studies.diagnosis.verdict import Cause, ResponseResult, Verdict

FEWEST_POINTS = 5
LEVEL = 0.02
"""A candidate counts when chance would do as well in fewer than two of a hundred tables, over all candidates."""
INSEPARABLE = 20.0
"""Candidates whose evidence (n log of the ratio of sums of squares, per parameter counted) is this near are one set."""


@dataclass(frozen=True)
class Candidate:
    """A steady-state form of an effect: columns for a shape, and the shapes to try."""

    effect: str
    form: str
    columns: Callable[[FloatArray, float, float], FloatArray]
    shapes: Sequence[tuple[float, float]]
    parameters: int


@dataclass(frozen=True)
class TableDiagnosis:
    """What a table decides, and what it leaves open.

    Attributes
    ----------
    temperature, law_residual, baseline_residual, extended_residual : (N,) arrays
        °C and Hz.
    law_rms, curvature_ratio : float
        rms that the law leaves with f₀ and slope free, Hz; measured over the law's curvature.
    candidates : sequence of (form, sum of squares, leave-one-out rms, evidence)
    sentences : sequence of str
        What was found, in words.
    """

    verdict: Verdict
    temperature: FloatArray
    law_residual: FloatArray
    baseline_residual: FloatArray
    extended_residual: FloatArray
    law_rms: float
    curvature_ratio: float
    candidates: Sequence[tuple[str, float, float, float]]
    sentences: Sequence[str]

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


def steady_candidates(T: FloatArray) -> list[Candidate]:
    """Return the effects that can act in steady state, in the forms that a table could show."""
    low, high = float(T.min()), float(T.max())
    spread = high - low
    corners = [(float(c), 0.0) for c in np.linspace(low + 0.15 * spread, high - 0.15 * spread, 29)]
    dips = [(float(c), float(w)) for c in np.linspace(low, high, 25) for w in (0.05, 0.1, 0.2, 0.4) * np.array(spread)]

    def power(*powers: int) -> Callable[[FloatArray, float, float], FloatArray]:
        return lambda x, _a, _b: np.stack([(x / 10.0) ** p for p in powers], axis=1)

    return [
        Candidate("curvature", "curvature, third order", power(3), [(0.0, 0.0)], 1),
        Candidate("curvature", "curvature, third and fourth order", power(3, 4), [(0.0, 0.0)], 2),
        Candidate("thermometer-scale", "thermometer, error of second and third order", power(3), [(0.0, 0.0)], 1),
        Candidate("thermometer-scale", "thermometer, error up to fourth order", power(3, 4), [(0.0, 0.0)], 2),
        Candidate(
            "mounting-stress",
            "mounting stress above a bond temperature",
            lambda x, a, _b: np.maximum(x - a, 0.0)[:, None],
            corners,
            2,
        ),
        Candidate(
            "activity-dip",
            "one spurious mode",
            lambda x, a, b: (((x - a) / b) / (1 + ((x - a) / b) ** 2))[:, None],
            dips,
            3,
        ),
        Candidate(
            "radiation",
            "incomplete soak with a time constant that depends on temperature",
            lambda x, a, b: ((x - a) * np.exp(-b * ((x + 273.15) / 293.15) ** 3))[:, None],
            [(20.0, b) for b in (3.0, 4.0, 5.0, 6.0, 8.0)],
            2,
        ),
    ]


def diagnose_table(path: str, card: str | None = None) -> TableDiagnosis:
    """Diagnose a steady-state table, against a card's law or the default law of fused silica."""
    from studies.instrument.card import load_card
    from studies.record import read_frequency_table, reading_resolution

    data = read_frequency_table(path)
    T, f = data.values["temperature_degC"], data.values["frequency_Hz"]
    order = np.argsort(T)
    law = relative_law(load_card("hrg-30mm" if card is None else card), T + 273.15)
    return study_steady_table(T[order], f[order], reading_resolution(f), law)


def study_steady_table(T: FloatArray, f: FloatArray, resolution: float, law: Law) -> TableDiagnosis:
    """Diagnose temperatures (°C) and frequencies (Hz) that were read to `resolution` (Hz)."""
    distinct = np.unique(T).size
    law_values = law(T + 273.15)
    free = np.stack([np.ones_like(T), law_values], axis=1)
    law_left = _left(free, f)
    base = np.stack([np.ones_like(T), law_values, T**2], axis=1)
    left = _left(base, f)
    ratio = _curvature(T, f) / _curvature(T, law_values)
    law_rms = float(np.sqrt(np.mean(law_left**2)))
    if distinct < FEWEST_POINTS:
        remark = f"{distinct} temperatures; a baseline of three numbers needs five or more to be tested"
        result = ResponseResult(
            "not-identifiable", None, (float(np.sqrt(np.mean(left**2))), None), None, "none", remark=remark
        )
        return TableDiagnosis(
            Verdict("not-identifiable", (), {"frequency_Hz": result}, _NEXT),
            T,
            law_left,
            left,
            left,
            law_rms,
            ratio,
            (),
            (remark + ".",),
        )
    rounding = resolution / np.sqrt(12.0)
    scored = sorted((_score(c, T, f, base, left, rounding) for c in steady_candidates(T)), key=lambda s: -s.evidence)
    best = scored[0]
    floor = max(rounding, 1e-12)
    beyond = chi2.sf(float(np.sum(left**2)) / floor**2, T.size - 3) < 0.01
    counts = beyond and best.chance * len(scored) < LEVEL
    base_loo = _leave_one_out(base, f)
    ext_rms = float(np.sqrt(np.mean(best.residual**2)))
    sentences = _sentences(T, f, law_rms, law_left, ratio, left, base_loo, rounding)
    if not counts:
        result = ResponseResult(
            "adequate", float(np.sqrt(np.mean(left**2))), (float(np.sqrt(np.mean(left**2))), base_loo), None, "none"
        )
        verdict = Verdict("adequate", (), {"frequency_Hz": result}, None)
        residual = left
    else:
        result = ResponseResult(
            "not-identifiable",
            max(ext_rms, rounding),
            (float(np.sqrt(np.mean(left**2))), base_loo),
            (ext_rms, best.loo),
            "none",
        )
        verdict = Verdict("not-identifiable", (_cause(scored, best),), {"frequency_Hz": result}, _NEXT)
        residual = best.residual
        sentences += [_set_sentence(scored, best)]
    return TableDiagnosis(
        verdict,
        T,
        law_left,
        left,
        residual,
        law_rms,
        ratio,
        [(s.candidate.form, s.ssq, s.loo, s.evidence) for s in scored],
        sentences,
    )


_NEXT = (
    "Approach the same temperatures from above and from below, with two soak times and a second thermometer: direction tells "
    "hysteresis and stress, soak time tells an unsettled resonator, the thermometer tells a scale error from a curvature of f."
)


@dataclass(frozen=True)
class _Scored:
    candidate: Candidate
    ssq: float
    loo: float
    evidence: float
    chance: float
    residual: FloatArray
    shape: tuple[float, float]
    coefficients: FloatArray
    errors: FloatArray


def _score(c: Candidate, T: FloatArray, f: FloatArray, base: FloatArray, left: FloatArray, rounding: float) -> _Scored:
    tried = []
    for shape in c.shapes:
        columns = np.concatenate([base, c.columns(T, *shape)], axis=1)
        tried.append((float(np.sum(_left(columns, f) ** 2)), shape, columns))
    ssq, shape, columns = min(tried, key=lambda item: item[0])
    rest = _left(columns, f)
    freedom = T.size - 3 - c.parameters
    floor = T.size * rounding**2
    before = float(np.sum(left**2))
    # what rounding alone leaves is not counted as success
    evidence = T.size * np.log((before + floor) / (ssq + floor)) - 2.0 * c.parameters
    if freedom > 0 and ssq > 0:
        ratio = (before - ssq) / c.parameters / (max(ssq, freedom * rounding**2) / freedom)
        chance = float(f_distribution.sf(max(ratio, 0.0), c.parameters, freedom))
    else:
        chance = 1.0
    count = c.columns(T, *shape).shape[1]
    solution = np.linalg.lstsq(columns, f, rcond=None)[0]
    spread = np.sqrt(max(ssq / max(freedom, 1), rounding**2))
    errors = 1.645 * spread * np.sqrt(np.diag(np.linalg.pinv(columns.T @ columns)))
    return _Scored(
        c, ssq, _leave_one_out(columns, f), float(evidence), chance, rest, shape, solution[-count:], errors[-count:]
    )


def _cause(scored: Sequence[_Scored], best: _Scored) -> Cause:
    members = {s.candidate.effect for s in scored if s.evidence > best.evidence - INSEPARABLE and s.evidence > 0}
    members |= {"curvature", "thermometer-scale"} if members & {"curvature", "thermometer-scale"} else set()
    weight = {
        name: max(np.exp(0.25 * (s.evidence - best.evidence)) for s in scored if s.candidate.effect == name)
        for name in {s.candidate.effect for s in scored}
    }
    inside = sum(weight[name] for name in members)
    return Cause(
        best.candidate.effect,
        "frequency_Hz",
        float(0.9 * inside / sum(weight.values())),
        tuple(sorted(members - {best.candidate.effect})),
        {
            name: Interval(float(v), float(v - e), float(v + e))
            for name, v, e in zip(
                ("cubic_Hz_per_10K3", "quartic_Hz_per_10K4"), best.coefficients, best.errors, strict=False
            )
        }
        if best.candidate.effect in ("curvature", "thermometer-scale")
        else {
            "size_Hz": Interval(
                float(best.coefficients[0]),
                float(best.coefficients[0] - best.errors[0]),
                float(best.coefficients[0] + best.errors[0]),
            )
        },
        best.evidence,
    )


def _sentences(
    T: FloatArray,
    f: FloatArray,
    law_rms: float,
    law_left: FloatArray,
    ratio: float,
    left: FloatArray,
    base_loo: float,
    rounding: float,
) -> list[str]:
    slope = float(np.polyfit(T, f, 1)[0])
    out = [
        f"With the material law imposed and only f0 and slope free, {law_rms:.3f} Hz rms are left, "
        f"{law_rms / abs(slope):.2f} °C as a thermometer.",
        f"The measured curvature is {ratio:.1f} times the law's; with the curvature free {np.sqrt(np.mean(left**2)):.3f} Hz rms "
        f"are left ({base_loo:.3f} Hz leave-one-out), rounding alone would leave {rounding:.4f} Hz.",
    ]
    local = np.diff(f) / np.diff(T) / (0.5 * (f[1:] + f[:-1])) * 1e6
    lowest = int(np.argmin(local))
    if 0 < lowest < local.size - 1:
        middle = 0.5 * (T[lowest] + T[lowest + 1])
        out.append(
            f"The local slope falls to {local[lowest]:.1f} ppm/°C near {middle:.0f} °C and rises again to "
            f"{local[-1]:.1f}: the law has no such turn, but its curvature is open to either sign."
        )
    if T.size >= 7:
        cubic, quartic = (float(np.sum((f - np.polyval(np.polyfit(T, f, p), T)) ** 2)) for p in (3, 4))
        freedom = T.size - 5
        ratio_f = (cubic - quartic) / (quartic / freedom)
        out.append(
            f"Cubic against quartic: {cubic:.3g} and {quartic:.3g} Hz², F(1, {freedom}) = {ratio_f:.0f}, chance "
            f"{float(f_distribution.sf(ratio_f, 1, freedom)):.2g}; the cubic is not the end."
        )
    out.append(
        f"{T.size} points approached from one side cannot show hysteresis, ageing or a linear scale error, and leave an "
        "unsettled soak in the slope."
    )
    return out


def _set_sentence(scored: Sequence[_Scored], best: _Scored) -> str:
    cause = _cause(scored, best)
    return f"Equally good within what the table can say: {', '.join([cause.effect, *cause.equivalent])}."


def _left(columns: FloatArray, f: FloatArray) -> FloatArray:
    size = np.linalg.norm(columns, axis=0)
    unit = columns / np.where(size > 0, size, 1.0)
    return np.asarray(f - unit @ np.linalg.lstsq(unit, f, rcond=None)[0])


def _leave_one_out(columns: FloatArray, f: FloatArray) -> float:
    hat = columns @ np.linalg.pinv(columns, rcond=1e-14)
    lever = np.clip(np.diag(hat), 0.0, 1.0 - 1e-9)
    return float(np.sqrt(np.mean((_left(columns, f) / (1.0 - lever)) ** 2)))


def _curvature(T: FloatArray, f: FloatArray) -> float:
    return float(2.0 * np.polynomial.Polynomial.fit(T, np.log(f), 2).convert().coef[2])
