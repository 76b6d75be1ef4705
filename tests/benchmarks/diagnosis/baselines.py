"""What others would do with the same records: three baselines for the diagnosis, on identical cases.

All three get the campaign as the diagnosis reads it (even grid, outliers left out) and the diagnosis' own baseline columns
(lagged temperature with initial states, cubic of the frequency, offsets of the runs), fitted to the data under the same
lag. They differ in what they add to it. None can say `unexplained`; inseparable effects (`equivalents` of the library)
count as named rightly for all of them.

stepwise     library of polynomial and product terms as in the HRG paper's regression, forward selection with backward
             checks by ordinary least squares, p < 1e-3; every term is mapped to the effect it would stand for
lasso        the diagnosis' own signatures, LassoCV with blocked folds, then an ensemble of block bootstraps; an effect is
             named when it is in 80 % of the fits (E-SINDy: Fasel et al., Proc. R. Soc. A 478 (2022) 20210904)
white BIC    the diagnosis' own signatures and polish, one after the other, white noise, BIC > 0
"""

import json
import time
import warnings
from dataclasses import replace

import numpy as np
from scipy.stats import f as fisher

from studies.diagnosis.baseline import Term, pose, span_of
from studies.diagnosis.campaign import load_campaign
from studies.diagnosis.effects import find_effect
from studies.diagnosis.fit import fit_terms
from studies.diagnosis.likelihood import NoiseBasis
from studies.diagnosis.scan import Bank, applicable, build_dictionary, scan, scan_gains
from studies.diagnosis.selection import scan_model
from studies.diagnosis.thermometer import read_thermometer
from tests.benchmarks.diagnosis.cases import key_of, read_cases, rebuild, usable

METHODS = ("stepwise", "lasso", "white BIC")
P_ENTER = 1e-3
MOST_TERMS = 4
BAGS, INCLUDED = 20, 0.8
BLOCKS = 24
PER_EFFECT = 3
CONTENDERS = 5


def baselines_file(path):
    """Where the baselines' answers to a file of cases are kept."""
    return path.with_suffix(".baselines.jsonl")


def run_baselines(path, minutes):
    """Answer as many cases of the file as the time allows, those that have no answer yet."""
    target = baselines_file(path)
    done = set(read_answers(path))
    end = time.time() + 60 * minutes
    with target.open("a") as file:
        for case in read_cases(path):
            if time.time() > end:
                break
            if case["kind"] == "faint" or key_of(case) in done:
                continue
            file.write(json.dumps({"key": key_of(case), "answers": answer_all(case)}, default=float) + "\n")
            file.flush()
    print(f"{len(read_answers(path))} cases answered, in {target}")


def read_answers(path):
    """Return key of a case -> method -> causes."""
    target = baselines_file(path)
    if not target.exists():
        return {}
    return {(line := json.loads(text))["key"]: line["answers"] for text in target.read_text().splitlines()}


def as_cases(cases, answers, method):
    """Return the cases with a baseline's answer in the place of the diagnosis', in the same form, for the same scores."""
    out = []
    for case in cases:
        if key_of(case) not in answers:
            continue
        causes = answers[key_of(case)][method]["causes"]
        verdict = "explained" if causes else "adequate"
        out.append({**case, "causes": causes, "verdict": verdict, "seconds": answers[key_of(case)][method]["seconds"]})
    return out


def answer_all(case):
    """Return method -> causes in the form of the benchmark, strongest first, and seconds."""
    campaign = load_campaign(rebuild(case))
    effects = usable(case["kind"], case["raw"])
    out = {}
    for method, named in (("stepwise", stepwise), ("lasso", lasso), ("white BIC", white_bic)):
        begin = time.process_time()
        found, thermometer = [], None
        for response in campaign.responses:
            problem = as_white(_posed(campaign, response, thermometer))
            fit, causes = named(campaign, problem, effects)
            found += [(name, response, strength) for name, strength in causes]
            if response == "frequency_Hz":
                thermometer = read_thermometer(campaign, fit)
        out[method] = {"causes": merge(found), "seconds": time.process_time() - begin}
    return out


