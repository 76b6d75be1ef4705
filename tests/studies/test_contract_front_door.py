"""The names that packages offer from Python: each is there, imported only when used, and does what the command does."""

import datetime
import importlib
import inspect
import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import compensation
import compensation.derivation
import shell
import shell.derivation
import studies
import studies.papers
import studies.public
import thermal
from studies.cli import main
from studies.errors import UNUSABLE_INPUT
from studies.files.columns import read_columns
from studies.record import TABLE_COLUMNS, read_record

PACKAGES = {
    "shell": shell,
    "thermal": thermal,
    "compensation": compensation,
    "studies": studies,
    "shell.derivation": shell.derivation,
    "compensation.derivation": compensation.derivation,
}


@pytest.mark.parametrize("package", PACKAGES)
def test_every_name_is_there_and_listed(package):
    module = PACKAGES[package]
    assert 5 < len(module.__all__) < 25
    for name in module.__all__:
        one = getattr(module, name)
        assert one.__name__ == name
        assert name.endswith("Error") or "numpy._typing" not in str(inspect.signature(one))  # as `help` shows ArrayLike
    assert set(module.__all__) <= set(dir(module))


def test_packages_import_nothing_heavy():
    code = f"import {', '.join(PACKAGES)}, sys; print([m for m in ('numpy', 'scipy', 'sympy', 'pyvista', 'matplotlib') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_simulate_is_the_command(tmp_path):
    record = studies.simulate("hrg-30mm", "step 20 -10 1h", row=10, seed=3)
    assert (
        main(["simulate", "hrg-30mm", "step 20 -10 1h", "--row", "10", "--seed", "3", "--out", str(tmp_path / "r.csv")])
        == 0
    )
    for name, values in read_record(tmp_path / "r.csv").columns.items():
        assert np.array_equal(values, record[name])


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    """A record as people have it: an object, a path of two kinds, a table of pandas; and a model of its frequency."""
    folder = tmp_path_factory.mktemp("given")
    record = studies.simulate("free-dome", "step 20 -10 1h", row=10, seed=3)
    studies.write_record(record, path := folder / "r.csv")
    table = str(Path(studies.papers.__file__).parent / "hrg_table1.csv")
    assert main(["fit", "frequency", table, "--save", str(folder / "model.toml")]) == 0
    return (record, path, str(path), record.to_frame()), folder / "model.toml"


def commands(model, monkeypatch):
    """What every command from Python takes of a record."""
    importlib.import_module("studies.diagnosis.table")  # which takes the true one
    monkeypatch.setattr("studies.calibration.calibrate.calibrate", lambda card, records, *_, **__: records[0])
    monkeypatch.setattr("studies.workbench.diagnose_records", lambda records, card: records[0])
    return {
        "read_record": studies.read_record,
        "simulate": lambda run: studies.simulate("free-dome", run, noise=False),
        "calibrate": lambda run: studies.calibrate(studies.load_card("free-dome"), run),
        "diagnose": lambda run: studies.diagnose(run, card="free-dome"),
        "compensate": lambda run: studies.compensate(model, run, extrapolate=True),
    }


@pytest.mark.parametrize("name", ["read_record", "simulate", "calibrate", "diagnose", "compensate"])
def test_contract_every_command_takes_a_record_by_path_and_object(name, given, monkeypatch):
    runs, model = given
    command = commands(model, monkeypatch)[name]
    first, *others = [command(run) for run in runs]
    for other in others:
        assert list(other.columns) == list(first.columns)
        assert all(np.array_equal(other[column], first[column]) for column in first.columns)
    for wrong in (
        3,
        None,
        {"time_s": [0.0]},
        runs[3].assign(bias_deg_per_h="x"),
        runs[3].assign(own=1.0),
        runs[3][::-1],
    ):
        with pytest.raises(studies.InputError):
            command(wrong)


def test_contract_records_come_back_from_a_table_with_all_that_they_say(given):
    (record, path, _, _), _ = given
    moment = datetime.datetime(2026, 1, 31, tzinfo=datetime.UTC)
    dated = replace(record, start=moment, resolution={"frequency_Hz": 1e-3}, comments=("kept",))
    assert studies.read_record(dated.to_frame()).notes == dated.notes
    assert studies.read_record(studies.read_record(path).to_frame()).path == str(path)


@pytest.mark.parametrize(
    "wrong", [{"row": 0}, {"row": -1.0}, {"row": np.nan}, {"row": "10"}, {"seed": -1}, {"seed": 1.5}]
)
def test_contract_numbers_of_a_run_are_refused_by_name(wrong):
    (name,) = wrong
    with pytest.raises(studies.InputError, match=f"^{name} = "):
        studies.simulate("free-dome", "soak 20 1h", **wrong)


