"""Contract of every quantity: options with defaults, unique columns with units, finite values, a place in the help."""

import math
from pathlib import Path

import pytest

from studies.cli import study as cli
from studies.instrument.card import load_card
from studies.schema.reader import read_keys
from studies.schema.reference import list_keys
from studies.sweeps.case import Case
from studies.sweeps.quantities import library
from studies.sweeps.quantity import SUFFIXES

COMPUTED = sorted(name for name in library() if name != "python")


def asked(name, **given):
    return read_keys({"name": name, **given}, library()[name], "test")


@pytest.fixture(scope="module")
def case():
    return Case(load_card("hrg-30mm-loops"), {})  # which has all that a quantity may ask for


@pytest.mark.parametrize("name", COMPUTED)
def test_values_fill_the_columns_and_are_finite(name, case):
    given = {"theory": "shell"} if "theory" in library()[name].__struct_fields__ else {}
    quantity = asked(name, **given)
    columns, numbers = quantity.columns, quantity.evaluate(case)
    assert len(columns) == len(numbers) == len({column.name for column in columns})
    assert all(math.isfinite(number.value) for number in numbers)
    assert all(not number.error < 0 for number in numbers)
    assert all(column.unit in SUFFIXES and column.label for column in columns)


@pytest.mark.parametrize("name", sorted(library()))
def test_quantity_is_described_and_documented(name):
    quantity = library()[name]
    assert quantity.__doc__.endswith(".")
    assert all(row["meaning"] for row in list_keys(quantity))
    assert name in (cli.run.__doc__ or ""), "add it to the help of hrg study run"
    file = Path(__file__).parents[3] / "studies" / "sweeps" / "quantities" / f"{name.replace('-', '_')}.py"
    assert file.is_file()


def test_tcf_parts_add_up(case):
    numbers = asked("tcf", theory="shell").evaluate(case)
    assert numbers[0].value == pytest.approx(sum(number.value for number in numbers[1:]), abs=1e-9)


def test_quantities_of_one_case_share_their_solves(case):
    from shell import modes

    case = Case(load_card("hrg-30mm"), {})
    asked("frequency", theory="shell").evaluate(case)
    solve, modes.solve_modes = modes.solve_modes, None  # a second solve would now fail
    try:
        asked("bryan-factor", theory="shell").evaluate(case)
    finally:
        modes.solve_modes = solve


def test_the_error_of_a_closed_slope_is_what_it_lacks_of_shell_theory():
    dome = Case(load_card("free-dome"), {})
    closed, bent = (asked("tcf", theory=theory).evaluate(dome)[0] for theory in ("rayleigh", "shell"))
    assert closed.error == pytest.approx(abs(closed.value - bent.value))
    assert closed.error < 10.0
