"""The baseline: what counts as the simulation before any effect is added.

Frequency: f₀ + a₁ g(T_r) + a₂ x² over a resonator that follows the housing through one free lag from an unknown
initial state; g is the card's material law, or x itself without a card. Bias: a cubic in the change of frequency and an
offset per run. 1/Q: a quadratic in the temperature of the resonator. x = T_r − T₀.

No sensor reads at once and no resonator is one lump: a delay δ between sensor and resonator changes the frequency by
−δ dT_r/dt df/dT. It is a nuisance with the prior δ = 0 ± 10 s, entered as one row of data more, so that it can
absorb what a few seconds explain and nothing larger.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from studies.diagnosis.campaign import Campaign
from studies.diagnosis.effects import Effect, Span
from studies.diagnosis.likelihood import KERNELS, LinearFit, NoiseBasis, fit_linear
from studies.diagnosis.states import FloatArray, States, average, lag

DELAY = 10.0
"""Standard deviation of the delay between housing sensor and resonator that every model tolerates, s."""

Law = Callable[[FloatArray], FloatArray]
"""The card's frequency at T in K; its scale does not matter."""


@dataclass(frozen=True)
class Term:
    """An effect with its shape fixed, and how many of its columns are used."""

    effect: Effect
    shape: tuple[float, ...]
    count: int

    @property
    def name(self) -> str:
        """Contract name of the effect."""
        return self.effect.name


@dataclass(frozen=True)
class View:
    """One run on the fine grid and on the coarse one: as the lag gives it, and as static effects see it.

    What a static effect sees is corrected by what a fit knows better: initial state, delay, thermal effects.
    """

    fine: States
    coarse: States
    seen_fine: States
    seen: States
    group: int


@dataclass(frozen=True)
class Problem:
    """One response of a campaign: its rows, their noise, and the thermal state that its effects see.

    Attributes
    ----------
    response : str
    states : tuple of States
        One a run, on the fine grid.
    group : int
        Fine samples to a step of the coarse grid, on which the rows are.
    present : tuple of bool arrays
        Which steps of the grid have the response, run by run.
    values : (M,) array
        The present values, stacked.
    basis : NoiseBasis
    tau : float
        Time constant of the lag, s; refitted when `lagged`.
    lagged : bool
        Whether the polynomial runs over the lagged housing temperature (frequency, or no frequency measured).
    bend : float
        Curvature over slope of the frequency, 1/K: how the slope changes with temperature.
    thermometer : tuple of arrays or None
        Resonator temperature minus reference from the frequency, K, run by run on the coarse grid.
    timed : bool
        Whether the records say when they start.
    """

    response: str
    states: tuple[States, ...]
    group: int
    present: tuple[np.ndarray, ...]
    values: FloatArray
    basis: NoiseBasis
    tau: float
    lagged: bool
    bend: float = 0.0
    thermometer: tuple[FloatArray, ...] | None = None
    law: Law | None = None
    delay_row: float | None = None
    kernel: str = "walk"
    timed: bool = True
    correction: tuple[FloatArray, ...] | None = None

    @property
    def rotated(self) -> FloatArray:
        """The values in the noise basis."""
        return self.basis.rotate(self.values)

    def stack(self, parts: Sequence[FloatArray]) -> FloatArray:
        """Stack the present rows of arrays given run by run, and the row of the delay's prior."""
        rows = [part[mask] for part, mask in zip(parts, self.present, strict=True)]
        if self.delay_row is not None:
            rows.append(np.zeros((1, *parts[0].shape[1:])))
        return np.concatenate(rows)

    def views(self, tau: float) -> list["View"]:
        """Return every run on the fine and on the coarse grid, the resonator lagged by `tau` in lagged problems."""
        out = []
        for k, own in enumerate(self.states):
            fine = own.with_lag(tau) if self.lagged else own
            coarse = fine.averaged(self.group)
            seen_fine, seen = fine, coarse
            if self.correction is not None:
                seen_fine = replace(fine, resonator=fine.resonator + self.correction[k])
                seen = replace(coarse, resonator=coarse.resonator + average(self.correction[k], self.group))
            out.append(View(fine, coarse, seen_fine, seen, self.group))
        return out

    def baseline(self, views: Sequence["View"]) -> FloatArray:
        """Return the columns of the baseline, (M, p)."""
        columns = self.stack(baseline_columns(self, [(v.coarse, v.seen) for v in views], self.thermometer))
        if self.delay_row is not None:
            columns[-1, -1] = self.delay_row
        return columns

    def term(self, term: Term, views: Sequence["View"]) -> FloatArray:
        """Return the columns of an effect, (M, k)."""
        return self.stack([term_columns(self, term, view) for view in views])

    def model(self, tau: float, terms: Sequence[Term]) -> FloatArray:
        """Return baseline and effects side by side, (M, p)."""
        views = self.views(tau)
        return np.concatenate([self.baseline(views), *(self.term(t, views) for t in terms)], axis=1)

    def lag_column(self, tau: float, terms: Sequence[Term], coefficients: FloatArray) -> FloatArray:
        """Return the derivative of the model with respect to log τ, (M, 1); empty when there is no lag to refit."""
        if not self.lagged:
            return np.empty((self.values.size, 0))
        ahead, behind = (self.model(tau * factor, terms) @ coefficients for factor in (1.02, 1 / 1.02))
        return np.asarray((ahead - behind) / (2.0 * np.log(1.02)))[:, None]