def test_contract_what_is_no_file_card_or_run_is_refused_with_words(given):
    of_cards = (studies.load_card, studies.compare, studies.law_of, studies.reference_split, studies.loss_model)
    for command in (*of_cards, studies.read_model, studies.emit_c, studies.run_study):
        with pytest.raises(studies.InputError, match="3: give a path or a name, not int"):
            command(3)
    for write in (studies.save_card, studies.write_model, studies.write_record):
        with pytest.raises(studies.InputError, match="3: give a path"):
            write(3, "never.toml")
    for fit in (compensation.fit_bias, lambda runs: compensation.fit_cross_damping(runs, k=1.0, zeta=1.0)):
        with pytest.raises(compensation.CompensationError, match="hrg fit"):
            fit("cooling.csv")
    card = studies.load_card("free-dome")
    assert studies.load_card(card) is card
    assert studies.law_of("free-dome").frequency(293.15) == studies.law_of(card).frequency(293.15)
    model = studies.read_model(given[1])
    assert studies.emit_c(model) == studies.emit_c(str(given[1]))


def public_calls():
    """Every public name that is called, but errors, with how many arguments it needs."""
    names = [(name, getattr(studies.public, name)) for name in dir(studies.public)]
    calls = [(name, one) for name, one in names if callable(one) and not name.endswith("Error")]
    for name, one in calls:
        kinds = [p for p in inspect.signature(one).parameters.values() if p.default is p.empty]
        more = [p.name for p in kinds if p.kind is p.KEYWORD_ONLY]
        yield name, one, sum(p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD) for p in kinds), more


@pytest.mark.parametrize("wrong", ["x", None, object(), {"a": 1}], ids=lambda one: type(one).__name__)
@pytest.mark.parametrize(
    ("name", "call", "count", "more"), list(public_calls()), ids=lambda one: one if isinstance(one, str) else ""
)
def test_contract_a_wrong_first_argument_of_any_public_name_is_told(
    name, call, count, more, wrong, tmp_path, monkeypatch
):
    """`hrg.find_split("x")` ended in an AttributeError. Plain tables of data (nodes, modes) keep what they are given."""
    monkeypatch.chdir(tmp_path)
    try:
        made = call(wrong, *[1.0] * (count - 1), **dict.fromkeys(more, 1.0))
    except UNUSABLE_INPUT as error:
        made = str(error)
    sentence = isinstance(made, str) and len(made.split()) > 4
    assert sentence or (inspect.isclass(call) and isinstance(made, call))


def test_a_public_name_is_pickled_and_keeps_its_signature():
    assert pickle.loads(pickle.dumps(studies.public.find_split)) is studies.public.find_split
    assert inspect.signature(studies.public.simulate) == inspect.signature(studies.simulate)


def test_records_show_themselves_shortly_and_as_tables_and_pictures():
    record = studies.simulate(studies.load_card("free-dome"), "step 20 -10 1h", row=10)
    assert repr(record) == (
        "Record(free-dome, 361 rows over 1 h: time_s, chamber_temperature_degC, housing_temperature_degC,"
        " resonator_temperature_degC, frequency_Hz, bias_deg_per_h, inverse_q)"
    )
    frame = record.to_frame()
    assert frame.shape == (361, 7)
    assert frame.attrs["instrument"] == "free-dome"
    assert len(record.plot().axes) == 6
    assert "<table" in record._repr_html_()


@pytest.mark.slow
def test_results_show_themselves_shortly_and_as_tables(tmp_path):
    table = str(Path(studies.papers.__file__).parent / "hrg_table1.csv")
    comparison = studies.compare(["free-dome", "hrg-30mm"])
    readings = read_columns(table, TABLE_COLUMNS).values  # of pandas, as of a path
    calibration = studies.calibrate("hrg-30mm", pd.DataFrame(readings))
    spec = {"schema": "hrg.study/1", "name": "s", "card": "free-dome", "sampling": {"method": "grid"}}
    spec |= {
        "parameter": [{"name": "resonator.radius_mm", "values": [15.0]}],
        "quantity": [{"name": "frequency", "theory": "shell"}],
    }
    study = studies.run_study(spec, out=tmp_path / "s", workers=1)
    again = studies.run_study(spec, card=studies.load_card("free-dome"))
    assert again.table().equals(study.table())
    shown = (
        (comparison, "Comparison(free-dome, hrg-30mm:"),
        (calibration, "Calibration(hrg-30mm: "),
        (studies.diagnose(pd.DataFrame(readings)), "TableDiagnosis(not-identifiable: "),
        (study, "Results(s: 1 of 1 cases, 0 failed)"),
    )
    for one, begins in shown:
        assert repr(one).startswith(begins)
        assert len(repr(one)) < 400
        assert len(one.to_frame()) > 0
        assert "<table" in one._repr_html_()
    for one in (calibration, shown[2][0], study):
        assert one.plot().axes
    (mode,) = shell.solve_modes(shell.hemisphere(radius=15e-3, thickness=0.9e-3), shell.Elastic(72.7e9, 0.17, 2203.0))
    assert repr(mode).startswith("Mode(n = 2, ")
    assert len(repr(mode)) < 120
    assert len(mode.plot().axes) == 1
    assert comparison.to_frame().loc["frequency, n = 2", "hrg-30mm"] == pytest.approx(4432.09, abs=0.1)


def test_a_module_that_is_no_name_is_still_a_module():
    assert importlib.import_module("shell.modes").solve_modes is shell.solve_modes
    with pytest.raises(AttributeError):
        _ = shell.no_such_name
