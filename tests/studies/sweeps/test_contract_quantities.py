"""Contract of every quantity: options with defaults, unique columns with units, finite values, a place in the help."""

import math
from pathlib import Path

import pytest

from studies.cli import study as cli
from studies.files.toml import TomlTable
from studies.instrument.card import load_card
from studies.sweeps.case import Case
from studies.sweeps.quantities import library
from studies.sweeps.quantity import SUFFIXES

COMPUTED = sorted(name for name in library() if name != "python")


def options_of(name, **given):
    section = TomlTable(given, "test", tuple(library()[name].options))
    return {key: option.read(section, key) for key, option in library()[name].options.items()}


@pytest.fixture(scope="module")
def case():
    return Case(load_card("hrg-30mm"), {})


@pytest.mark.parametrize("name", COMPUTED)
def test_values_fill_the_columns_and_are_finite(name, case):
    quantity = library()[name]
    given = {"theory": "shell"} if "theory" in quantity.options else {}
    options = options_of(name, **given)
    columns, numbers = quantity.columns(options), quantity.evaluate(case, options)
    assert len(columns) == len(numbers) == len({column.name for column in columns})
    assert all(math.isfinite(number.value) for number in numbers)
    assert all(not number.error < 0 for number in numbers)
    assert all(column.unit in SUFFIXES and column.label for column in columns)


@pytest.mark.parametrize("name", sorted(library()))
def test_quantity_is_described_and_documented(name):
    quantity = library()[name]
    assert quantity.summary.endswith(".")
    assert all(option.meaning for option in quantity.options.values())
    assert name in (cli.run.__doc__ or ""), "add it to the help of hrg study run"
    file = Path(__file__).parents[3] / "studies" / "sweeps" / "quantities" / f"{name.replace('-', '_')}.py"
    assert file.is_file()


def test_tcf_parts_add_up(case):
    numbers = library()["tcf"].evaluate(case, options_of("tcf", theory="shell"))
    assert numbers[0].value == pytest.approx(sum(number.value for number in numbers[1:]), abs=1e-9)


def test_quantities_of_one_case_share_their_solves(case):
    from shell import modes

    case = Case(load_card("hrg-30mm"), {})
    options = options_of("frequency", theory="shell")
    library()["frequency"].evaluate(case, options)
    solve, modes.solve_modes = modes.solve_modes, None  # a second solve would now fail
    try:
        library()["bryan-factor"].evaluate(case, options_of("bryan-factor", theory="shell"))
    finally:
        modes.solve_modes = solve
