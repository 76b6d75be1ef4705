"""Lack of fit: what no named effect explains, seen by generic forms of each input, and what is sharp in time.

A generic form is a family like any effect, with many columns and no physics: smooth in temperature, in temperature and rate,
in history, in a drive, in time. It is weighed by the same marginal likelihood; its name is where structure is left.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from compensation.lines import Line
from studies.diagnosis.campaign import Campaign
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.held_out import residuals, rms
from studies.diagnosis.model import Fit, fit
from studies.diagnosis.noise import SHARES
from studies.diagnosis.scan import applicable, build_bank, scan
from studies.diagnosis.terms import Term
from studies.effects.states import FloatArray
from studies.inference.generic_forms import BUMP, STEP, generic_forms
from studies.inference.sharp import brief_events, fast_line, intermittent

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
