"""A plan before any data: its algebra is the mean over drawn noise, and its answers are right where they are known beforehand."""

import json

import numpy as np
import pytest
from scipy.special import logsumexp

from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.verdict import temper_of
from studies.errors import InputError
from studies.inference.background import Background
from studies.inference.diagnosis import build_problem
from studies.inference.linear import PRICE, SCALES, Linear
from studies.inference.search import MARGIN, Search
from studies.inference.signatures import Signatures
from studies.instrument.card import load_card
from studies.planning.chamber import limited, parse_chamber
from studies.planning.expectation import Expectation, hide
from studies.planning.plan import plan_campaign, require_reach, simulate_plan, stated_noises
from tests.golden.answers import HERE
from thermal.profile import parse_profile

WORDS = "soak 20 10min then ramp 20 40 1.5 then soak 40 40min then ramp 40 0 1.5 then soak 0 40min"
FEW = ("jump", "ageing", "curvature", "second-lag", "radiation")


@pytest.fixture(scope="module")
def hidden():
    """A few effects hidden in one short planned run, and the search that would look for them."""
    card = load_card("hrg-30mm")
    records = simulate_plan(card, [WORDS])
    problem = build_problem(card, records, housing=False)
    state = problem.evaluate(np.zeros(problem.count))
    zero = {name: np.zeros_like(own) for name, own in state.residual.items()}
    linear, noise = Linear(problem, problem.rows, zero, state.slope), stated_noises(card, records)
    search = Search(linear, Signatures.at(problem, state.point), noise, bank=[])
    few = [(e, r) for e, r in search.signatures.applicable() if e.name in FEW and r == "frequency_Hz"]
    search.bank = search.signatures.shapes_of(few)
    rng = np.random.default_rng(3)
    groups = [[own for own in search.bank if own.effect is e] for e, _ in few]
    own = [hide(search, group, rng) for group in groups]
    return search, Background(linear, (), noise), Expectation(search, Background(linear, (), noise), own)


def drawn_scores(search, beside, signal, draws, rng):
    """Log posterior of every effect for a signal in drawn noise, (draws, effects): the gain of the scan, draw by draw."""
    targets = {}
    for name in search.linear.responses:
        rows, own = search.linear.rows[name], signal.get(name)
        roots = [np.linalg.cholesky(rows.covariance(k, beside.noise[name])) for k in range(len(rows.times))]
        noise = np.concatenate([L @ rng.standard_normal((len(L), draws)) for L in roots])
        targets[name] = noise if own is None else noise + own[:, None]
    left, _, _ = beside.left_of(targets)
    found = {}
    for own in search.bank:
        units = np.broadcast_to(
            search.signatures.unit(own.effect, own.response, own.members), (len(own.shapes), len(own.members))
        )
        values, _, along = beside.against(own.columns, units, left)
        for scale in SCALES**2:
            fall = 0.5 * np.log1p(scale * values).sum(axis=1)[:, None]
            gain = 0.5 * np.einsum("hk,hkd->hd", scale / (1 + scale * values), along**2) - fall
            found.setdefault(own.effect.name, []).append(gain)
    return list(found), np.stack(
        [PRICE + logsumexp(np.vstack(g), axis=0) - np.log(len(np.vstack(g))) for g in found.values()], axis=1
    )


@pytest.mark.slow
def test_expected_answers_are_those_of_drawn_noise(hidden):
    """Chances and mean log odds against 100 draws of the noise, for sizes at which the answer is open."""
    search, beside, expected = hidden
    rng, size = np.random.default_rng(5), 10.0 ** np.arange(-4.0, 0.51, 0.125)
    chances, said, told, drawn, meant = expected.chances(size), [], [], [], []
    for one, place in zip(expected.hidden, expected.places, strict=True):
        own = chances[one.key].named
        for b in range(0, one.cases, 3):
            k = int(np.argmin(np.abs(own[:, b] - 0.6)))
            signal = {n: size[k] * X[:, place.start + b] for n, X in expected.signals.items()}
            names, scores = drawn_scores(search, beside, signal, 100, rng)
            best, mine = scores.max(axis=1), scores[:, names.index(one.effect.name)]
            near = np.array([temper_of(lead) for lead in best]) * -np.log(CONSTANTS["member"])
            said.append(float(np.mean((best > MARGIN) & (mine > best - near))))
            told.append(float(own[k, b]))
            drawn.append(mine.mean())
            meant.append(expected.score(one.key, size[[k]])[0][0, place.start + b])
    assert len(said) >= 12
    assert np.mean(said) == pytest.approx(np.mean(told), abs=0.1)
    assert np.sqrt(np.mean((np.array(said) - told) ** 2)) < 0.2
    assert np.abs(np.array(drawn) - meant).max() < 1.5


