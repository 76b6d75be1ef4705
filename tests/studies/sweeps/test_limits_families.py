"""Studies through families: every design within its stated error of the full solve, alone or among others."""

from dataclasses import replace

import numpy as np
import pytest

from studies.errors import InputError
from studies.instrument.card import shipped_cards
from studies.sweeps.block import Batch
from studies.sweeps.design import draw
from studies.sweeps.evaluate import WorkPlan, evaluate_case, evaluate_task
from studies.sweeps.families import Families, choose_solver
from studies.sweeps.run import estimate_study, run_study
from studies.sweeps.spec import read_study

CARD = """schema = "hrg.card/1"
name = "free-dome"
[resonator]
shape = "hemisphere"
radius_mm = 15.0
thickness_mm = 0.9
[material]
name = "fused-silica"
"""


@pytest.fixture(scope="module")
def spec(tmp_path_factory):
    card = tmp_path_factory.mktemp("card") / "free.toml"
    card.write_text(CARD)
    return {
        "card": str(card),
        "sampling": {"method": "latin-hypercube", "cases": 300, "seed": 3},
        "parameter": [
            {"name": "resonator.thickness_mm", "low": 0.85, "high": 0.95},
            {"name": "resonator.radius_mm", "low": 14.5, "high": 15.5},
            {"name": "temperature_degC", "low": -40, "high": 60},
        ],
        "quantity": [
            {"name": "frequency", "theory": "shell"},
            {"name": "tcf", "theory": "shell"},
            {"name": "bryan-factor", "theory": "shell"},
        ],
    }


@pytest.fixture(scope="module")
def results(spec):
    return run_study(spec)


@pytest.fixture(scope="module")
def through(results):
    """The plan of the same study through families, and its designs."""
    design = draw(results.study)
    return WorkPlan.of(results.study, choose_solver(results.study, design)), design.values


@pytest.mark.slow
def test_designs_lie_within_their_stated_error_of_the_full_solve(results):
    plan = WorkPlan.of(results.study)
    assert results.about["identity"]["solver"] != "full"
    for place in (0, 100, 299):
        full = evaluate_case(plan, results.design(place))
        allowed = results.errors[place, 0] + full.errors[0]
        assert abs(results.values[place, 0] - full.values[0]) < allowed
        assert allowed < 2e-5 * full.values[0]
        for k in range(1, 7):
            allowed = results.errors[place, k] + full.errors[k] + 1e-10
            assert abs(results.values[place, k] - full.values[k]) <= allowed < 0.02
        assert abs(results.values[place, 7] - full.values[7]) < results.errors[place, 7] + 2e-5
        assert results.errors[place, 7] < 2e-5


@pytest.mark.slow
def test_a_design_is_the_same_alone_and_among_others(spec, results):
    design = draw(results.study)
    plan = WorkPlan.of(results.study, choose_solver(results.study, design))
    (alone,) = evaluate_task(plan, [Batch(np.array([7]), design[7:8])])
    assert alone.values.tobytes() == results.values[7].tobytes()
    smaller = run_study({**spec, "sampling": {**spec["sampling"], "batch": 7}})
    assert smaller.values.tobytes() == results.values.tobytes()


@pytest.mark.slow
def test_a_design_that_cannot_be_computed_fails_alone(results):
    design = draw(results.study)
    plan = WorkPlan.of(results.study, choose_solver(results.study, design))
    designs = design[:5].copy()
    designs[1, results.study.names.index("resonator.thickness_mm")] = 2.0
    (found,) = evaluate_task(plan, [Batch(np.arange(5), designs)])
    assert [(remark.status, list(remark.rows)) for remark in found.remarks] == [("failed", [1])]
    assert np.isfinite(found.values).all(axis=1).tolist() == [True, False, True, True, True]


