"""The joint model of all responses: its evidence is that of a dense Gaussian, and its columns are what a card with the effect predicts."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy

from compensation.noise import Noise
from studies.calibration.fit import fit
from studies.inference import responses
from studies.inference.background import Background
from studies.inference.causes import parameters_of
from studies.inference.diagnosis import build_problem
from studies.inference.held_out import HeldOut
from studies.inference.linear import SCALES, Linear, solve_posterior
from studies.inference.polynomial_card import polynomial_card
from studies.inference.predicted import Kept, Model
from studies.inference.pursuit import Pursuit
from studies.inference.search import Search
from studies.inference.sharp import intermittent, loudness, recurring, switching
from studies.inference.signatures import Signatures
from studies.instrument.card import load_card
from studies.simulation.chamber import load_profile
from studies.simulation.prediction import predict
from studies.simulation.virtual_gyro import simulate_run
from tests.sketches import coarsen
from tests.studies.diagnosis.unseen import COMMANDED, run_drive

CARD = "hrg-30mm"
RUNS = "step 20 40 3h", "ramp 20 0 0.3 then soak 0 2h"


@pytest.fixture(scope="module")
def search():
    """A linearised campaign of two short runs at the card's own values, whose commands step within the means of rows."""
    card = load_card(CARD)
    words = (
        "soak 20 10min then ramp 20 40 1.5 then soak 40 30min",
        "soak 20 10min then ramp 20 0 1.5 then soak 0 30min",
    )
    drives = [run_drive(w, 0.0, COMMANDED, k) for k, w in enumerate(words)]
    records = [simulate_run(card, drive, seed=k).record for k, drive in enumerate(drives)]
    problem = build_problem(card, [replace(one, path=f"run{k}.csv") for k, one in enumerate(records)], housing=False)
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
    term = replace(search.signatures.term(effect, "frequency_Hz", tuple(grid[0])), scale=float(SCALES[5]))
    beside = Background(linear, (), noise)
    gain = beside.gains({n: X[:, None, :] for n, X in term.columns.items()}, term.unit[None], term.effect)[5, 0]

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
    [
        ("second-lag", "frequency_Hz", 1e-3),
        ("curvature", "frequency_Hz", 1e-3),
        ("leak", "inverse_q", 1e-10),
        ("electrostatic-softening", "frequency_Hz", 1e-6),
        ("amplitude-frequency", "frequency_Hz", 1e-3),
        ("self-heating", "frequency_Hz", 1e-3),
        ("quadrature-leakage", "bias_deg_per_h", 1e-2),
        ("axis-rotation", "bias_deg_per_h", 1e-2),
        ("cross-damping", "bias_deg_per_h", 1e-2),
    ],
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


def test_a_family_whose_first_member_may_be_nothing_says_what_all_make_together(search):
    """Sizes with 0 in their intervals were printed of a hysteresis that is sure."""
    effect = next(e for e, r in search.signatures.applicable() if (e.name, r) == ("hysteresis", "frequency_Hz"))
    shape = tuple(effect.grid(search.signatures.span, "frequency_Hz")[12])
    term = search.signatures.term(effect, "frequency_Hz", shape, members=(0, 3))
    planted = 2e-2 * term.columns["frequency_Hz"][:, 1]
    target = {name: np.zeros_like(own) for name, own in search.linear.target.items()} | {"frequency_Hz": planted}
    background = Background(replace(search.linear, target=target), (term,), search.noise)
    found = parameters_of(background, search.signatures, 0)
    assert set(found) == {"half_width_K", "initial_memory", "from_degC", "to_degC", "peak_to_peak_Hz"}
    size = found["peak_to_peak_Hz"]
    assert 0.0 < size.low < np.ptp(planted) < size.high


def test_rows_held_out_are_those_of_a_refit_to_the_other_records(search):
    """The values from the first record alone, the start of the second from its own rows beside free offsets; then the simulation, which is no straight line."""
    linear, noise, values = search.linear, search.noise, len(search.linear.problem.priors.values)
    own = [values + i for i, (part, _, _) in enumerate(linear.problem.starts) if part == 1]
    mean = np.zeros(linear.count)
    for run, open_ in ((0, [k for k in range(linear.count) if k not in own]), (1, own)):
        rows, targets = [np.eye(len(open_))], [np.zeros(len(open_))]
        for name in linear.responses:
            level, at = linear.rows[name], linear.rows[name].slices[run]
            offset = 0.0 if run == 0 else 1e3 * noise[name].white / level.span**0.5
            L = np.linalg.cholesky(level.covariance(run, replace(noise[name], offset=offset)))
            rows.append(np.linalg.solve(L, linear.slope[name][at][:, open_]))
            targets.append(np.linalg.solve(L, (linear.target[name] - linear.slope[name] @ mean)[at]))
        mean[open_] = np.linalg.lstsq(np.vstack(rows), np.concatenate(targets), rcond=None)[0]
    model = Model(linear, search.signatures, (), noise)
    refitted, seen = model.residuals(Kept(mean, ())), model.residuals(model.kept(model.mean()))
    unseen, whole = HeldOut(model, seen, by_record=True).left, seen["frequency_Hz"].residual[1]
    assert np.abs(whole).max() < 0.2 * np.abs(refitted["frequency_Hz"].residual[1]).min()
    for name in linear.responses:
        rest = refitted[name].residual[1]
        own = rest - unseen[name].residual[-len(rest) :]  # a level of its own, as slow noise may give a run
        assert np.ptp(own) < 0.1 * np.sqrt(np.mean(rest**2)), name
        slow = linear.rows[name].covariance(1, replace(noise[name], white=0.0)).mean()
        assert abs(own.mean()) < 2.0 * np.sqrt(slow) + 0.1 * np.sqrt(np.mean(rest**2)), name