def term_columns(problem: Problem, term: Term, view: "View") -> FloatArray:
    """Return the columns of an effect for one run in units of the response over those of its coefficients."""
    thermal = term.effect.acts_on == "temperature"
    plain = thermal and not term.effect.sees_heat
    if term.effect.fine:
        fine = view.fine if plain else view.seen_fine
        columns = average(term.effect.columns(fine, term.shape, problem.response), view.group)
    else:
        columns = term.effect.columns(view.coarse if plain else view.seen, term.shape, problem.response)
    columns = columns[:, : term.count]
    if thermal:
        columns = columns * steepness(problem, view.seen)[:, None]
    return columns


def steepness(problem: Problem, seen: States) -> FloatArray:
    """Change of the frequency for a change of the resonator's temperature, over its slope at the reference."""
    own = np.ones_like(seen.time) if problem.law is None else law_slope(problem.law, seen)
    return np.asarray(own + 2.0 * problem.bend * seen.excess)


def baseline_columns(
    problem: Problem, states: Sequence[tuple[States, States]], thermometer: Sequence[FloatArray] | None
) -> list[FloatArray]:
    """Return the columns of the baseline, one array a run, from its states as the lag gives them and as they are seen.

    The frequency law g is expanded about the temperature that is seen, x + c: with δ what start, delay and effects add
    to x, g(x + δ) = [g(x + c) − g′(x + c) c] + g′(x + c) δ, which is exact once c has become δ.
    """
    runs = len(states)
    out = []
    for k, (s, seen) in enumerate(states):
        x = thermometer[k] if thermometer is not None else s.excess
        own = np.zeros((x.size, runs))
        if problem.response == "bias_deg_per_h":
            own[:, k] = 1.0
            columns = [x / 10.0, (x**2 + s.spread) / 1e2, (x**3 + 3.0 * x * s.spread) / 1e3]
        elif problem.response == "frequency_Hz":
            change = seen.excess - x
            slope = x if problem.law is None else scaled_law(problem.law, seen) - law_slope(problem.law, seen) * change
            columns = [np.ones_like(x), slope, x**2 - change**2 + s.spread]
        else:
            columns = [np.ones_like(x), x, x**2 + s.spread]
        if problem.lagged:
            steep = steepness(problem, seen) if problem.response == "frequency_Hz" else np.ones_like(x)
            start = np.zeros((x.size, runs))
            start[:, k] = s.fading * steep
            own = np.concatenate([own, start], axis=1) if problem.response == "bias_deg_per_h" else start
            if problem.delay_row is not None:
                delay = -(s.housing - s.resonator) / s.tau * steep
                own = np.concatenate([own, delay[:, None]], axis=1)
        elif problem.response != "bias_deg_per_h":
            own = own[:, :0]
        out.append(np.concatenate([np.stack(columns, axis=1), own], axis=1))
    return out