def test_a_larger_effect_is_never_named_less(hidden):
    """Of one shape the chance grows with the size but for what bounded priors take, and nothing is said of none."""
    _, _, expected = hidden
    size = 10.0 ** np.arange(-6.0, 0.51, 0.25)
    for one in expected.chances(size).values():
        assert one.named[0].max() < 0.01
        assert one.nothing[0].min() > 0.95
        mean = one.named.mean(axis=1)
        assert np.diff(mean).min() > -0.05
        shares = one.named + one.nothing + sum(one.instead.values())
        assert np.abs(shares - 1.0).max() < 1e-9


def test_what_the_card_absorbs_is_no_signal(hidden):
    """A signal along the card's own columns leaves next to nothing; the rest of any signal is orthogonal to them."""
    search, beside, _ = hidden
    J = search.linear.slope
    signal = {name: own[:, :3] for name, own in J.items()}
    _, energy, _ = beside.left_of(signal)
    assert energy.max() <= 3.0  # the prior of a unit coordinate is all that it costs
    _, whole, _ = Background(search.linear, (), beside.noise).left_of({n: 1e3 * own for n, own in signal.items()})
    assert np.allclose(whole, 1e6 * energy)


def test_equivalents_stand_in_a_set_and_drives_that_stand_still_cannot_show():
    """Of the golden answer, which is what the command says of one step."""
    plan = json.loads((HERE / "answers" / "diagnose-plan.json").read_text(encoding="utf-8"))
    rows = {(row["effect"], row["response"]): row for row in plan["effects"]}
    assert "clock-drift" in rows["ageing", "frequency_Hz"]["as_set_with"]
    assert rows["ageing", "frequency_Hz"]["least_alone"] is rows["clock-drift", "frequency_Hz"]["least_alone"] is None
    assert {"electrostatic-softening", "amplitude-frequency", "self-heating"} <= set(plan["not_testable"])
    clock = next(pairs for sensor, pairs in plan["sensors"].items() if "reference clock" in sensor)
    assert "ageing / clock-drift" in clock
    for row in rows.values():
        chances = [row["identified"][snr] for snr in ("0.1", "0.3", "1")]
        assert all(chance is None or 0.0 <= chance <= 1.0 for chance in chances)
        known = [chance for chance in chances if chance is not None]
        assert known == sorted(known), row
        if row["least"] is not None:
            assert row["least"]["value"] <= row["largest"]["value"]


def test_a_plan_beyond_the_chamber_is_refused():
    chamber = parse_chamber("rate 3 range -40 85")
    assert (chamber.rate, chamber.low, chamber.high) == (3.0, -40.0, 85.0)
    require_reach(chamber, "ramp 20 -10 3")
    with pytest.raises(InputError, match="reaches -40 to 85"):
        require_reach(chamber, "soak -60 5h")
    with pytest.raises(InputError, match="10 K/min"):
        require_reach(chamber, "ramp 20 60 10")


def test_a_card_without_noise_plans_nothing():
    card = load_card("hrg-30mm")
    with pytest.raises(InputError, match="bias_white_deg_per_rt_h is 0"):
        plan_campaign(card.with_table("noise", {"bias_white_deg_per_rt_h": 0.0}), [WORDS])


@pytest.mark.parametrize(
    ("words", "minutes"),
    [("step 20 -10 5h", 300), ("soak 20 1h then soak -35 5400s", 150), ("step 20 -10 5h then ramp -10 40 9", 317),
     ("soak -20 60min then soak 40 60min then staircase 40 0 20 30min", 210)],
)  # fmt: skip
def test_words_of_every_form_keep_to_the_chamber(words, minutes):
    profile = parse_profile(limited(words, 3.0))
    assert profile.end == pytest.approx(60.0 * minutes, rel=0.02)
    assert (np.abs(np.diff(profile.value)) <= 3.001 / 60.0 * np.diff(profile.time)).all()
    assert (profile.value[0], profile.value[-1]) == (parse_profile(words).value[0], parse_profile(words).value[-1])