def test_a_value_held_at_its_end_moves_the_others():
    """Cut off alone, it left its neighbours where they were: a share of heat at its end left 14 times the noise."""
    rng = np.random.default_rng(4)
    X = rng.standard_normal((40, 3)) @ np.array([[1.0, 0.99, 0.0], [0.0, 0.14, 0.0], [0.0, 0.0, 1.0]])
    r = X @ [2.0, 3.0, -1.0] + 0.1 * rng.standard_normal(40)
    ends = np.array([-1.0, -1.0]), np.array([1.5, 5.0])  # the third has none
    mean, C = solve_posterior(X, r, ends)
    both, target = np.vstack([X, np.eye(3)]), np.append(r, np.zeros(3))
    best = scipy.optimize.lsq_linear(both, target, ([*ends[0], -np.inf], [*ends[1], np.inf]), tol=1e-14).x
    assert solve_posterior(X, r)[0][0] > 1.5
    assert mean == pytest.approx(best, abs=1e-6)
    assert C == pytest.approx(np.linalg.inv(both.T @ both))


def test_numbers_are_not_sought_where_straight_lines_lead_astray(search, monkeypatch):
    """Lines along which values hardly matter led far away, where the simulation leaves four times the noise."""
    model = Model(search.linear, search.signatures, (), search.noise)
    count, begin = search.linear.count, search.signatures.point
    assert np.array_equal(model.numbers.point, model.kept(model.mean()).point)
    thermal = [name.startswith("thermal.") for name in search.linear.problem.priors.names]
    away = 2.0 * np.append(thermal, np.zeros(count - len(thermal)))
    astray = Model(search.linear, search.signatures, (), search.noise)
    monkeypatch.setattr(astray, "mean", lambda: begin + away)
    assert astray.numbers.point == pytest.approx(begin)


def test_a_block_whose_gaps_leave_no_row_for_the_fit_is_not_held_out(search):
    paths, span = search.signatures.paths, replace(search.signatures.span, tau=1e6)
    model = Model(search.linear, SimpleNamespace(span=span, paths=paths), (), search.noise)
    seen = Model(search.linear, search.signatures, (), search.noise).residuals(model.kept(model.mean()))
    unseen = HeldOut(model, seen, by_record=False).left
    assert {one.beside(one) for one in unseen.values()} == {(None, None)}


@pytest.mark.slow
def test_a_search_whose_effects_fall_away_ends_where_the_values_are_likeliest_without_them(monkeypatch):
    """It once ended where it was linearised beside them: 24 to 49 mHz were left of 2, and called noise."""
    coarsen(monkeypatch, 60)
    made = [simulate_run(load_card(CARD), load_profile(words), 1 / 60, k).record for k, words in enumerate(RUNS)]
    records = [replace(one, path=f"run{k}.csv") for k, one in enumerate(made)]
    found = fit(build_problem(polynomial_card(records), records))
    pursuit, grow = Pursuit(found), Search.grow

    def first_one_then_none(self, before=(), *_, **more):
        plain, _ = grow(self, most=0)
        effect, response = next(own for own in self.signatures.applicable() if own[0].name == "thermometer-scale")
        lasting = self is pursuit.first and "most" not in more
        return plain, self.settle((self.signatures.term(effect, response, (0.0,)),), plain.noise) if lasting else plain

    monkeypatch.setattr(Search, "grow", first_one_then_none)
    monkeypatch.setattr(Pursuit, "_holds", lambda self, final: False)
    search, outcome = pursuit.outcome()
    assert outcome.final.terms == ()
    assert search is pursuit.first
    np.testing.assert_array_equal(pursuit.point, found.point)


def test_a_term_whose_size_is_impossible_alone_leaves_the_model_without_terms(search):
    """A negative radiated share, say; its log evidence is −∞, and rivals measured from there once lost their probability."""
    effect, response = next(one for one in search.signatures.applicable() if one[0].name == "second-lag")
    term = search.signatures.term(effect, response, (3e4,), members=(0,))
    target = {name: own - 3.0 * term.columns[name][:, 0] for name, own in search.linear.target.items()}
    against = Search(replace(search.linear, target=target), search.signatures, search.noise, bank=[])
    plain = against.settle((), search.noise)
    assert against.settle((term,), search.noise).evidence == -np.inf
    assert against.beside((term,), plain, search.noise) is plain


