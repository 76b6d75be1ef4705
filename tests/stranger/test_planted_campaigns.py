"""Evidence: what an independent generator hides is named, and nothing else is; one batch of campaigns, read as a table.

A share is asked of each row; the table fails where as few would come of it in one of twenty batches (binomial).
"""

import pytest
from scipy.stats import binom

from studies.effects import library
from tests.benchmarks.diagnosis.marks import mark
from tests.stranger.batch import CASES, STUBS, answer
from tests.stranger.effects import EFFECTS

WORST = ("unexplained", "not-identifiable", "explained", "adequate")
WIDEST = 8
"""Names in one set, a third of the library: naming everything is no answer."""


def sets_of(line):
    return [{c["effect"], *c["equivalent"]} for c in line["causes"]]


def of(kind):
    return lambda line: line["truth"]["kind"] == kind


ROWS = {
    "the strongest name is the hidden effect, or a small set that holds it": (
        of("effect"),
        lambda line: mark(line).first and len(sets_of(line)[0]) <= WIDEST,
        0.9,
    ),
    "nothing is named that is not there": (of("effect"), lambda line: all(hit for _, hit in mark(line).stated), 0.8),
    "a known effect is not called unexplained": (of("effect"), lambda line: line["verdict"] != "unexplained", 0.9),
    "where nothing is hidden, nothing is named": (of("null"), lambda line: mark(line).right, 0.9),
    "a cause outside the library is unexplained": (of("alien"), lambda line: mark(line).right, 0.8),
    "both of a pair are named, each in a small set": (
        of("pair"),
        lambda line: mark(line).every and all(len(names) <= WIDEST for names in sets_of(line)),
        0.7,
    ),
}
"""Row: which campaigns, what holds of each, and the share of which it must."""


def short_of(label, table):
    """Return the campaigns for which a row does not hold, where they are more than chance lets expect."""
    chosen, holds, share = ROWS[label]
    own = [line for line in table if chosen(line)]
    missed = [line["case"] for line in own if not holds(line)]
    return missed if binom.cdf(len(own) - len(missed), len(own), share) < 0.05 else []


def narrow(table):
    """Mean number of names in the first set of an effect that is named."""
    widths = [len(sets_of(line)[0]) for line in table if of("effect")(line) and line["causes"]]
    return sum(widths) / len(widths) if widths else 1.0


def overclaimed(table):
    """Return by how many standard deviations the named causes are right less often than their probabilities say."""
    stated = [pair for line in table for pair in mark(line).stated]
    variance = sum(p * (1.0 - p) for p, _ in stated)
    return (sum(p - hit for p, hit in stated)) / variance**0.5 if stated else 0.0


@pytest.fixture(scope="session")
def folder(tmp_path_factory, worker_id):
    """Return a folder that all processes of a session share."""
    base = tmp_path_factory.getbasetemp()
    return (base if worker_id == "master" else base.parent) / "stranger"


@pytest.fixture(scope="session")
def table(folder):
    return [answer(place, folder) for place in range(len(CASES))]


def test_every_effect_of_the_library_is_hidden_here():
    assert set(EFFECTS) == set(library())


@pytest.mark.slow
@pytest.mark.parametrize("place", range(len(CASES)), ids=[f"{kind}:{name}" for kind, name, _ in CASES])
def test_an_answer_is_whole(place, folder):
    """The verdict is that of the worst response, causes stand by falling evidence, values within their intervals, gains are those of held-out rows, and what is held out of an adequate response is left as what was seen, whatever hides in another."""
    found = answer(place, folder)
    assert not found["truth"]["faults"]
    judged = [one for one in found["responses"].values() if one["verdict"] is not None]
    assert found["verdict"] == min((one["verdict"] for one in judged), key=WORST.index)
    evidence = [cause["evidence"] for cause in found["causes"]]
    assert evidence == sorted(evidence, reverse=True)
    for cause in found["causes"]:
        assert 0.0 < cause["probability"] < 1.0
        assert cause["evidence"] > 0.0, "nothing speaks for it"
        assert all(value["low"] <= value["value"] <= value["high"] for value in cause["parameters"].values())
    for one in judged:
        assert (one["extended"] is None) >= (one["verdict"] == "adequate")
        if one["verdict"] == "adequate" and one["baseline"]["held_out_rms"] is not None:
            assert one["baseline"]["held_out_rms"] < 2 * one["baseline"]["residual_rms"]
        if one["gain"] is not None:
            assert one["gain"] == pytest.approx(one["baseline"]["held_out_rms"] / one["extended"]["held_out_rms"])


@pytest.mark.slow
@pytest.mark.parametrize("label", ROWS)
def test_share(label, table):
    assert not short_of(label, table)


@pytest.mark.slow
def test_sets_are_small_and_probabilities_are_not_too_high(table):
    assert narrow(table) < 2.5
    assert overclaimed(table) < 2.0, "standard deviations by which causes are right less often than stated"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "caught"),
    [
        ("always adequate", {0, 4, 5}),
        ("always the first effect", {0, 1, 3, 4, 5}),
        ("one of all effects", {0, 3, 4, 5}),
    ],
)
def test_an_engine_that_does_not_look_is_caught(name, caught, table):
    """Rows by their places in the table; who names all effects is right always and caught by the width alone."""
    blind = [STUBS[name](line) for line in table]
    assert {place for place, label in enumerate(ROWS) if short_of(label, blind)} == caught
    assert (narrow(blind) > 2.5) is (name == "one of all effects")
