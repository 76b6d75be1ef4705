"""Optima, multipliers, fronts and margins that are known in closed form come back; a search beats as many random designs."""

import numpy as np
import pytest
from scipy.stats import norm

from studies.design import answer as module
from studies.design.answer import answer
from studies.errors import InputError

XY = {"x": (0.1, 2.0, {}), "y": (0.1, 2.0, {})}


@pytest.fixture(autouse=True)
def no_card(monkeypatch):
    """What is verified from a card is here the formula itself."""
    monkeypatch.setattr(module, "evaluate_case", lambda plan, named: plan(named))


def ask(posed):
    task, explorer = posed

    class Row:
        def __init__(self, named):
            self.values = explorer.function(list(named.values()))
            self.errors = np.full(len(self.values), np.nan)

    return answer(task, explorer, Row)


def least_sum(pose, *limits, box=XY, product=lambda d: d[0] * d[1], **tables):
    """Pose the least x + y within limits of a product, ½ or more."""
    limits = limits or ({"column": "product", "low": 0.5},)
    objective = [{"column": "sum"}]
    return pose(
        box,
        ["sum", "product"],
        lambda d: [d[0] + d[1], product(d)],
        objective=objective,
        constraint=[*limits],
        **tables,
    )


def test_the_least_sum_at_a_given_product_and_its_price(pose):
    # min x + y with x y ≥ 1/2: x = y = 1/√2, and d(x + y)/d(limit) = 1/√(limit)
    found = ask(least_sum(pose))
    assert found.best == pytest.approx([0.5**0.5] * 2, abs=2e-3)
    assert found.after[0] == pytest.approx(2**0.5, rel=1e-5)
    assert found.limits[0].price == pytest.approx(2**0.5, rel=1e-2)
    assert found.foretold == pytest.approx(found.verified, rel=1e-4)


def test_a_target_and_a_bound(pose):
    found = ask(
        pose(XY, ["f"], lambda d: [d[0] ** 2 + d[1]], objective=[{"column": "f", "goal": "target", "target": 1.5}])
    )
    assert found.after[0] == pytest.approx(1.5, abs=1e-5)
    steep = ask(pose(XY, ["f"], lambda d: [np.exp(5 * d[0]) * d[1]], objective=[{"column": "f"}]))
    assert steep.best == pytest.approx([0.1, 0.1], abs=1e-9)


def test_whole_steps_keep_the_limits(pose):
    stepped = {"x": (0.1, 2.0, {"step": 0.05}), "y": (0.1, 2.0, {"step": 0.07})}
    found = ask(least_sum(pose, box=stepped))
    grid = [(0.05 * i, 0.07 * j) for i in range(2, 41) for j in range(2, 29) if 0.05 * i * 0.07 * j >= 0.5]
    assert found.best / [0.05, 0.07] == pytest.approx(np.round(found.best / [0.05, 0.07]), abs=1e-9)
    assert found.after[1] >= 0.5
    assert found.after[0] <= min(x + y for x, y in grid) + 0.02


@pytest.mark.parametrize("limits", [{"low": 0.5}, {"low": 0.5, "high": 0.51}])
def test_what_has_no_step_follows_the_whole_steps(pose, limits):
    # x in steps of 0.4, y at will: of 0.5/x + x the step 0.8 is best, where the smooth optimum's y = 0.71 is none, or not allowed
    box = {"x": (0.1, 2.0, {"step": 0.4}), "y": (0.1, 2.0, {})}
    found = ask(least_sum(pose, {"column": "product", **limits}, box=box))
    assert found.best == pytest.approx([0.8, 0.625], abs=1e-5)
    assert found.after[1] >= 0.5 * (1 - 1e-6)


def test_the_front_of_two_parabolas(pose):
    # (x - 1/2)² and (x - 1)², both least at y = 1: the front is ½ ≤ x ≤ 1, and there √a + √b = ½
    found = ask(
        pose(
            XY,
            ["a", "b"],
            lambda d: [1 + (d[0] - 0.5) ** 2 + (d[1] - 1) ** 2, 1 + (d[0] - 1) ** 2 + (d[1] - 1) ** 2],
            objective=[{"column": "a"}, {"column": "b"}],
            search={"front": 3},
        )
    )
    assert found.best == pytest.approx([0.75, 1.0], abs=1e-2)
    assert len(found.front) >= 5
    roots = np.sqrt(found.front_values[:, 0] - 1) + np.sqrt(found.front_values[:, 1] - 1)
    assert roots == pytest.approx(0.5, abs=0.02)


