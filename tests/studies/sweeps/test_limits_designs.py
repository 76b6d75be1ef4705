"""Designs: exact counts, stratification, moments of the distributions, Saltelli's columns, same seed same design."""

import numpy as np
import pytest
from scipy import stats

from studies.errors import InputError
from studies.sweeps.design import draw, hash_designs
from studies.sweeps.spec import read_study


def design(method, *parameters, **sampling):
    quantity = [{"name": "frequency", "theory": "shell"}]
    spec = {
        "card": "hrg-30mm",
        "sampling": {"method": method, **sampling},
        "parameter": list(parameters),
        "quantity": quantity,
    }
    study = read_study(spec)
    return study, draw(study)


A = {"name": "user.a", "low": 0.0, "high": 1.0}
B = {"name": "user.b", "low": 10.0, "high": 20.0}


def test_grid_takes_every_combination():
    _, found = design("grid", {"name": "user.a", "values": [1, 2, 3]}, {**B, "count": 5})
    assert found.shape == (15, 2)
    assert len(np.unique(found, axis=0)) == 15
    assert set(found[:, 1]) == set(np.linspace(10, 20, 5))


def test_list_keeps_rows():
    _, found = design("list", {"name": "user.a", "values": [1, 2, 1]}, {"name": "user.b", "values": [5, 6, 5]})
    assert found.tolist() == [[1, 5], [2, 6], [1, 5]]


def test_lists_of_unequal_length_are_refused():
    with pytest.raises(InputError, match="equally many"):
        design("list", {"name": "user.a", "values": [1, 2]}, {"name": "user.b", "values": [5]})


def test_latin_hypercube_has_one_point_in_every_stratum():
    _, found = design("latin-hypercube", A, B, cases=100, seed=3)
    assert sorted(np.floor(100 * found[:, 0]).astype(int)) == list(range(100))
    assert sorted(np.floor(10 * (found[:, 1] - 10)).astype(int)) == list(range(100))


def test_same_seed_same_design_another_seed_another():
    one, again, other = (hash_designs(design("sobol", A, B, cases=16, seed=seed)[1]) for seed in (1, 1, 2))
    assert one == again != other


@pytest.mark.parametrize(
    ("keys", "law"),
    [
        ({"low": 2.0, "high": 5.0}, stats.uniform(2, 3)),
        ({"low": 1.0, "high": 100.0, "distribution": "log-uniform"}, stats.loguniform(1, 100)),
        ({"low": 0.0, "high": 4.0, "nominal": 1.0, "distribution": "triangular"}, stats.triang(0.25, 0, 4)),
        ({"nominal": 3.0, "distribution": "normal", "standard_deviation": 0.5}, stats.norm(3, 0.5)),
        (
            {"nominal": 3.0, "tolerance": 0.5, "distribution": "normal", "standard_deviation": 0.5},
            stats.truncnorm(-1, 1, 3, 0.5),
        ),
    ],
)
def test_samples_follow_their_distribution(keys, law):
    study, found = design("sobol", {"name": "user.a", **keys}, cases=4096, seed=5)
    quantiles = law.cdf(found[:, 0])
    # points of a Sobol sequence lie within 1/N of the uniform law
    assert np.abs(np.sort(quantiles) - (np.arange(4096) + 0.5) / 4096).max() < 1 / 4096
    if "standard_deviation" in keys:  # what the page says is drawn
        assert study.parameters[0].drawn_deviation == pytest.approx(law.std(), rel=1e-9)
        assert np.std(found[:, 0]) == pytest.approx(law.std(), rel=2e-3)


def test_saltelli_mixes_one_column_at_a_time():
    _, found = design("sensitivity", A, B, cases=8, seed=1)
    assert len(found) == 8 * 4
    first, second, mixed_a, mixed_b = found.reshape(4, 8, 2)
    assert np.array_equal(mixed_a, np.column_stack([second[:, 0], first[:, 1]]))
    assert np.array_equal(mixed_b, np.column_stack([first[:, 0], second[:, 1]]))


def test_one_at_a_time_moves_one_parameter_through_five_levels():
    _, found = design("one-at-a-time", A, {**B, "nominal": 12.0})
    assert len(found) == 9
    assert found[0].tolist() == [0.5, 12.0]
    assert found[5:, 1].tolist() == [10.0, 11.0, 16.0, 20.0]
    assert (found[5:, 0] == 0.5).all()


def test_a_grid_beyond_all_measure_is_refused():
    with pytest.raises(InputError, match="fewer"):
        design("grid", {**A, "count": 100_000}, {**B, "count": 100_000})
