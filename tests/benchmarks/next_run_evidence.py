"""Chamber hours of proposed runs that bring the evidence of a fixed set, by algebra: no record is measured or diagnosed.

    python tests/benchmarks/next_run_evidence.py

The first of four fixed runs of 8 h has been measured, with an effect in it whose evidence there is 20. Another effect is fitted to it
in its place. The evidence against the other that the three further fixed runs would bring is held against that of the candidates:
hours of the shortest candidate, or pair of them, that brings as much. `next_run.py` does the same with records and diagnoses.
"""

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from studies.inference.diagnosis import build_problem
from studies.inference.model import Background, Linear
from studies.inference.search import Hypothesis, Search
from studies.inference.signatures import Signatures
from studies.instrument.card import load_card
from studies.planning.candidate import Known, simulate_candidates, unabsorbed
from studies.planning.chamber import Chamber
from studies.planning.plan import simulate_plan, stated_noises
from studies.planning.programme import Programme, candidates
from studies.simulation.chamber import load_profile
from tests.benchmarks.next_run import CARD, FIXED

PAIRS = (
    ("second-lag", "mounting-stress", "frequency_Hz"),
    ("mounting-stress", "hysteresis", "frequency_Hz"),
    ("radiation", "thermometer-scale", "frequency_Hz"),
    ("curvature", "hysteresis", "frequency_Hz"),
    ("thermometer-scale", "second-lag", "frequency_Hz"),
    ("rate-frequency", "thermometer-lag", "frequency_Hz"),
    ("rate-bias", "mounting-stress", "bias_deg_per_h"),
    ("rate-bias", "cross-damping", "bias_deg_per_h"),
    ("cross-damping", "hysteresis", "bias_deg_per_h"),
    ("loss-peak", "activity-dip", "inverse_q"),
)
EVIDENCE, LARGEST, LEADING, FEWEST = 20.0, 3.0, 6, 1.0


def evidence(runs, truth, rival):
    """Evidence of several further runs together: they share what is known, each has a start of its own."""
    shared = rival.root.shape[1]
    ahead = [(run.ahead(truth)[0], *run.ahead(rival)) for run in runs]
    starts = [J.shape[1] - shared for _, _, J in ahead]
    rows = []
    for k, (_, _, J) in enumerate(ahead):
        own = np.zeros((len(J), sum(starts)))
        own[:, sum(starts[:k]) : sum(starts[: k + 1])] = J[:, shared:]
        rows.append(np.hstack([J[:, :shared], own]))
    return unabsorbed(np.concatenate([a - b for a, b, _ in ahead]), np.vstack(rows))


def main():
    """Print every pair both ways round, and the totals."""
    card = load_card(CARD)
    records = simulate_plan(card, FIXED[:1])
    problem = build_problem(card, records)
    state, noise = problem.evaluate(np.zeros(problem.count)), stated_noises(card, records)
    nothing = {name: np.zeros_like(own) for name, own in state.residual.items()}
    linear, signatures = Linear(problem, problem.rows, nothing, state.slope), Signatures.at(problem, state.point)
    search, none = Search(linear, signatures, noise, bank=[]), Hypothesis((), noise, 0.0)
    found = SimpleNamespace(search=search, final=none, numbers=SimpleNamespace(point=state.point))
    fixed = [Programme("fixed", words, load_profile(words)) for words in FIXED[1:]]
    further = [one for one in candidates(problem.runs, Chamber(3.0, -10.0, 40.0)) if not one.repeats]
    runs = simulate_candidates(found, [*fixed, *further])
    fixed_runs, possible = runs[: len(fixed)], runs[len(fixed) :]
    begun, whole = 8.0, sum(one.hours for one in fixed)
    effects = {(effect.name, response): effect for effect, response in signatures.applicable()}

    def term(name, response):
        grid = effects[name, response].grid(signatures.span, response)
        return search.term(effects[name, response], response, tuple(grid[len(grid) // 2]))

    shares = []
    for one, two, response in [(*(pair[::way]), r) for *pair, r in PAIRS for way in (1, -1)]:
        truth, rival = term(one, response), term(two, response)
        k = int(np.argmax(truth.unit))
        signal = {name: X[:, k] * truth.unit[k] for name, X in truth.columns.items()}
        _, (energy,), _ = Background(linear, (), noise).left_of({n: own[:, None] for n, own in signal.items()})
        size = min(float(np.sqrt(EVIDENCE / max(energy, 1e-9))), LARGEST)
        target = {name: own + size * signal.get(name, 0.0) for name, own in nothing.items()}
        said = SimpleNamespace(**{**vars(found), "search": SimpleNamespace(linear=replace(linear, target=target))})
        a, b = (Known(said, Hypothesis((t,), noise, 0.0)) for t in (replace(truth, scale=size), rival))
        asked = evidence(fixed_runs, a, b)
        alone = [(evidence([run], a, b), run.programme.hours, run) for run in possible]
        reaching = [hours for told, hours, _ in alone if told >= asked]
        best = [run for _, _, run in sorted(alone, key=lambda own: -own[0] / own[1])[:LEADING]]
        twos = [(p, q) for i, p in enumerate(best) for q in best[i + 1 :]]
        reaching += [p.programme.hours + q.programme.hours for p, q in twos if evidence([p, q], a, b) >= asked]
        share = (begun + min(reaching)) / (begun + whole) if reaching else np.inf
        if asked > FEWEST:
            shares.append(share)
        print(f"{one} against {two}: evidence {asked:.0f} in {whole:.1f} h; part of the hours {share:.2f}", flush=True)
    print(
        f"{sum(share <= 0.6 for share in shares)} of {len(shares)} within 60 % of the hours, median {np.median(shares):.2f}"
    )


if __name__ == "__main__":
    main()
