"""`hrg compare`: figures equal those of the other commands, differing keys are named, bad calls refused."""

import pytest

from studies.cli import main
from studies.instrument.card import load_card


def test_figures_are_those_of_the_other_commands(tmp_path, ask):
    card = tmp_path / "thin.toml"
    card.write_text(
        'schema = "hrg.card/1"\nname = "thin"\n[resonator]\nshape = "hemisphere"\nradius_mm = 15.0\nthickness_mm = 0.8\n'
        '[material]\nname = "fused-silica"\n'
    )
    other = tmp_path / "said.toml"  # with a default that it states
    other.write_text(card.read_text().replace("[material]", 'support = "free"\n[material]'))
    assert not ask(["compare", str(card), str(other)])["differing"]
    assert ask(["compare", "hrg-30mm", str(card)])["differing"]["resonator.support"] == ["stem", "free"]
    found = ask(["compare", "free-dome", str(card)])
    assert (found["schema"], found["cards"]) == ("hrg.compare/1", ["free-dome", "thin"])
    assert found["differing"] == {"resonator.thickness_mm": [0.9, 0.8]}
    figures = {one["name"]: one for one in found["figures"]}
    for place, name in enumerate(("free-dome", str(card))):
        (mode,) = ask(["modes", name])["modes"]
        frequency = figures["frequency, n = 2"]
        assert frequency["values"][place] == pytest.approx(mode["frequency_Hz"], rel=1e-9)
        assert frequency["uncertainties"][place] == pytest.approx(mode["material_uncertainty_Hz"], rel=1e-3)
        point = ask(["tcf", name, "--from", "20", "--to", "20"])["points"][0]
        assert figures["slope"]["values"][place] == pytest.approx(point["slope_ppm_per_degC"], rel=1e-4)


def test_settings_are_those_of_the_simulation(tmp_path, ask, capsys):
    """Contract: what differs is what a simulation reads, `Instrument.keys`, stated with a deviation, without one, or by default."""
    bare = tmp_path / "bare.toml"
    bare.write_text(
        'schema = "hrg.card/1"\nname = "bare"\n[resonator]\nshape = "hemisphere"\nradius_mm = 15.0\nthickness_mm = 0.8\n'
        '[material]\nname = "fused-silica"\n'
    )
    spread = tmp_path / "spread.toml"
    spread.write_text(
        bare.read_text() + "[thermal]\nmount_conductance_W_per_K = { value = 0.05, sd = 0.01 }\nnote = 'of the foot'\n"
        "[loss]\ninverse_q = { value = 1e-7, low = 0.5e-7, high = 2e-7 }\n[[effect]]\nname = 'rate-bias'\ncoefficient_deg_per_h_per_K_per_s = 2.0\n"
    )
    found = ask(["compare", str(bare), str(spread)])
    default = load_card(bare).thermal.mount_conductance_W_per_K
    assert found["differing"]["thermal.mount_conductance_W_per_K"] == [default, 0.05]
    assert found["stated"]["thermal.mount_conductance_W_per_K"] == [None, {"sd": 0.01}]
    assert found["differing"]["loss.inverse_q"] == [1e-7, 1e-7]
    assert found["stated"]["loss.inverse_q"][1].items() >= {"low": 0.5e-7, "high": 2e-7}.items()
    assert found["differing"]["effect.0.coefficient_deg_per_h_per_K_per_s"] == [None, 2.0]
    assert {name.split(".")[0] for name in found["differing"]} == {"thermal", "loss", "effect"}
    assert "thermal.note" not in found["differing"]
    profile = tmp_path / "profile.toml"
    profile.write_text(bare.read_text().replace("0.8", "[[0, 0.8], [1, { value = 0.8, sd = 0.01 }]]"))
    found = ask(["compare", str(bare), str(profile)])
    assert found["differing"] == {"resonator.thickness_mm": [0.8, [[0, 0.8], [1, {"value": 0.8, "sd": 0.01}]]]}
    main(["compare", str(bare), str(spread)])
    shown = capsys.readouterr().out
    assert f"{default} (default)" in shown
    assert "0.05 ± 0.01" in shown


def test_nearest_mode_lies_behind_many_lower_ones():
    """Planted: five modes of n = 1 below the drive mode, the fifth nearest."""
    from types import SimpleNamespace

    from shell.modes import nearest_mode

    spectrum = {0: (9000.0,), 1: (100.0, 200.0, 300.0, 400.0, 4990.0, 6000.0), 2: (5000.0, 7000.0)}
    modes = {
        n: [SimpleNamespace(harmonic=n, index=k, frequency=f) for k, f in enumerate(one)] for n, one in spectrum.items()
    }
    found = nearest_mode(lambda n, count: modes[n][:count], modes[2][0], range(3), least=1)
    assert (found.harmonic, found.index) == (1, 4)