def test_a_search_goes_on_where_values_have_moved_far_and_the_lines_are_still_straight(search, monkeypatch):
    """A knee of the frequency moved the card's values by more than a standard deviation, and the bias' ageing was never looked for."""
    pursuit = object.__new__(Pursuit)
    pursuit.search, pursuit.point = search, np.zeros(search.linear.count)
    final, values = search.settle((), search.noise), np.full(search.linear.count, 2.0)
    moved = SimpleNamespace(mean=lambda: values, kept=lambda mean: SimpleNamespace(point=mean))
    monkeypatch.setattr(Pursuit, "_model", lambda self, final: moved)
    for straight in (True, False):
        monkeypatch.setattr(Pursuit, "_holds", lambda self, final, own=straight: own)
        assert pursuit._near(final) is straight


def test_outliers_that_recur_side_by_side_are_events():
    """Of n among N rows: k neighbours alike have B(k + 1, n − k + 1)/(n/N)^k(1 − n/N)^(n − k), here by counting; alone, of both signs or a few bursts they fail."""
    rows = np.zeros(800)
    rows[[100, 101, 300, 301, 500, 501, 502, 600, 601]] = 1.0
    chance = 9 / 800
    assert recurring([rows]) == pytest.approx(np.log(1 / 1260) - 5 * np.log(chance) - 4 * np.log(1 - chance))  # B(6, 5)
    assert recurring([rows[:350], rows[350:]]) == pytest.approx(recurring([rows]))
    assert recurring([rows[:101], rows[101:]]) == -np.inf  # the end of a run parts one of them
    assert recurring([np.where(np.arange(800) < 400, rows, -rows)]) == -np.inf
    for seed in range(20):
        alone = np.zeros(800)
        alone[np.random.default_rng(seed).choice(400, 12, replace=False) * 2] = 1.0
        assert recurring([alone]) == -np.inf


@pytest.mark.parametrize(("amplitude", "found"), [(0.0, False), (3.0, True)])
def test_noise_that_is_louder_for_a_while_is_no_oscillation_and_hides_none(amplitude, found):
    """Blocks of four rows: bursts of four times the noise were one, with evidence of 20 to 80."""
    rng = np.random.default_rng(3)
    on = np.repeat(rng.random(120) < 0.15, 30)
    rows = rng.standard_normal(3600) * np.where(on, 4.0, 1.0)
    rows[1200:2000] += amplitude * np.sin(2 * np.pi * np.arange(800) / 30.0)
    blocks, louder = (own.reshape(-1, 4).mean(1) for own in (rows, loudness(rows)))
    assert intermittent([blocks / np.std(blocks)]) > 12.0
    even = blocks / np.sqrt(np.maximum(louder, 1.0))
    assert (intermittent([even / np.std(even)]) > 12.0) == found


def test_two_levels_are_found_and_their_switches_cost_what_a_chain_gives():
    """In white noise of half their distance: all rows but a few; ln p of n switches in N rows by the chain's own chance. Levels of white noise cost more than they leave less."""
    rng = np.random.default_rng(4)
    path = [np.repeat([0.0, 1.0, 0.0, 1.0], [70, 40, 60, 80]), np.repeat([1.0, 0.0], [120, 130])]
    found, chance = switching([own + rng.normal(0.0, 0.5, own.size) + 3.0 * k for k, own in enumerate(path)])
    assert np.mean(found + 0.5 == np.concatenate(path)) > 0.98
    p = 5.0 / 502.0  # of Laplace
    assert chance == pytest.approx(4 * np.log(p) + 494 * np.log1p(-p) - 2 * np.log(2.0))
    rows = rng.normal(0.0, 1.0, 500)
    split, cost = switching([rows])
    left = np.var(rows) - np.cov(rows, split, bias=True)[0, 1] ** 2 / np.var(split)
    assert cost < -250 * np.log(np.var(rows) / left)


@pytest.mark.parametrize(
    ("gain", "doubtful", "verdict"),
    [(1.016, True, "not-identifiable"), (2.0, True, "explained"), (1.016, False, "explained")],
)
def test_a_name_that_hardly_predicts_better_beside_doubtful_structure_explains_nothing(
    monkeypatch, gain, doubtful, verdict
):
    monkeypatch.setattr(responses, "_apart", lambda *_: "")
    left = SimpleNamespace(
        significant=False, doubtful=doubtful, input="time: an intermittent oscillation", evidence=7.7
    )
    found = SimpleNamespace(left={"frequency_Hz": left}, held_out={"frequency_Hz": (gain, 1.0)})
    cause = SimpleNamespace(probability=0.74, equivalent=())
    assert responses._judge(found, "frequency_Hz", True, [cause], False, 0.0, None)[0] == verdict