def merge(found):
    """One entry an effect, strongest first, with the effects that no record of the response could tell from it."""
    causes, seen = [], set()
    for name, response, strength in sorted(found, key=lambda item: -item[2]):
        if name in seen:
            continue
        exact = (find_effect(name).equivalents or {}).get(response, ()) if name != OTHER else ()
        seen |= {name, *exact}
        causes.append([name, list(exact), response, None, strength])
    return causes


def _posed(campaign, response, thermometer):
    if thermometer is None:
        return pose(campaign, response)
    readings = thermometer.change if response == "bias_deg_per_h" else thermometer.excess
    return pose(campaign, response, readings, thermometer.states)


def as_white(problem):
    """The problem with noise that is white and nothing else."""
    vectors = tuple(np.eye(v.shape[0]) for v in problem.basis.vectors)
    return replace(problem, basis=NoiseBasis(vectors, np.zeros_like(problem.basis.walk)))


# --- stepwise regression -------------------------------------------------------------------------------------------

OTHER = "no effect of the library"
STANDS_FOR = {
    "frequency_Hz": {
        "x3": "curvature",
        "x4": "curvature",
        "x5": "curvature",
        "rate": "second-lag",
        "x rate": "radiation",
        "x2 rate": "radiation",
        "rate2": OTHER,
        "time": "clock-drift",
        "time2": "ageing",
        "x time": OTHER,
        "V2": "electrostatic-softening",
        "A2": "amplitude-frequency",
        "x V2": OTHER,
        "x A2": OTHER,
        "V2 A2": OTHER,
    },
    "bias_deg_per_h": {
        "x4": "cross-damping",
        "x5": "cross-damping",
        "rate": "rate-bias",
        "x rate": "hysteresis",
        "x2 rate": "hysteresis",
        "rate2": OTHER,
        "time": "ageing",
        "time2": "ageing",
        "x time": OTHER,
        "V2": OTHER,
        "A2": OTHER,
        "x V2": OTHER,
        "x A2": OTHER,
        "quadrature": "quadrature-leakage",
        "x quadrature": "quadrature-leakage",
        "sin 4θ": "axis-rotation",
        "cos 4θ": "axis-rotation",
        "x sin 4θ": "axis-rotation",
        "x cos 4θ": "axis-rotation",
    },
    "inverse_q": {
        "x3": "loss-peak",
        "x4": "loss-peak",
        "rate": "hysteresis",
        "x rate": "hysteresis",
        "rate2": OTHER,
        "time": "leak",
        "time2": "ageing",
        "x time": "leak",
        "V2": OTHER,
        "A2": OTHER,
        "x V2": OTHER,
    },
}


def polynomial_terms(problem):
    """Return the terms of the polynomial library that vary, by name, (M,) each; x = T_r − T₀ in 10 K."""
    parts = {}
    for view in problem.views(problem.tau):
        s = view.seen
        x = s.excess / 10.0
        own = {
            "x3": x**3,
            "x4": x**4,
            "x5": x**5,
            "rate": s.rate,
            "x rate": x * s.rate,
            "x2 rate": x**2 * s.rate,
            "rate2": s.rate**2,
            "time": s.campaign_time,
            "time2": s.campaign_time**2,
            "x time": x * s.campaign_time,
        }
        volts, drive = s.voltage_squared, s.amplitude_squared
        if volts is not None:
            own |= {"V2": volts, "x V2": x * volts}
        if drive is not None:
            own |= {"A2": drive, "x A2": x * drive}
        if volts is not None and drive is not None:
            own["V2 A2"] = volts * drive
        if s.quadrature is not None:
            own |= {"quadrature": s.quadrature, "x quadrature": x * s.quadrature}
        if s.pattern_angle is not None:
            sine, cosine = np.sin(4 * s.pattern_angle), np.cos(4 * s.pattern_angle)
            own |= {"sin 4θ": sine, "cos 4θ": cosine, "x sin 4θ": x * sine, "x cos 4θ": x * cosine}
        for name, column in own.items():
            parts.setdefault(name, []).append(column)
    known = STANDS_FOR[problem.response]
    return {name: column for name in known if name in parts and np.ptp(column := problem.stack(parts[name])) > 0}