def test_materials_between_nodes_are_those_of_every_design(spec):
    """Density, shear modulus and temperature drawn at random: as with a material for each design, inside the ranges and outside."""
    material = [
        {"name": "material.density_kg_m3", "low": 2190.0, "high": 2215.0},
        {"name": "material.deviation.shear_modulus.log_value", "low": -0.01, "high": 0.01},
        {"name": "temperature_degC", "low": 0.0, "high": 40.0},
    ]
    study = read_study({**spec, "sampling": {**spec["sampling"], "cases": 3000}, "parameter": material}, None)
    design = draw(study)
    families = choose_solver(study, design)
    assert families.nodes is not None
    some = design[:90].copy()
    some[5, 0] = 2230.0
    columns = dict(zip(study.names, some.T, strict=True))
    found, exact = (one.evaluate(columns, len(some))[0] for one in (families, replace(families, nodes=None)))
    np.testing.assert_allclose(found, exact, rtol=1e-11, atol=1e-8)  # what rounding leaves of slopes (ppm/°C)
    assert found[5].tobytes() == exact[5].tobytes()
    few = read_study({**spec, "parameter": material}, None)
    assert choose_solver(few, draw(few)).nodes is None


def vary(card):
    """Return a study of a shipped card: wall or shell thickness, where it may the radius, and temperature."""
    radius = [{"name": "resonator.radius_mm", "tolerance": 0.002}] if card in ("free-dome", "hrg-30mm") else []
    return {
        "card": card,
        "sampling": {"method": "latin-hypercube", "cases": 64, "seed": 4},
        "parameter": [
            {"name": "resonator.thickness_mm", "tolerance": 0.002},
            *radius,
            {"name": "temperature_degC", "low": -20, "high": 50},
        ],
        "quantity": [{"name": "frequency"}],
    }


@pytest.mark.slow
@pytest.mark.parametrize("card", sorted(shipped_cards()))
def test_every_shipped_card_has_a_family(card):
    results = run_study(vary(card))
    assert results.about["identity"]["solver"] != "full"
    plan = WorkPlan.of(results.study)
    for place in (3, 40):
        full = evaluate_case(plan, results.design(place))
        assert abs(results.values[place, 0] - full.values[0]) < results.errors[place, 0] + full.errors[0]
        assert results.errors[place, 0] < 5e-5 * full.values[0]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"quantity": [{"name": "mode-separation"}]}, "separation_n2"),
        (
            {
                "parameter": [{"name": "thermal.cells", "low": 8, "high": 24}],
                "quantity": [{"name": "thermal-time-constants"}],
            },
            "time_constant",
        ),
        ({"quantity": [{"name": "frequency", "theory": "rayleigh"}]}, "solid or shell"),
    ],
)
def test_where_families_do_not_go_auto_solves_in_full_and_family_is_refused(spec, change, reason):
    changed = {**spec, **change}
    study = read_study(changed)
    assert choose_solver(study, draw(study)) is None
    study = read_study({**changed, "sampling": {**spec["sampling"], "solver": "family"}})
    with pytest.raises(InputError, match=f"cannot be used: .*{reason}"):
        choose_solver(study, draw(study))


def test_dry_run_knows_the_solver(spec):
    estimate = estimate_study(read_study(spec))
    assert (estimate.solver, estimate.cases) == ("family", 300)
    assert estimate.seconds_each < 0.01


def test_dry_run_says_why_every_design_would_fail():
    parameter = {"name": "resonator.radius_mm", "values": [15.0]}
    spec = {
        "schema": "hrg.study/1",
        "name": "x",
        "card": "free-dome",
        "sampling": {"method": "grid"},
        "parameter": [parameter],
    }
    assert estimate_study(read_study({**spec, "quantity": [{"name": "mass"}]})).nominal_fails == ""
    estimate = estimate_study(read_study({**spec, "quantity": [{"name": "mass"}, {"name": "loads"}]}))
    assert estimate.nominal_fails.startswith("loads: a free resonator")


def test_running_again_resumes_and_computes_nothing(spec, results, tmp_path, monkeypatch):
    """The ranges of a family belong to the identity of a study, and are the same when they are read back."""
    run_study(spec, tmp_path)
    monkeypatch.setattr(Families, "evaluate", lambda *_: pytest.fail("a design was computed again"))
    again = run_study(spec, tmp_path)
    assert (again.values == results.values).all()
