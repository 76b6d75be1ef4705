"""Lack of fit: what no named effect explains, seen by generic forms of each input, and what is sharp in time.

A generic form is a family like any effect, with many columns and no physics: smooth in temperature, in temperature and rate,
in history, in a drive, in time. It is weighed by the same marginal likelihood; its name is where structure is left.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from compensation.lines import Line
from studies.diagnosis.campaign import Campaign, fast_line
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.held_out import residuals, rms
from studies.diagnosis.model import Fit, fit
from studies.diagnosis.noise import SHARES, student_log
from studies.diagnosis.scan import applicable, build_bank, scan
from studies.diagnosis.terms import Term
from studies.effects import Coefficient, Effect, Parameter, Span
from studies.effects.states import FloatArray, States, lag, play

TEMPERATURE_ORDERS, TIME_ORDERS = 24, 24
STRONG = {"frequency_Hz": 1e-4, "bias_deg_per_h": 10.0, "inverse_q": 0.3}


WANDER = "time: slow drift far beyond its white noise"


@dataclass(frozen=True)
class Leftover:
    """What is left: in which input, with how much log evidence, and how large a part of the structure was explained."""

    input: str
    evidence: float
    share: float
    fit: Fit | None = None
    smooth: float = 0.0
    """Log evidence of the strongest smooth form."""
    wander: bool = False
    """Whether it is nothing but a wander larger than noise is believed to be."""
    line: Line | None = None
    """The line that it is, where that is too fast for the grid."""

    @property
    def significant(self) -> bool:
        """Whether it is more than chance."""
        return self.evidence > CONSTANTS["margin"] - CONSTANTS["log_prior_unknown"]

    @property
    def doubtful(self) -> bool:
        """Whether it is more than noise leaves, though perhaps too little to be called structure."""
        return self.evidence > CONSTANTS["margin"]


def doubt_of(input_: str, evidence: float) -> str:
    """Return the sentence on structure that is more than noise leaves and less than it takes to name it."""
    needed = 2.0 * (CONSTANTS["margin"] - CONSTANTS["log_prior_unknown"])
    return f"something may be left ({input_}): evidence {2.0 * evidence:.3g}, more than noise leaves, but structure needs {needed:g}"


def _ends(states: States) -> FloatArray:
    """Temperature over the range of the campaign, about −1 … 1."""
    return np.asarray(states.excess / 30.0)


def _powers(x: FloatArray, orders: int) -> FloatArray:
    return np.stack([np.cos(k * np.arccos(np.clip(x, -1.0, 1.0))) for k in range(orders)], axis=1)


def _generic(
    name: str,
    columns: Callable[[States, Sequence[float], str], FloatArray],
    spread: Sequence[float] | FloatArray,
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
    )


def generic_forms(span: Span, runs: Sequence[States]) -> list[Effect]:
    """Return the generic forms of a campaign: of a drive, what it does where it leaves its mean, and no curve of the temperature."""
    low, high = span.temperature_low, span.temperature_high

    def place(states: States) -> FloatArray:
        return np.asarray(np.clip((states.resonator - low) / max(high - low, 1e-9), 0.0, 1.0))

    def temperature(states: States, shape: Sequence[float], response: str) -> FloatArray:
        return np.cos(np.pi * place(states)[:, None] * np.arange(2, TEMPERATURE_ORDERS))

    def rate(states: States, shape: Sequence[float], response: str) -> FloatArray:
        fast = states.rate / max((high - low) / 3600.0, 1e-12)
        x = 2.0 * place(states) - 1.0
        curve = _powers(x, 4)
        return np.concatenate(
            [curve * fast[:, None], curve * (fast**2)[:, None], curve * np.abs(fast)[:, None]], axis=1
        )

    def history(states: States, shape: Sequence[float], response: str) -> FloatArray:
        wide = high - low
        loops = play(states.resonator, [wide * part for part in (0.01, 0.03, 0.1, 0.25)])
        slow = [lag(states.resonator, states.step, span.longest_run * part) for part in (0.01, 0.04, 0.15, 0.6)]
        return np.asarray((np.concatenate([loops, np.stack(slow, 1)], axis=1) - states.resonator[:, None]) / wide)

    def time(states: States, shape: Sequence[float], response: str) -> FloatArray:
        t = (states.time - states.time[0]) / max(float(np.ptp(states.time)), 1e-9)
        waves = np.cos(np.pi * t[:, None] * np.arange(TIME_ORDERS))
        out = np.zeros((t.size, len(runs) * TIME_ORDERS))
        out[:, states.run * TIME_ORDERS : (states.run + 1) * TIME_ORDERS] = waves
        return out

    def drive(field: str) -> Callable[[States, Sequence[float], str], FloatArray]:
        every = [own for run in runs if (own := getattr(run, field)) is not None]
        largest = max((float(np.abs(own).max()) for own in every), default=0.0) or 1e-12

        def powers(states: States) -> FloatArray:
            values = np.asarray(getattr(states, field), dtype=float)
            if field == "pattern_angle":
                return np.stack([np.sin(4 * values), np.cos(4 * values)], axis=1)
            unit = values / largest
            return np.stack([unit, unit**2, unit**3, lag(unit, states.step, states.tau)], axis=1)

        # a drive that a run lacks has no form
        means = np.mean(np.concatenate([powers(run) for run in runs]), axis=0) if len(every) == len(runs) else 0.0

        def columns(states: States, shape: Sequence[float], response: str) -> FloatArray:
            curve = _powers(2.0 * place(states) - 1.0, 4)
            return np.concatenate([curve * power[:, None] for power in (powers(states) - means).T], axis=1)

        return columns

    orders = np.arange(2, TEMPERATURE_ORDERS)
    forms = [
        _generic("temperature", temperature, 2.0 / orders),
        _generic("rate and temperature", rate, [1.0] * 12),
        _generic("history of the temperature", history, [1.0] * 8),
        _generic("time", time, np.tile(1.0 / (1.0 + np.arange(TIME_ORDERS)), len(runs))),
    ]
    for field, word in (
        ("voltage_squared", "voltage"),
        ("amplitude_squared", "amplitude"),
        ("quadrature", "quadrature"),
        ("pattern_angle", "azimuth"),
    ):
        count = 16 if field != "pattern_angle" else 8
        forms.append(_generic(word, drive(field), [1.0] * count, (field,)))
    return forms


def _step(states: States, shape: Sequence[float], response: str) -> FloatArray:
    """One step at one moment of one run."""
    run, moment = shape
    return np.asarray(np.clip((states.time - moment) / states.step + 0.5, 0.0, 1.0)[:, None] * (states.run == int(run)))


STEP = replace(
    _generic("step", _step, [1.0]),
    shape=(Parameter("run", 0.0, 1e4, "run", False, True), Parameter("time_s", 0.0, 1e9, "moment", False, True)),
    grid=lambda span, response: [
        (float(k), float(t) + span.step / 2) for k, times in enumerate(span.bins) for t in times
    ],
)


def _bump(states: States, shape: Sequence[float], response: str) -> FloatArray:
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
    _generic("temperature: a bump", _bump, [1.0, 0.5, 0.5]),
    shape=(Parameter("centre", 0.0, 1e4, "centre", False, True), Parameter("width", 0.0, 1e4, "width", True, True)),
    grid=_bumps,
    fine=True,
)


def look(plain: Fit, model: Fit) -> Leftover:
    """Return the strongest generic form beside a model, and the part of the structure that the model explains.

    Parameters
    ----------
    plain : Fit
        The baseline alone.
    model : Fit
        With the named effects.
    """
    problem = model.problem
    forms = applicable(problem, model, generic_forms(problem.span, [view.coarse for view in model.tangent.views]))
    best, name = model, ""
    baseline, scales = model.baseline, model.solved.scales
    for form in forms:
        tried = fit(problem, baseline, (*model.terms, Term(form, (), named=False)), 1, np.append(scales, 1e-2))
        if tried.log_evidence > best.log_evidence:
            best, name = tried, form.name
    smooth = best.log_evidence - model.log_evidence
    for seen in scan(model, build_bank(model, [BUMP]), 3):
        tried = fit(problem, baseline, (*model.terms, replace(seen.term, named=False)), 1, np.append(scales, 1e-2))
        if tried.log_evidence - model.log_evidence + seen.choice > smooth:
            best, name, smooth = tried, BUMP.name, tried.log_evidence - model.log_evidence + seen.choice
    evidence = smooth
    step = max((seen.gain for seen in scan(model, build_bank(model, [STEP]), 3)), default=0.0)
    if step > evidence:
        name, evidence = "time: a step", step
    for word, found in (sharp(best), fitful(best)):
        if found > evidence:
            name, evidence = word, found
    part = share(plain, model, best)
    if evidence > smooth:  # brief things are in no smooth form: the share of what evidence there is
        named = max(model.log_evidence - plain.log_evidence, 0.0)
        part = min(part, named / max(named + evidence, 1e-9))
    if not model.believed and best.believed is False:
        own = CONSTANTS["margin"] - CONSTANTS["log_prior_unknown"] + 10.0 * np.log(max(model.wander_ratio, 1.0))
        if evidence < CONSTANTS["margin"] - CONSTANTS["log_prior_unknown"]:
            return Leftover(WANDER, float(own), part, best, float(smooth), True)
    return Leftover(name, float(evidence), part, best, float(smooth))


def left_over(campaign: Campaign, plain: Fit, model: Fit) -> Leftover:
    """Return what is left, or a line faster than the steps of the grid where it is more: of it their means show little or nothing."""
    left = look(plain, model)
    rest = residuals(model, campaign)
    series = [(run.row_time, own) for run, own in zip(campaign.runs, rest, strict=True)]
    line = fast_line(series, campaign.sampling, campaign.step, rms(rest))
    if line is None or line.evidence < left.evidence:
        return left
    removed = max(rms(residuals(plain, campaign)) ** 2 - rms(rest) ** 2, 0.0)
    word = f"time: a line of {line.period:.3g} s, too fast for steps of {campaign.step:.3g} s"
    part = min(left.share, removed / (removed + line.rms**2))
    return replace(left, input=word, evidence=line.evidence, share=part, line=line)


def share(plain: Fit, model: Fit, fullest: Fit) -> float:
    """Return the part of the structure that a model explains, in independent rows of its noise.

    Where that is no noise that one believes, of the noise that the fullest model leaves.
    """
    s = model.solved if model.believed else fullest.solved
    basis = fullest.problem.noise.bases[s.kind]
    root = np.sqrt(fullest.problem.noise.weights(s.kind)[s.share] / s.variance)

    def left(own: Fit) -> float:
        return float(np.sum((basis.rotate(own.residual) * root) ** 2))

    before, after, floor = left(plain), left(model), left(fullest)
    total = max(before - floor, 1e-9)
    return float(np.clip(1.0 - (after - floor) / total, 0.0, 1.0)) if before > after else 0.0


def fitful(model: Fit) -> tuple[str, float]:
    """Return the log evidence of oscillations that come and go in what a model leaves."""
    return "time: an intermittent oscillation", intermittent(innovations(model))


def intermittent(runs: Sequence[FloatArray]) -> float:
    """Return the log evidence of oscillations that come, go or wander: noise has the same spectrum all the time.

    Short periodograms of the innovations over their mean in each run are of one exponential law in noise, with about one
    mean at all frequencies; against it a mixture of two, a small part of the cells with more power.
    """
    best = 0.0
    for length in CELLS:
        cells = []
        for rows in runs:
            blocks = rows[: rows.size // length * length].reshape(-1, length)
            power = np.abs(np.fft.rfft(blocks, axis=1)[:, 1:-1]) ** 2
            cells.append(power / max(float(power.mean()), 1e-300) if power.size else power)
        table = np.concatenate(cells)
        if table.shape[0] < FEWEST_CELLS:
            continue
        power = table / np.clip(table.mean(axis=0), 1.0 / UNEVEN, UNEVEN)
        for part in (0.01, 0.03, 0.1):
            for strong in (3.0, 6.0, 12.0):
                weak = max((1.0 - part * strong) / (1.0 - part), 0.3)
                mixed = (1 - part) / weak * np.exp(-power / weak) + part / strong * np.exp(-power / strong)
                best = max(best, float(np.sum(np.log(mixed + 1e-300) + power)))
    return best - 3.0


CELLS = (8, 16, 32, 64, 128)
"""Rows to a short periodogram."""
FEWEST_CELLS = 6
"""Of each length at least so many: of fewer the mean is no measure."""
UNEVEN = 2.5
"""Factor by which the spectrum of noise may differ from that of the kinds of wander."""


def innovations(model: Fit) -> list[FloatArray]:
    """Return what each row of a model's residual brings that the rows before do not foretell, in units of σ, run by run."""
    solved, problem = model.solved, model.problem
    basis, out = problem.noise.bases[solved.kind], []
    begin = 0
    for vectors in basis.vectors:
        rows = slice(begin, begin := begin + vectors.shape[0])
        covariance = (vectors * (1.0 + SHARES[solved.share] * basis.eigenvalues[rows])) @ vectors.T
        root = np.linalg.cholesky(covariance)
        out.append(
            np.asarray(scipy.linalg.solve_triangular(root, model.residual[rows], lower=True)) / np.sqrt(solved.variance)
        )
    return out


