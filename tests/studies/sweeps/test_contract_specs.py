"""Contract of study specs: every mistake is named with its place and the nearest known word."""

import copy

import pytest

from studies.errors import InputError
from studies.sweeps.run import run_study
from studies.sweeps.spec import read_study, shipped_specs
from studies.sweeps.validity import find_invalid

GOOD = {
    "card": "hrg-30mm",
    "sampling": {"method": "sobol", "cases": 8},
    "parameter": [
        {"name": "resonator.thickness_mm", "tolerance": 0.005},
        {"name": "resonator.radius_mm", "low": 14.9, "high": 15.1},
    ],
    "quantity": [{"name": "frequency", "theory": "shell"}],
}


def changed(path, value):
    spec = copy.deepcopy(GOOD)
    *way, last = path
    place = spec
    for step in way:
        place = place[step]
    if value is None:
        del place[last]
    else:
        place[last] = value
    return spec


def test_good_spec_is_read():
    study = read_study(GOOD)
    nominal = study.instrument.content["resonator"]["thickness_mm"]
    assert study.parameters[0].low == pytest.approx(nominal - 0.005)
    assert [column.name for column in study.columns] == ["frequency_n2_Hz"]
    assert study.parameters[0].unit == "mm"


@pytest.mark.parametrize("name", sorted(shipped_specs()))
def test_shipped_specs_are_read(name):
    assert read_study(name).asked


@pytest.mark.parametrize(
    ("path", "value", "parts"),
    [
        (("sampling", "method"), "sobbol", ("sobol",)),
        (("sampling", "cases"), 100, ("power of two", "64 or 128")),
        (("sampling", "cases"), None, ("cases",)),
        (("parameter", 0, "name"), "resonator.thicknes_mm", ("resonator.thickness_mm",)),
        (("parameter", 0, "name"), "resonator.stem", ("resonator.stem.radius_mm",)),
        (("parameter", 0, "name"), "material.name", ("values",)),
        (("parameter", 0, "name"), "resonator.radius_mm", ("twice",)),
        (("parameter", 0, "distribution"), "gauss", ("distribution",)),
        (("parameter", 0, "standard_deviation"), 0.1, ("normal",)),
        (("parameter", 0, "low"), 0.1, ("not both",)),
        (("parameter", 1, "low"), 15.2, ("below high",)),
        (("parameter", 1, "low"), 15.05, ("nominal", "outside")),
        (("parameter", 1, "count"), 5, ("grid",)),
        (("parameter", 1), {"name": "resonator.radius_mm", "values": [15.0]}, ("grid", "list")),
        (("parameter", 1), {"name": "thermal.stem_length_mm"}, ("nominal",)),
        (("parameter", 1), {"name": "temperature_degC", "low": -300, "high": 20}, ("outside the range",)),
        (("quantity", 0, "name"), "frequencies", ("frequency",)),
        (("quantity", 0, "temperature_degC"), 2000, ("outside the range",)),
        (("quantity",), [], ("at least one",)),
        (("quantity",), [{"name": "frequency"}, {"name": "frequency", "theory": "shell"}], ("label", "twice")),
        (("quantity",), [{"name": "compensation-residual", "points": 4}], ("points",)),
        (("quantity",), [{"name": "python", "function": "nonsense"}], ("file.py:name",)),
        (("requirement",), [{"column": "frequency_n3_Hz", "within": 1}], ("frequency_n2_Hz",)),
        (("requirement",), [{"column": "frequency_n2_Hz"}], ("within",)),
        (("requirement",), [{"column": "frequency_n2_Hz", "within": 1, "low": 2}], ("within",)),
        (("search",), [{"kind": "best"}], ("kind",)),
        (("search",), [{"kind": "worst-case", "column": "f"}], ("'f'",)),
        (("card",), "hrg-30m", ("hrg-30mm",)),
        (("schema",), "hrg.study/2", ("hrg.study/1",)),
    ],
)
def test_mistakes_are_named(path, value, parts):
    with pytest.raises(InputError) as caught:
        read_study(changed(path, value))
    assert all(part in str(caught.value) for part in parts), str(caught.value)
    assert len(str(caught.value)) < 700


def test_ends_and_corners_that_cannot_be_built_are_named_and_do_not_refuse_the_study():
    spec = changed(("parameter", 0), {"name": "resonator.thickness_mm", "low": 0.8, "high": 1.6})
    (problem, *_) = find_invalid(read_study(spec))
    assert "resonator.thickness_mm = 1.6" in problem
    assert "solid" in problem
    spec["quantity"][0]["theory"] = "solid"
    assert not find_invalid(read_study(spec))
    (problem, *_) = find_invalid(read_study(changed(("parameter", 0, "tolerance"), 2.0)))
    assert "resonator.thickness_mm = -" in problem
    assert "not valid" in problem


STEM = {
    "schema": "hrg.study/1", "name": "stem", "card": "hrg-30mm", "sampling": {"method": "grid", "solver": "full"},
    "parameter": [{"name": "resonator.radius_mm", "values": [14.9, 15.0, 15.2]}],
    "derived": [{"name": "resonator.stem.end_mm", "expression": "-(radius_mm - 10)"}],
    "quantity": [{"name": "frequency", "theory": "shell"}],
}  # fmt: skip


def test_a_derived_key_follows_its_parameters():
    """Beside the same designs with both keys written out."""
    written = {
        **STEM,
        "sampling": {"method": "list", "solver": "full"},
        "parameter": [
            {"name": "resonator.radius_mm", "values": [14.9, 15.0, 15.2]},
            {"name": "resonator.stem.end_mm", "values": [-4.9, -5.0, -5.2]},
        ],
    }
    del written["derived"]
    one, two = (run_study(spec, workers=1).table()["frequency_n2_Hz"].to_numpy() for spec in (STEM, written))
    assert one == pytest.approx(two, rel=1e-12)


def test_a_corner_that_cannot_be_built_is_a_failed_case():
    spec = {
        **STEM,
        "derived": [{"name": "resonator.stem.end_mm", "expression": "radius_mm - 5 - (radius_mm - 15) * 60"}],
    }
    spec["derived"][0]["expression"] = "-5 + (radius_mm - 15) * 200"
    table = run_study(spec, workers=1).table()
    assert table["status"].tolist() == ["ok", "ok", "failed"]


@pytest.mark.parametrize(
    ("expression", "part"),
    [
        ("__import__('os').system('true')", "may contain only numbers"),
        ("radius_mm if 1 else 2", "may contain only numbers"),
        ("radius_mm +", "is not a formula"),
        ("radius_m + 4", "neither a parameter nor a key"),
        ("(radius_mm - 15) ** 0.5 / 0", "cannot be computed"),
        ("9 ** 9 ** 9", "the exponent"),
        ("x" * 600, "longer than 500"),
        ("material.name + 1", "no usable number"),
    ],
)
def test_formulas_are_arithmetic_and_nothing_else(expression, part):
    with pytest.raises(InputError, match=part.replace("(", r"\(")):
        read_study({**STEM, "derived": [{"name": "resonator.stem.end_mm", "expression": expression}]})
    with pytest.raises(InputError, match="both"):
        read_study({**STEM, "derived": [{"name": "resonator.radius_mm", "expression": "15"}]})
