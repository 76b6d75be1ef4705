"""Forward selection: add the hypothesis with the strongest evidence until nothing beyond chance is left."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from studies.diagnosis.baseline import Problem, choose_kernel, fit_at, restricted
from studies.diagnosis.effects import Effect, Span
from studies.diagnosis.fit import Fit, fit_terms
from studies.diagnosis.innovations import find_lines
from studies.diagnosis.likelihood import KERNELS, orthonormal, unit
from studies.diagnosis.scan import Bank, Candidate, applicable, build_bank, scan
from studies.diagnosis.states import FloatArray
from studies.diagnosis.thermometer import corrected

MOST_TERMS = 4
MOST = {"jump": 3, "periodic": 3, "activity-dip": 2, "loss-peak": 2}
"""How often an effect may stand in one response; all others once: a gyro has one hysteresis, one second lag."""
CONTENDERS = 5
STARTS, SECOND_START, CLEAR = 2, 0.5, 5.0
"""Where the first evidence is `CLEAR` times the threshold, the second of the contenders is tried as a start too, if it
has half that evidence: two effects together may look like a third one alone."""
NOISE_PRICE = 10.0
"""What an effect pays when it needs slow noise of another kind than the model without it: on nulls with a random walk
such pairs of effect and noise gained up to 34, effects beside the same noise 20."""
ORDER_PRICE = 6.0
"""What a further order of a static law must gain."""
FEWEST_ROWS = 4.0
"""Rows on which an effect must rest: what shows in fewer is an outlier, or the edge of a fast passage."""
BESIDE = 0.06
"""A further effect must have this part of the evidence explained before it: no formula of an effect is exact, and what
its imperfect shape leaves would otherwise be named."""


@dataclass(frozen=True)
class Rival:
    """One explanation in competition for the same residual, with its evidence net of its null level."""

    name: str
    evidence: float
    fit: Fit


@dataclass(frozen=True)
class Found:
    """One selected effect: its place in the final fit, its evidence, and who else could stand there."""

    index: int
    name: str
    evidence: float
    rivals: tuple[Rival, ...]


@dataclass(frozen=True)
class Selection:
    """What forward selection made of one response.

    Attributes
    ----------
    plain, fit : Fit
        Baseline alone, and with the selected effects.
    found : tuple of Found
        Selected effects, strongest evidence first.
    levels : mapping
        Null level of every effect.
    threshold : float
        Evidence, net of its level, that an effect needs.
    """

    plain: Fit
    fit: Fit
    found: tuple[Found, ...]
    levels: Mapping[str, float]
    threshold: float


def scan_model(fit: Fit) -> FloatArray:
    """Return the rotated columns of a fit with the derivative of the lag, against which candidates are scored."""
    return fit.problem.basis.rotate(_model_columns(fit))


def _model_columns(fit: Fit) -> FloatArray:
    problem = fit.problem
    lag = problem.lag_column(problem.tau, fit.terms, fit.linear.coefficients)
    return np.concatenate([fit.columns(), lag], axis=1)


def scan_models(fit: Fit, bank: Bank) -> list[FloatArray]:
    """Return the same for every noise of a bank."""
    columns = _model_columns(fit)
    return [problem.basis.rotate(columns) for problem in bank.problems]


def select(
    problem: Problem,
    span: Span,
    levels: Mapping[str, float],
    threshold: float,
    effects: Sequence[Effect] | None = None,
    bank: Bank | None = None,
) -> Selection:
    """Select the effects that one response needs.

    Parameters
    ----------
    problem, span
        The response, and what the campaign covers.
    levels : mapping
        Gain that chance gives each effect.
    threshold : float
        Evidence beyond the level at which an effect counts.
    effects : sequence of Effect, optional
        A smaller library.
    bank : Bank, optional
        Signatures at the problem's lag, when they are known already.
    """
    usable = applicable(problem, effects)
    plain = corrected(fit_terms(problem, ()))
    span = replace(span, tau=plain.problem.tau, lines=find_lines(plain))
    if bank is None or problem.response == "frequency_Hz":
        bank = build_bank(plain.problem, span, usable)
    starts = compete(plain, bank, levels, threshold)
    if not starts or starts[0].evidence < threshold:
        return Selection(plain, plain, (), levels, threshold)
    grown = []
    for start in starts[:STARTS]:
        if start.evidence < max(SECOND_START * starts[0].evidence, threshold):
            break
        path = _Path(corrected(start.fit), bank)
        path.grow(plain, span, usable, levels, threshold)
        grown.append(path)
        if starts[0].evidence < CLEAR * threshold:
            break
    best = min(grown, key=lambda path: path.cost(levels, threshold))
    return _settle(plain, _beside_best_noise(best.fit), best.bank, levels, threshold)


def _beside_best_noise(fit: Fit) -> Fit:
    """Return the fit beside the noise that suits it best."""
    problem = choose_kernel(fit.problem, fit.terms)
    if problem.kernel == fit.problem.kernel:
        return fit
    other = corrected(fit_terms(problem, fit.terms))
    return other if other.score < fit.score else fit


class _Path:
    """One order in which effects are added, from its first one on."""

    def __init__(self, fit: Fit, bank: Bank) -> None:
        self.fit, self.bank = fit, bank

    def grow(
        self, plain: Fit, span: Span, usable: Sequence[Effect], levels: Mapping[str, float], threshold: float
    ) -> None:
        """Add the effect with the strongest evidence until none is left beyond chance."""
        built_at = plain.problem.tau
        while len(self.fit.terms) < MOST_TERMS:
            tau = self.fit.problem.tau
            if abs(np.log(tau / built_at)) > 0.02:
                self.bank = build_bank(self.fit.problem, replace(span, tau=tau), usable)
                built_at = tau
            rivals = compete(self.fit, self.bank, levels, threshold)
            if not rivals or rivals[0].evidence < threshold + BESIDE * (plain.score - self.fit.score):
                break
            self.fit = corrected(_with_orders(rivals[0].fit, range(len(self.fit.terms))))

    def cost(self, levels: Mapping[str, float], threshold: float) -> float:
        """Minus twice the log-likelihood, and what every effect must bring to be named."""
        return self.fit.score + sum(levels[term.name] + threshold for term in self.fit.terms)


def compete(fit: Fit, bank: Bank, levels: Mapping[str, float], threshold: float) -> list[Rival]:
    """Return what each contending effect would add to a fit, after polishing, strongest first."""
    nets = _strongest(fit, bank, levels)
    if not nets or nets[0].gain - levels[nets[0].term.name] < 0.6 * threshold:
        return []
    return polish_contenders(fit, nets, levels)


def _strongest(fit: Fit, bank: Bank, levels: Mapping[str, float]) -> list[Candidate]:
    """Return the candidates that a fit has room for, the largest net gain first."""
    names = [term.name for term in fit.terms]
    free = [c for c in scan(bank, scan_models(fit, bank)) if names.count(c.term.name) < MOST.get(c.term.name, 1)]
    return sorted(free, key=lambda c: levels[c.term.name] - c.gain)


def polish_contenders(fit: Fit, nets: Sequence[Candidate], levels: Mapping[str, float]) -> list[Rival]:
    """Polish the most promising candidates on top of a fit, each beside the noise that suits it."""
    top = nets[0].gain - levels[nets[0].term.name]
    least = _least_score(fit)
    rivals = []
    for candidate in nets[:CONTENDERS]:
        if candidate.gain - levels[candidate.term.name] < 0.5 * top - 8.0:
            continue
        problem = restricted(fit.problem, kernel=candidate.kernel)
        polished = _with_orders(fit_terms(problem, (*fit.terms, candidate.term)), [len(fit.terms)])
        if not (_possible(polished) and _rests_on(polished) >= FEWEST_ROWS):
            continue
        evidence = least.over(polished) - levels[candidate.term.name]
        rivals.append(Rival(candidate.term.name, evidence, polished))
    return sorted(rivals, key=lambda rival: -rival.evidence)


def _with_orders(fit: Fit, places: Iterable[int]) -> Fit:
    """Return the fit with as many further orders of the laws at some places as pay for themselves."""
    for place in places:
        for count in range(fit.terms[place].count + 1, len(fit.terms[place].effect.coefficients) + 1):
            if not fit.terms[place].effect.nested:
                break
            terms = [replace(term, count=count) if k == place else term for k, term in enumerate(fit.terms)]
            longer = fit_terms(fit.problem, terms, rounds=2)
            if longer.score < fit.score - ORDER_PRICE * (count - fit.terms[place].count):
                fit = longer
    return fit


def _possible(fit: Fit) -> bool:
    """Whether the effect added last has the sign that its physics allows."""
    effect = fit.terms[-1].effect
    scale = fit.linear.coefficients[1] if effect.acts_on == "temperature" else 1.0
    return not effect.positive or bool(fit.coefficients_of(len(fit.terms) - 1)[0] * scale > 0.0)


def _rests_on(fit: Fit) -> float:
    """Number of rows that carry the effect added last: (Σ s²)²/Σ s⁴ of its signature s, freed of the rest of the model."""
    columns = fit.columns()
    count = fit.terms[-1].count
    rest = orthonormal(unit(columns[:, :-count]))
    signature = columns[:, -count:] @ fit.linear.coefficients[-count:]
    signature = signature - rest @ (rest.T @ signature)
    squares = (signature / max(float(np.abs(signature).max()), 1e-300)) ** 2
    return float(squares.sum() ** 2 / max(float((squares**2).sum()), 1e-300))


def _settle(plain: Fit, fit: Fit, bank: Bank, levels: Mapping[str, float], threshold: float) -> Selection:
    """Drop effects that the others made superfluous, and let every effect defend its place against its rivals."""
    while fit.terms:
        found = []
        for index, term in enumerate(fit.terms):
            others = fit.terms[:index] + fit.terms[index + 1 :]
            without = fit_terms(fit.problem, others) if others else plain
            evidence = _least_score(without).over(fit) - levels[term.name]
            found.append((evidence, index, without))
        weakest = min(found, key=lambda item: item[0])
        strongest = max(item[0] for item in found)
        if weakest[0] >= threshold + (BESIDE * strongest if len(found) > 1 else 0.0):
            break
        fit = weakest[2]
    else:
        return Selection(plain, plain, (), levels, threshold)
    places = []
    for evidence, index, without in found:
        name = fit.terms[index].name
        nets = _strongest(without, bank, levels)
        rivals = [r for r in polish_contenders(without, nets, levels) if r.name != name]
        rivals.insert(0, Rival(name, evidence, fit))
        places.append(Found(index, name, evidence, tuple(sorted(rivals, key=lambda r: -r.evidence))))
    return Selection(plain, fit, tuple(sorted(places, key=lambda f: -f.evidence)), levels, threshold)


@dataclass(frozen=True)
class _Least:
    """Score of a fit beside the noise that suits it best, and which noise that is."""

    score: float
    kernel: str

    def over(self, fit: Fit) -> float:
        """Gain of another fit; one that needs noise of another kind pays for it."""
        return self.score - fit.score - (NOISE_PRICE if fit.problem.kernel != self.kernel else 0.0)


def _least_score(fit: Fit) -> _Least:
    """Return the score of a fit under the kind of slow noise that suits it best: the null may choose its noise too."""
    problem = fit.problem
    least = _Least(fit.score, problem.kernel)
    for kernel in KERNELS:
        if kernel != problem.kernel:
            other = restricted(problem, kernel=kernel)
            score = fit_at(other, other.tau, fit.terms).score
            if score < least.score:
                least = _Least(score, kernel)
    return least