def scaled_law(law: Law, states: States) -> FloatArray:
    """The material law scaled to a unit slope at the reference, K."""
    around = np.array([states.reference - 0.5, states.reference + 0.5])
    slope = float(np.diff(law(around))[0])
    return np.asarray((law(states.resonator) - law(np.array([states.reference]))[0]) / slope)


def law_slope(law: Law, states: States) -> FloatArray:
    """Slope of the scaled material law, 1 at the reference."""
    ahead, behind = (replace(states, resonator=states.resonator + side) for side in (0.5, -0.5))
    return np.asarray(scaled_law(law, ahead) - scaled_law(law, behind))


def pose(
    campaign: Campaign,
    response: str,
    thermometer: Sequence[FloatArray] | None = None,
    states: Sequence[States] | None = None,
    law: Law | None = None,
    keep: Sequence[int] | None = None,
) -> Problem:
    """Set up the problem of one response.

    Parameters
    ----------
    campaign : Campaign
    response : str
    thermometer : sequence of arrays, optional
        Resonator temperature minus reference from the frequency, K; with it the polynomial needs no lag.
    states : sequence of States, optional
        States with the best known resonator temperature; without them the housing is lagged.
    law : callable, optional
        The card's material law.
    keep : sequence of int, optional
        Use these runs only; the others count as missing.
    """
    chosen = range(len(campaign.runs)) if keep is None else keep
    present = tuple(np.isfinite(run.responses[response]) & (k in chosen) for k, run in enumerate(campaign.runs))
    values = np.concatenate([run.responses[response][m] for run, m in zip(campaign.runs, present, strict=True)])
    times = [run.time[m] for run, m in zip(campaign.runs, present, strict=True) if m.any()]
    chosen_states = tuple(run.states for run in campaign.runs) if states is None else tuple(states)
    lagged = response == "frequency_Hz" or thermometer is None
    problem = Problem(
        response,
        chosen_states,
        campaign.group,
        present,
        values,
        NoiseBasis.of(times),
        chosen_states[0].tau,
        lagged,
        thermometer=None if lagged else tuple(thermometer or ()),
        law=law,
        timed=campaign.timed,
    )
    if not lagged:
        return problem
    problem = calibrate(problem)
    if response != "frequency_Hz":
        return problem
    slope = fit_at(problem, problem.tau).coefficients[1]
    row = white_level(problem) / max(abs(float(slope)) * DELAY, 1e-300)
    return calibrate(
        replace(
            problem,
            values=np.append(values, 0.0),
            basis=problem.basis.with_row(),
            delay_row=row,
        ),
        around=problem.tau,
    )


def restricted(problem: Problem, keep: Sequence[np.ndarray] | None = None, kernel: str | None = None) -> Problem:
    """Return the problem on fewer rows, or with another kind of slow noise."""
    keep = problem.present if keep is None else keep
    kernel = problem.kernel if kernel is None else kernel
    present = tuple(mask & kept for mask, kept in zip(problem.present, keep, strict=True))
    chosen = np.concatenate([kept[mask] for mask, kept in zip(problem.present, keep, strict=True)])
    values = problem.values[: chosen.size][chosen]
    times = [average(s.time, problem.group)[m] for s, m in zip(problem.states, present, strict=True)]
    basis = NoiseBasis.of([t for t in times if t.size], kernel)
    if problem.delay_row is not None:
        values, basis = np.append(values, 0.0), basis.with_row()
    return replace(problem, present=present, values=values, basis=basis, kernel=kernel)