def stepwise_terms(target, fixed, terms, p_enter=P_ENTER):
    """Forward selection with backward checks, ordinary least squares.

    Parameters
    ----------
    target : (M,) array
    fixed : (M, p) array
        Columns that are always in.
    terms : mapping from name to (M,) array

    Returns
    -------
    kept : list of (name, strength)
        Strength: M ln of the residual sum of squares without the term over that with it.
    """
    scaled = {name: column / np.linalg.norm(column) for name, column in terms.items()}

    def squares(names):
        columns = np.column_stack([fixed, *(scaled[name] for name in names)])
        rest = target - columns @ np.linalg.lstsq(columns, target, rcond=1e-10)[0]
        return max(float(rest @ rest), 1e-300), max(target.size - columns.shape[1], 1)

    def chance(without, within, degrees):
        return float(fisher.sf((without - within) / within * degrees, 1, degrees))

    fixed = fixed / np.linalg.norm(fixed, axis=0)
    kept, now = [], squares([])[0]
    while len(kept) < len(scaled):
        tried = {name: squares([*kept, name]) for name in scaled if name not in kept}
        best = min(tried, key=lambda name: tried[name][0])
        if chance(now, *tried[best]) >= p_enter:
            break
        kept.append(best)
        now, degrees = tried[best]
        dropped = [n for n in kept[:-1] if chance(squares([k for k in kept if k != n])[0], now, degrees) >= p_enter]
        kept = [n for n in kept if n not in dropped]
        now = squares(kept)[0]
    strength = {n: target.size * np.log(squares([k for k in kept if k != n])[0] / now) for n in kept}
    return sorted(strength.items(), key=lambda item: -item[1])


def stepwise(campaign, problem, effects):
    """Polynomial stepwise regression: return the plain fit and (effect, strength) of every term kept."""
    fit = fit_terms(problem, ())
    terms = stepwise_terms(problem.values, scan_model(fit), polynomial_terms(problem))
    names = {effect.name for effect in effects}
    words = STANDS_FOR[problem.response]
    return fit, [(word if (word := words[term]) in names else OTHER, strength) for term, strength in terms]


# --- bagged lasso --------------------------------------------------------------------------------------------------