def test_worst_case_margins_are_those_of_the_slopes(pose):
    # x y ≥ 1/2 for x off by 0.02 and a factor, not free, off by 0.01: (x - 0.02) y (1 - 0.01) = 1/2 to first order
    tolerance = [{"name": "x", "tolerance": 0.02}, {"name": "factor", "tolerance": 0.01}]
    asked = {"tolerance": tolerance, "margin": {"kind": "worst-case"}}
    found = ask(least_sum(pose, product=lambda d: d[0] * d[1] * d[2], **asked))
    x, y, _ = found.best
    assert x * y - 0.02 * y - 0.01 * x * y == pytest.approx(0.5, abs=1e-4)
    (spread,) = [one for one in found.spreads if one.column == "product"]
    assert spread.low == pytest.approx((x - 0.02) * y * 0.99, rel=1e-6)
    assert spread.low == pytest.approx(0.5, abs=2e-3)


def test_the_nearest_mode_is_kept_off_on_the_side_where_it_is(pose):
    # two modes cross the followed one at x = 0.8 and 1.2; between them no more than 0.2 is possible, beyond them more
    columns = ["separation_n2_Hz", "separation_n2_of_n0_0_Hz", "separation_n2_of_n1_0_Hz", "x"]

    def modes(d):
        each = [d[0] - 0.8, d[0] - 1.2]
        return [min(each, key=abs), *each, d[0]]

    found = ask(
        pose(
            {"x": (0.1, 2.0, {"start": 1.0})},
            columns,
            modes,
            objective=[{"column": "x"}],
            constraint=[{"column": "separation_n2_Hz", "low": 0.3}],
        )
    )
    assert found.best[0] == pytest.approx(0.1, abs=1e-6) or found.best[0] == pytest.approx(1.5, abs=1e-4)
    assert abs(found.after[0]) >= 0.3 - 1e-6


def test_an_objective_that_changes_in_steps_has_no_gradient(pose):
    with pytest.raises(InputError, match=r"'n' changes in steps \(0, 1\), so that no gradient"):
        ask(pose(XY, ["n"], lambda d: [float(d[0] > 1)], objective=[{"column": "n"}]))


@pytest.mark.slow
def test_limits_that_contradict_are_named_with_what_lacks(pose):
    posed = least_sum(pose, {"column": "product", "low": 1.0}, {"column": "sum", "high": 1.5})
    with pytest.raises(
        InputError, match=r"no design found meets all constraints.*product = .* below its limit 1; sum = "
    ):
        ask(posed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_no_random_design_is_better(pose, seed):
    rng = np.random.default_rng(seed)
    A, b, c = rng.normal(size=(4, 4)), rng.normal(size=4), rng.normal(size=4)

    def columns(d):
        x = np.array(d)
        return [float(np.sum(np.sin(A @ x)) + x @ x / 4), float(b @ x + np.cos(c @ x))]

    box = {f"p{k}": (-1.0, 1.0, {}) for k in range(4)}
    draws = np.array([columns(row) for row in rng.uniform(-1, 1, (4000, 4))])
    limit = float(np.median(draws[:, 1]))
    wanted = {"objective": [{"column": "f"}], "constraint": [{"column": "g", "high": limit}]}
    posed = pose(box, ["f", "g"], columns, **wanted)
    found = ask(posed)
    assert found.after[1] <= limit + 1e-6
    assert found.after[0] <= draws[draws[:, 1] <= limit, 0].min() + 1e-6
    assert found.evaluations < 400


def smallest(pose, *limits, **posed):
    """The answer to the smallest x from 0.1 on within limits."""
    constraint = [{"column": "x", **limit} for limit in limits]
    box = {"x": (0.1, 2.0, {"start": 1.0})}
    return ask(pose(box, ["x"], lambda d: [d[0]], objective=[{"column": "x"}], constraint=constraint, **posed))


def test_the_share_within_limits_is_that_of_the_tolerances_as_they_are_distributed(pose):
    # an even ± 0.02 whose worst case touches a limit never passes it; a normal one passes it and, 2.6 of its sd away, the other
    def share(margin, **tolerance):
        posed = {"tolerance": [{"name": "x", **tolerance}], "margin": margin}
        (spread,) = smallest(pose, {"low": 0.5}, {"high": 0.55}, **posed).spreads
        return spread.passed

    assert share({"kind": "worst-case"}, tolerance=0.02) == 1.0
    normal = share({"kind": "probability", "share": 0.958}, standard_deviation=0.02 / 3**0.5)
    assert normal == pytest.approx(0.958 - norm.sf(0.03 * 3**0.5 / 0.02), abs=3e-3)


def test_a_margin_with_a_probability_goes_no_farther_than_an_even_tolerance(pose):
    posed = {"tolerance": [{"name": "x", "tolerance": 0.02}], "margin": {"kind": "probability", "share": 0.99}}
    assert smallest(pose, {"low": 0.5}, **posed).best[0] == pytest.approx(0.52, abs=1e-6)
