"""The joint model of all responses: its evidence is that of a dense Gaussian, and its columns are what a card with the effect predicts."""

from dataclasses import replace

import numpy as np
import pytest

from compensation.noise import Noise
from studies.inference.diagnosis import build_problem
from studies.inference.model import SCALES, Background, Linear
from studies.inference.search import Search
from studies.inference.signatures import Signatures
from studies.instrument.card import load_card
from studies.simulation.chamber import load_profile
from studies.simulation.prediction import predict
from studies.simulation.virtual_gyro import simulate_run

CARD = "hrg-30mm"


@pytest.fixture(scope="module")
def search():
    """A linearised campaign of two short runs at the card's own values."""
    card = load_card(CARD)
    words = (
        "soak 20 10min then ramp 20 40 1.5 then soak 40 30min",
        "soak 20 10min then ramp 20 0 1.5 then soak 0 30min",
    )
    records = [simulate_run(card, load_profile(w), 1.0 / 60.0, k).record for k, w in enumerate(words)]
    problem = build_problem(card, [replace(one, path=f"run{k}.csv") for k, one in enumerate(records)])
    state = problem.evaluate(np.zeros(problem.count))
    linear = Linear(problem, problem.rows, state.residual, state.slope)
    noise = {"frequency_Hz": Noise(3e-3, 1e-3, 1e-6), "bias_deg_per_h": Noise(1.0, 0.05), "inverse_q": Noise(2e-9)}
    return Search(linear, Signatures.at(problem, state.point), noise, bank=[])


def dense(linear, terms, noise):
    """ln N(y; 0, Σ + X Xᵀ), responses stacked."""
    X = np.vstack([linear.columns(terms, name) for name in linear.responses])
    y = np.concatenate([linear.target[name] for name in linear.responses])
    S, at = X @ X.T, 0
    for name in linear.responses:
        for run, t in enumerate(linear.rows[name].times):
            own = slice(at, at + len(t))
            S[own, own] += linear.rows[name].covariance(run, noise[name])
            at += len(t)
    return y, S


def test_evidence_of_a_term_is_that_of_a_dense_gaussian(search):
    linear, noise = search.linear, search.noise
    _, effect = next((k, e) for k, (e, r) in enumerate(search.signatures.applicable()) if e.name == "curvature")
    grid = effect.grid(search.signatures.span, "frequency_Hz")
    term = replace(search.term(effect, "frequency_Hz", tuple(grid[0])), scale=float(SCALES[5]))
    beside = Background(linear, (), noise)
    gain = beside.gains({n: X[:, None, :] for n, X in term.columns.items()}, term.unit[None], np.array([False]))[5, 0]

    def exact(terms):
        # correlated units of very different size: scaled to unit variance first
        y, S = dense(linear, terms, noise)
        size = np.sqrt(np.diag(S))
        L = np.linalg.cholesky(S / np.outer(size, size))
        return -0.5 * np.sum(np.linalg.solve(L, y / size) ** 2) - np.log(np.diag(L)).sum() - np.log(size).sum()

    assert gain == pytest.approx(exact((term,)) - exact(()), rel=1e-4, abs=1e-3)
    assert Background(linear, (term,), noise).evidence - beside.evidence == pytest.approx(gain, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "response", "size"),
    [("second-lag", "frequency_Hz", 1e-3), ("curvature", "frequency_Hz", 1e-3), ("leak", "inverse_q", 1e-10)],
)
def test_columns_of_an_effect_are_what_a_card_that_has_it_predicts(search, name, response, size):
    """One member of the effect, small, in the card: the prediction changes by its column, in every response."""
    problem, signatures = search.linear.problem, search.signatures
    effect = next(e for e, r in signatures.applicable() if e.name == name and r == response)
    shape = tuple(effect.grid(signatures.span, response)[0])
    numbers = {p.name: float(v) for p, v in zip(effect.shape, shape, strict=True)}
    values = np.zeros(effect.spread.size)
    values[0] = size
    table = {"name": name, "response": response, **numbers, **effect.numbers(values, response)}
    plain = problem.instrument_at(np.zeros(problem.count))
    with_it = plain.with_table("effect", [table])
    columns = signatures.columns(effect, shape, response)
    law = problem.law
    for found, own in columns.items():
        changes = []
        for part in problem.members(found):
            drive = part.drive
            one, two = (predict(card, drive, (), law).columns[found] for card in (plain, with_it))
            changes.append(problem.runs[part.run].responses[found].average(two - one))
        change, column = np.concatenate(changes), own[:, 0] * size
        assert np.abs(change - column).max() <= 0.02 * np.abs(change).max() + 1e-300