def lasso(campaign, problem, effects):
    """Bagged lasso over the signatures that correlate best with the residual, a few of each effect."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.linear_model import Lasso, LassoCV
    from sklearn.model_selection import GroupKFold

    fit = fit_terms(problem, ())
    columns, owner, terms = _shortlist(campaign, problem, fit, effects)
    if not columns.size:
        return fit, []
    ortho = np.linalg.qr(_unit(scan_model(fit)))[0]
    rest = problem.values - ortho @ (ortho.T @ problem.values)
    signals = columns - ortho @ (ortho.T @ columns)
    size = np.linalg.norm(signals, axis=0)
    alive = size > 3e-3
    signals, owner, terms = (
        signals[:, alive] / size[alive],
        owner[alive],
        [t for t, a in zip(terms, alive, strict=True) if a],
    )
    if not signals.size:
        return fit, []
    scale = np.sqrt(rest.size)
    signals, rest = signals * scale, rest / max(float(rest.std()), 1e-300)
    block = np.minimum(np.arange(rest.size) // BLOCKS, max((rest.size - 1) // BLOCKS, 0))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        strongest = float(np.abs(signals.T @ rest).max()) / rest.size
        folds = list(GroupKFold(5).split(signals, groups=block))
        chosen = LassoCV(alphas=strongest * np.geomspace(1.0, 1e-2, 30), cv=folds, max_iter=2000, fit_intercept=False)
        chosen.fit(signals, rest)
        error = chosen.mse_path_.mean(axis=1)
        spread = chosen.mse_path_.std(axis=1) / np.sqrt(5)
        least = int(np.argmin(error))
        alpha = float(chosen.alphas_[error <= error[least] + spread[least]].max())  # one standard error
        rng = np.random.default_rng(0)
        names = sorted(set(owner.tolist()))
        inside = dict.fromkeys(names, 0)
        weight = dict.fromkeys(names, 0.0)
        for _ in range(BAGS):
            drawn = np.concatenate([np.flatnonzero(block == b) for b in rng.integers(0, block[-1] + 1, block[-1] + 1)])
            coefficients = Lasso(alpha=alpha, max_iter=2000, fit_intercept=False).fit(signals[drawn], rest[drawn]).coef_
            for name in names:
                own = np.abs(coefficients[owner == name]).sum()
                inside[name] += own > 1e-8
                weight[name] += own / BAGS
    found = [(name, weight[name]) for name in names if inside[name] >= INCLUDED * BAGS]
    best = dict(reversed(list(zip(owner.tolist(), terms, strict=True))))
    return fit_terms(
        problem, [best[name] for name, _ in sorted(found, key=lambda f: -f[1])[:MOST_TERMS]], rounds=0
    ), found


def _unit(columns):
    size = np.linalg.norm(columns, axis=0)
    return columns / np.where(size > 0, size, 1.0)


def _shortlist(campaign, problem, fit, effects):
    """Return the unit columns of the signatures with the largest gain of each effect, whose they are, and their terms."""
    dictionary, single, double = _gains(campaign, problem, fit, effects)
    gains = single[:, 0].copy()
    gains[dictionary.pairs] = np.maximum(gains[dictionary.pairs], double[:, 0])
    columns, owner, terms = [], [], []
    for k, name in enumerate(dictionary.effects):
        members = np.flatnonzero(dictionary.owner == k)
        for pick in members[np.argsort(-gains[members])[:PER_EFFECT]]:
            second = np.flatnonzero(dictionary.pairs == pick)
            own = [dictionary.first[pick], *(dictionary.second[i] for i in second)]
            columns += own
            owner += [name] * len(own)
            terms += [Term(find_effect(name), dictionary.shapes[pick], len(own))] * len(own)
    return _unit(np.array(columns).T), np.array(owner), terms


def _gains(campaign, problem, fit, effects):
    usable_here = [e for e in applicable(problem, effects) if e.name != "calibration"]
    span = span_of(campaign, fit.problem.tau if problem.lagged else 1000.0)
    dictionary = build_dictionary(fit.problem, span, usable_here)
    return dictionary, *scan_gains(fit.problem, dictionary, scan_model(fit), fit.problem.rotated[:, None])


# --- one structured hypothesis after the other, white noise ----------------------------------------------------------


def white_bic(campaign, problem, effects):
    """Forward selection of structured hypotheses by BIC under white noise: return the fit and (effect, BIC gained)."""
    fit = fit_terms(problem, ())
    span = span_of(campaign, fit.problem.tau if problem.lagged else 1000.0)
    dictionary = build_dictionary(
        fit.problem, span, [e for e in applicable(problem, effects) if e.name != "calibration"]
    )
    bank = Bank((fit.problem,), (dictionary,))
    found = []
    while len(fit.terms) < MOST_TERMS:
        candidates = sorted(scan(bank, [scan_model(fit)]), key=lambda c: price(c.term, problem) - c.gain)
        tried = [fit_terms(fit.problem, (*fit.terms, c.term)) for c in candidates[:CONTENDERS]]
        gains = [fit.score - t.score - price(t.terms[-1], problem) for t in tried]
        if not gains or max(gains) <= 0.0:
            break
        best = int(np.argmax(gains))
        fit = tried[best]
        found.append((fit.terms[-1].name, gains[best]))
    return fit, found


def price(term, problem):
    """What BIC charges for an effect: ln M for each coefficient and each free shape parameter."""
    return (term.count + len(term.effect.shape)) * np.log(problem.values.size)