def choose_kernel_score(problem: Problem) -> float:
    """Return the score of the baseline under the kind of slow noise that suits it best."""
    return min(score for _, score in _beside_every_noise(problem))


def _beside_every_noise(problem: Problem, terms: Sequence[Term] = ()) -> list[tuple[Problem, float]]:
    """Return the problem beside every kind of slow noise, and the score that baseline and terms have there."""
    others = [restricted(problem, kernel=kernel) for kernel in KERNELS]
    return [(other, fit_at(other, other.tau, terms).score) for other in others]


def choose_kernel(problem: Problem, terms: Sequence[Term] = ()) -> Problem:
    """Return the problem with the kind of slow noise that the data make most likely."""
    tried = _beside_every_noise(problem, terms)
    best, least = min(tried, key=lambda pair: pair[1])
    return best if least < tried[KERNELS.index(problem.kernel)][1] - 1.0 else problem


def white_level(problem: Problem) -> float:
    """Return the white noise of a row, from second differences: no slow effect reaches it."""
    parts, begin = [], 0
    for mask in problem.present:
        end = begin + int(mask.sum())
        parts.append(np.diff(problem.values[begin:end], 2))
        begin = end
    second = np.concatenate(parts)
    return float(1.4826 * np.median(np.abs(second)) / np.sqrt(6.0)) if second.size else 0.0


def calibrate(problem: Problem, terms: Sequence[Term] = (), around: float | None = None) -> Problem:
    """Fit the lag (and the bend of the frequency law) of a lagged problem; return the problem with both."""
    target = problem.rotated

    def score(log_tau: float) -> float:
        return fit_at(problem, float(np.exp(log_tau)), terms, target).score

    grid = np.log(np.geomspace(30.0, 3e4, 15)) if around is None else np.log(around) + np.linspace(-0.4, 0.4, 5)
    for _ in range(2 if around is None else 1):
        scores = [score(value) for value in grid]
        best = int(np.argmin(scores))
        low, high = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
        tau = float(np.exp(_golden(score, low, high)))
        coefficients = fit_at(problem, tau, terms, target).coefficients
        if problem.response == "frequency_Hz" and coefficients[1] != 0.0:
            bend = float(coefficients[2] / coefficients[1])
            problem = replace(problem, bend=float(np.clip(bend, -0.02, 0.02)))
        problem = replace(problem, tau=tau)
        grid = np.log(tau) + np.linspace(-0.3, 0.3, 4)
    return problem


def fit_at(problem: Problem, tau: float, terms: Sequence[Term] = (), target: FloatArray | None = None) -> LinearFit:
    """Fit baseline and terms at a fixed lag."""
    columns = problem.basis.rotate(problem.model(tau, terms))
    return fit_linear(problem.basis, problem.rotated if target is None else target, columns)


def _golden(function: Callable[[float], float], low: float, high: float, rounds: int = 9) -> float:
    ratio = 0.6180339887498949
    a, b = high - ratio * (high - low), low + ratio * (high - low)
    fa, fb = function(a), function(b)
    for _ in range(rounds):
        if fa < fb:
            high, b, fb = b, a, fa
            a = high - ratio * (high - low)
            fa = function(a)
        else:
            low, a, fa = a, b, fb
            b = low + ratio * (high - low)
            fb = function(b)
    return a if fa < fb else b


def span_of(campaign: Campaign, tau: float) -> Span:
    """Return the ranges that the campaign covers."""
    temperature = np.concatenate([run.states.housing for run in campaign.runs])
    lagged = np.concatenate([lag(run.states.housing, run.states.step, tau) for run in campaign.runs])
    return Span(
        float(lagged.min()),
        float(lagged.max()) + (0.0 if np.ptp(temperature) > 0.0 else 1e-3),
        max(float(np.ptp(run.states.time)) for run in campaign.runs),
        max(float(run.states.campaign_time[-1]) for run in campaign.runs),
        campaign.step,
        tau,
        len(campaign.runs),
        tuple(run.time for run in campaign.runs),
    )