def sharp(model: Fit) -> tuple[str, float]:
    """Return the log evidence of brief events in what a model leaves."""
    # the tails of a mean over rows are lighter than theirs
    heaviest = min(model.problem.noise.tails + 0.5 * (model.problem.noise.rows - 1.0), 1e3)
    return "time: brief events", brief_events(np.concatenate(innovations(model)), heaviest)


def brief_events(rows: FloatArray, heaviest: float) -> float:
    """Return the log evidence of brief events: a few innovations that are too large for noise of tails no heavier than Student's t.

    A mixture of two normal laws about 0, by expectation and maximisation, against the likeliest of Student's laws, for the
    tails of noise may be heavy; as many numbers more as the BIC counts.
    """
    square = rows**2 / max(float(np.mean(rows**2)), 1e-300)
    best = -np.inf
    for part in (0.02, 0.1, 0.3):
        narrow, wide = 0.5, 4.0
        for _ in range(40):
            laws = [(1.0 - part) * _normal(square, narrow), part * _normal(square, wide)]
            total = laws[0] + laws[1] + 1e-300
            belongs = laws[1] / total
            part = float(np.clip(belongs.mean(), 0.5 / rows.size, 0.5))
            narrow = max(float((1.0 - belongs) @ square / max(np.sum(1.0 - belongs), 1e-9)), 1e-3)
            wide = max(float(belongs @ square / max(belongs.sum(), 1e-9)), narrow)
        best = max(best, float(np.sum(np.log(total))))
    best -= max(student_log(square, freedom) for freedom in (heaviest, 2.0 * heaviest, 1e3))
    return best - float(np.log(rows.size))


def _normal(square: FloatArray, variance: float) -> FloatArray:
    return np.asarray(np.exp(-0.5 * square / variance) / np.sqrt(2.0 * np.pi * variance))
