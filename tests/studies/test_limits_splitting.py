"""A card's imperfection and electrodes: they add, they reach modes and studies, and what is wrong in them is named."""

import pickle
import re
from dataclasses import replace

import numpy as np
import pytest

from shell.imperfection.surface import turn_surface
from shell.modes import solve_modes
from studies.cli import main
from studies.errors import InputError
from studies.instrument.card import load_card, save_card
from studies.reports.scenes import show_mode
from studies.resonator.splitting import SplitPair, mean_shift
from studies.simulation.drive import drive_by_profile
from studies.simulation.loop import wave_of
from studies.simulation.prediction import predict
from studies.sweeps.case import Case
from studies.sweeps.quantities.split import Split
from thermal.profile import Profile

CARD = """
schema = "hrg.card/1"
name = "imperfect"
reference_temperature_degC = 20.0
[resonator]
shape = "hemisphere"
radius_mm = 15.0
thickness_mm = 0.9
[material]
name = "mine"
youngs_modulus_GPa = 72.7
poisson_ratio = 0.17
density_kg_m3 = 2203.0
"""
WALL = """
[[imperfection.wave]]
of = "wall"
order = 4
amplitude_um = { value = 0.3, sd = 0.1 }
azimuth_deg = 31.0
"""
MASS = """
[[imperfection.mass]]
mass_ug = 5.0
azimuth_deg = 12.0
"""
SPLIT = """
[imperfection.split]
split_Hz = 0.1
slow_axis_deg = 70.0
"""
HEAT = """
[thermal]
heat_capacity_J_per_kg_K = 740.0
conductivity_W_per_m_K = 1.4
"""
ELECTRODES = """
[electrodes]
gap_um = 100.0
coverage = 1.0
first = 0.0
voltage_V = 100.0
[[electrodes.gap_wave]]
order = 4
amplitude_percent = 1.0
azimuth_deg = 5.0
"""


def test_voltages_that_are_rounding_alone_are_not_listed(tmp_path, capsys):
    """A split by 60 V on one of 16 electrodes is nulled by 30 V on the four at 45° to it; the others have less than a millivolt."""
    path = tmp_path / "card.toml"
    ring = 'shape = "cylinder"\nradius_mm = 12.5\nthickness_mm = 0.3\nheight_mm = 1.0\n'
    gap = "gap_um = 100.0\nfirst = 0.0\nvoltage_V = 50.0\nazimuth_deg = 3.0\ntrim_V = [0.0, 60.0]\n"
    path.write_text(
        f'schema = "hrg.card/1"\nname = "x"\n[resonator]\n{ring}[material]\nname = "fused-silica"\n[electrodes]\n{gap}'
    )
    assert main(["electrodes", str(path)]) == 0
    rows = re.findall(r"│ +(\d+) │ +([\d.]+) │ +([\d.]+) │", capsys.readouterr().out)
    assert rows == [("4", "70.50", "30"), ("8", "160.50", "30"), ("12", "250.50", "30"), ("16", "340.50", "30")]


def loaded(tmp_path, *tables):
    path = tmp_path / "card.toml"
    path.write_text(CARD + "".join(tables), encoding="utf-8")
    return load_card(path)


def split_of(instrument):
    resonator, elastic = instrument.at(instrument.reference_temperature)
    (mode,) = solve_modes(resonator, elastic, 2)
    return SplitPair(instrument, mode, instrument.reference_temperature)


def test_each_table_splits_as_published(tmp_path):
    wall = split_of(loaded(tmp_path, WALL)).split
    assert wall.relative == pytest.approx(0.36902 * 0.3 / 900, rel=2e-4)
    assert np.rad2deg(wall.slow_axis) == pytest.approx(31.0, abs=1e-9)  # the thick place is slow
    mass = split_of(loaded(tmp_path, MASS)).split
    assert mass.relative == pytest.approx(5e-3 * (1077.2 - 232.77) * 1e-6, rel=1e-4)
    assert np.rad2deg(mass.slow_axis) == pytest.approx(12.0, abs=1e-9)
    read = split_of(loaded(tmp_path, SPLIT)).split
    assert read.hertz == pytest.approx(0.1, rel=1e-12)
    assert np.rad2deg(read.slow_axis) == pytest.approx(70.0, abs=1e-9)
    charged = split_of(loaded(tmp_path, ELECTRODES)).split
    assert charged.shift < -1e-5
    assert charged.relative == pytest.approx(-0.03 * charged.shift, rel=1e-3)
    assert np.rad2deg(charged.slow_axis) == pytest.approx(5.0 + 45.0, abs=0.01)  # the narrow gap is soft


def test_parts_add_in_the_square_of_the_frequency(tmp_path):
    wall, mass, both, *others = (
        split_of(loaded(tmp_path, *tables)).split
        for tables in ((WALL,), (MASS,), (WALL, MASS), (SPLIT,), (ELECTRODES,))
    )
    assert both.wave == pytest.approx(wall.wave + mass.wave, rel=1e-9)  # to first order as waves
    assert both.shift == pytest.approx(wall.shift + mass.shift, rel=1e-9)
    whole = split_of(loaded(tmp_path, WALL, MASS, SPLIT, ELECTRODES))
    mean, z = map(sum, zip(*(s.squares for s in (both, *others)), strict=True))
    assert whole.split.squares == (pytest.approx(mean, rel=1e-9), pytest.approx(z, rel=1e-9))
    assert whole.of_every_order().hertz == pytest.approx(whole.split.hertz, rel=2e-4)


def test_a_plain_card_is_perfect_and_uncertain_numbers_are_listed(tmp_path):
    assert not loaded(tmp_path).is_imperfect
    assert not [one for one in loaded(tmp_path).uncertain if one.name.startswith(("imperfection", "electrodes"))]
    names = {one.name: one.sd for one in loaded(tmp_path, WALL, ELECTRODES).uncertain}
    assert names["imperfection.wave.0.amplitude_um"] == 0.1
    assert names["electrodes.gap_um"] == 5.0


def test_studies_vary_a_wave_and_ask_for_the_split(tmp_path):
    instrument = loaded(tmp_path, WALL)
    quantity = Split(theory="shell")
    found = [
        quantity.evaluate(Case(instrument.with_values({"imperfection.wave.0.amplitude_um": a}), {}))[0].value
        for a in (0.3, 0.6)
    ]
    assert found[1] == pytest.approx(2 * found[0], rel=1e-9)
    assert [column.name for column in quantity.columns] == ["split_n2_Hz", "slow_axis_n2_deg"]


def test_a_map_beside_the_card_is_read(tmp_path):
    angles = np.arange(0, 360, 10)
    rows = ["position," + ",".join(str(a) for a in angles)]
    rows += [
        f"{x:.3f}," + ",".join(f"{0.3 * np.cos(4 * np.deg2rad(a - 31)):.6f}" for a in angles)
        for x in np.linspace(0, 1, 12)
    ]
    (tmp_path / "wall.csv").write_text("\n".join(rows))
    instrument = loaded(tmp_path, '[[imperfection.map]]\nof = "wall"\nfile = "wall.csv"\n')
    assert split_of(instrument).split.relative == pytest.approx(0.36902 * 0.3 / 900, rel=1e-3)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ('[[imperfection.wave]]\norder = 4\namplitude_ppm = 3\n', "amplitude_um"),
        ('[[imperfection.wave]]\norder = 4\namplitude_um = 3000\n', "it is in µm"),
        ('[[imperfection.wave]]\nof = "radius"\norder = 4\namplitude_um = 3\n', "offset"),
        ('[[imperfection.map]]\nof = "wall"\nfile = "none.csv"\n', "there is no such file"),
        ("[electrodes]\ngap_um = -3\n", "gap_um"),
        ("[electrodes]\ncount = 2\ntrim_V = [1, 2, 3]\n", "3 voltages for 2 electrodes"),
        ("[electrodes]\nfirst = 0.9\nlast = 0.8\n", "first must be below last"),
    ],
)  # fmt: skip
def test_wrong_tables_are_refused(tmp_path, table, words):
    with pytest.raises(InputError, match=words):
        loaded(tmp_path, table)


def test_waves_through_the_wall_are_refused_and_large_ones_are_doubted(tmp_path, capsys):
    with pytest.raises(InputError, match="1000 µm where the wall has 900 µm"):
        _ = split_of(loaded(tmp_path, WALL.replace("0.3, sd = 0.1", "1000.0, sd = 0.1"))).split
    loaded(tmp_path, WALL.replace("0.3, sd = 0.1", "800.0, sd = 0.1"))
    assert main(["modes", str(tmp_path / "card.toml")]) == 0
    assert "differ by more than 10 % for n = 2" in capsys.readouterr().out
    for wall in (
        WALL,
        WALL.replace("order = 4", "order = 0"),
    ):  # of a wall that is thicker all round, both are rounding
        loaded(tmp_path, wall)
        assert main(["modes", str(tmp_path / "card.toml")]) == 0
        assert "differ by" not in capsys.readouterr().out


def test_even_voltages_make_no_split_and_rounding_is_not_trimmed(tmp_path, capsys):
    loaded(tmp_path, "[electrodes]\ngap_um = 100.0\ncount = 16\nvoltage_V = 100.0\n")
    assert main(["electrodes", str(tmp_path / "card.toml")]) == 0
    out = capsys.readouterr().out
    assert re.search(r"split by the card's voltages *│ *none", out)
    assert "Trim voltages" not in out


def test_springs_on_a_thin_ring_soften_it_by_the_root(tmp_path, ask):
    """A negative spring κ m ω² on a thin ring, of modal mass 5/8 of its own at n = 2, lowers f to f √(1 − κ): in every command."""
    path = tmp_path / "card.toml"
    ring = 'shape = "cylinder"\nradius_mm = 20.0\nthickness_mm = 0.4\nheight_mm = 2.0\n'
    given = "youngs_modulus_GPa = 70.0\npoisson_ratio = 0.0\ndensity_kg_m3 = 2500.0\n"
    gap = "gap_um = 50.0\nfirst = 0.0\nvoltage_V = 300.0\n"
    path.write_text(
        f'schema = "hrg.card/1"\nname = "x"\n[resonator]\n{ring}[material]\nname = "mine"\n{given}[electrodes]\n{gap}'
    )
    E, rho, h, r, length = 70e9, 2500.0, 0.4e-3, 20e-3, 2e-3
    omega = np.sqrt(36 / 5 * E * h**2 / (12 * rho)) / r**2
    spring = 8.8541878e-12 * 300.0**2 / 50e-6**3 * 0.8 * np.pi * (r - h / 2) * length
    kappa = spring / (0.625 * 2 * np.pi * r * h * length * rho) / omega**2
    assert kappa > 0.2
    lowered = pytest.approx(np.sqrt(1 - kappa) - 1, rel=4e-4)
    assert 1e-6 * ask(["electrodes", str(path)])["softening_ppm"] == lowered
    (mode,) = ask(["modes", str(path)])["modes"]
    assert 1e-6 * mode["split"]["shift_ppm"] == lowered
    assert mode["split"]["slow_Hz"] / mode["frequency_Hz"] - 1 == lowered
    card = load_card(path)
    for volts, gap in ((300.0, 1.0), (200.0, 1.0), (200.0, 0.9)):
        warm = card.with_values({"electrodes.gap_expansion_per_K": (gap - 1) / 10})
        found = mean_shift(warm, np.array([303.15]), np.array([volts**2]))
        assert found == pytest.approx(np.sqrt(1 - kappa * (volts / 300.0) ** 2 / gap**3) - 1, rel=4e-4)
    with pytest.raises(InputError, match="the commanded voltage pulls in the shell"):
        mean_shift(card, np.array([293.15]), np.array([700.0**2]))


def test_commands_refuse_a_voltage_beyond_pull_in_and_a_map_with_holes(tmp_path, refuse):
    loaded(tmp_path, "[electrodes]\ngap_um = 10.0\nvoltage_V = 2000.0\n")
    for command in ("electrodes", "modes"):
        assert "Lower the voltage or widen the gap" in refuse([command, str(tmp_path / "card.toml")])
    angles = range(0, 360, 10)
    rows = [f"{x:.2f}," + "," * 14 + ",".join("0.1" for _ in angles[14:]) for x in np.linspace(0, 1, 12)]
    (tmp_path / "wall.csv").write_text("position," + ",".join(str(a) for a in angles) + "\n" + "\n".join(rows))
    (tmp_path / "card.toml").write_text(CARD + '[[imperfection.map]]\nof = "wall"\nfile = "wall.csv"\n')
    assert "gaps between the points are too large" in refuse(["modes", str(tmp_path / "card.toml")])


def test_a_simulated_run_is_softened_by_the_volts_and_the_gap(tmp_path):
    """f √(1 + m), m that of the card's volts times V²/V₀² (g₀/g)³ with the gap's own expansion, against a run of the perfect card."""
    gap = "[electrodes]\ngap_um = 100.0\nvoltage_V = 100.0\ngap_expansion_per_K = 1e-3\n"
    instrument = loaded(tmp_path, HEAT, gap)
    mean, _ = split_of(instrument).electrodes.squares

    def shift(factor):
        return np.sqrt(1 + mean * factor) - 1

    T = np.array([instrument.reference_temperature, instrument.reference_temperature + 10.0])
    assert mean_shift(instrument, T) == pytest.approx([shift(1), shift(1.01**-3)], rel=1e-9)
    assert mean_shift(instrument, T, np.array([4e4, 1e4])) == pytest.approx([shift(4), shift(1.01**-3)], rel=1e-9)
    perfect = loaded(tmp_path, HEAT)
    rows = np.linspace(0.0, 3600.0, 5)
    drive = replace(
        drive_by_profile(Profile(rows, np.full(5, 293.15)), rows),
        commands={"voltage_squared": np.array([1, 1, 4, 4, 0]) * 1e4},
    )
    ratio = predict(instrument, drive).columns["frequency_Hz"] / predict(perfect, drive).columns["frequency_Hz"]
    assert ratio - 1 == pytest.approx([shift(1), shift(1), shift(4), shift(4), 0.0], rel=1e-4, abs=1e-10)


def test_the_loop_holds_the_cards_split(tmp_path):
    loop = "[loop]\nfrequency_split_mHz = 0.0\n"
    instrument = loaded(tmp_path, WALL, loop)
    wave = wave_of(instrument, 4599.7, 1e-7, 0.277)
    split = split_of(instrument).split
    assert wave.frequency_split == pytest.approx(2 * np.pi * split.hertz, rel=1e-9)
    assert wave.frequency_axis % (np.pi / 2) == pytest.approx(split.fast_axis, rel=1e-9)


def test_the_drawn_shell_departs_where_the_card_says_and_its_mode_lies_on_the_slow_axis(tmp_path):
    instrument = loaded(tmp_path, WALL.replace('"wall"', '"outer"'))
    true, shown, perfect = (
        show_mode(instrument, theory="shell", exaggerated=False),
        show_mode(instrument, theory="shell"),
        show_mode(loaded(tmp_path), theory="shell"),
    )
    plain = turn_surface(perfect.surface, true.split.slow_axis).points
    out = np.linalg.norm(true.surface.points, axis=1) - np.linalg.norm(plain, axis=1)
    outer = np.linalg.norm(plain, axis=1) > 15.4e-3
    theta = np.arctan2(plain[:, 1], plain[:, 0])
    expected = 0.3e-6 * np.cos(4 * (theta - np.deg2rad(31.0)))
    away = outer & (np.hypot(plain[:, 0], plain[:, 1]) > 1e-3)
    assert out[away] == pytest.approx(expected[away], abs=2e-10)
    assert np.abs(out[~outer]).max() < 0.31e-6
    assert shown.exaggeration > 100
    dots = shown.surface.points[shown.surface.antinodes]
    slow = np.arctan2(dots[:, 1], dots[:, 0]) % (np.pi / 2)
    assert slow == pytest.approx(np.full(4, shown.split.slow_axis), abs=1e-6)
    assert shown.scene().axes.shape == (4, 2, 3)
    assert perfect.scene().axes.shape == (0, 2, 3)


def test_the_mesh_departs_where_the_card_says(tmp_path):
    def nodes(name):
        assert main(["mesh", str(tmp_path / "card.toml"), "--out", str(tmp_path / name), "--around", "24"]) == 0
        text = (tmp_path / name).read_text().split("*NODE")[1].split("\n", 1)[1].split("*")[0]
        return np.array([[float(cell) for cell in line.split(",")[1:]] for line in text.strip().splitlines()])

    loaded(tmp_path, WALL.replace('"wall"', '"outer"'), MASS)
    true = nodes("imperfect.inp")
    loaded(tmp_path)
    perfect = nodes("perfect.inp")
    radius = np.linalg.norm(perfect, axis=1)
    off = np.linalg.norm(true, axis=1) - radius
    theta = np.arctan2(perfect[:, 1], perfect[:, 0])
    share = (radius - 14.55e-3) / 0.9e-3  # from the inner face, which stays, to the outer one
    away = np.hypot(perfect[:, 0], perfect[:, 1]) > 1e-6
    assert off[away] == pytest.approx((share * 0.3e-6 * np.cos(4 * (theta - np.deg2rad(31.0))))[away], abs=1e-11)


def test_an_imperfect_card_travels_to_workers(tmp_path):
    instrument = loaded(tmp_path, WALL + "power = 2.0\n", ELECTRODES)
    assert split_of(pickle.loads(pickle.dumps(instrument))).split.wave == split_of(instrument).split.wave


def test_electrodes_null_the_cards_split_and_say_how_far_they_reach(tmp_path, ask, refuse):
    loaded(tmp_path, "[imperfection.split]\nsplit_Hz = 0.005\nslow_axis_deg = 70.0\n", "[electrodes]\ngap_um = 50.0\n")
    found = ask(["electrodes", str(tmp_path / "card.toml")])
    assert found["schema"] == "hrg.electrodes/1"
    assert found["pull_in_factor"] is None  # no voltage yet
    assert found["reach_Hz"] > 0.005
    assert found["trim"]["left_Hz"] < 1e-9
    volts = ", ".join(f"{v:.9g}" for v in found["trim"]["voltages_V"])
    mended = loaded(
        tmp_path,
        "[imperfection.split]\nsplit_Hz = 0.005\nslow_axis_deg = 70.0\n",
        f"[electrodes]\ngap_um = 50.0\ntrim_V = [{volts}]\n",
    )
    assert split_of(mended).split.hertz < 1e-8
    assert "Hz along any), not 50 Hz" in refuse(
        ["electrodes", str(tmp_path / "card.toml"), "--split", "50", "--axis", "3"]
    )
    loaded(
        tmp_path,
        "[electrodes]\ngap_um = 80.0\ncount = 8\nvoltage_V = 150.0\ntrim_V = [0.0, 60.0, 0.0, 60.0, 0.0, 60.0, 0.0, 60.0]\n",
    )
    one_axis = ask(["electrodes", str(tmp_path / "card.toml")])  # it said that 100 V cannot
    assert one_axis["reach_Hz"] == 0.0
    assert one_axis["trim"]["voltages_V"][::2] == pytest.approx([60.0] * 4, abs=1e-3)
    loaded(tmp_path)
    assert "no table [electrodes]" in refuse(["electrodes", str(tmp_path / "card.toml")])


def test_a_saved_card_takes_its_maps_along(tmp_path):
    (tmp_path / "wall.csv").write_text(
        "position," + ",".join(str(a) for a in range(0, 360, 30)) + "\n" + "0.5" + ",0.1" * 12 + "\n"
    )
    instrument = loaded(tmp_path, '[[imperfection.map]]\nof = "wall"\nfile = "wall.csv"\n')
    (tmp_path / "deeper").mkdir()
    save_card(instrument, tmp_path / "deeper" / "card.toml")
    assert load_card(tmp_path / "deeper" / "card.toml").is_imperfect


def test_an_acceleration_across_even_electrodes_makes_no_bias():
    """A wave of order 1 in the gap makes the wave 4 of the springs only beside one of order 3 or 5, and then in proportion to it."""
    from studies.resonator.loads import bias_by_tilt, loads_of

    card = load_card("hrg-30mm-loops")
    T, electrodes = card.reference_temperature, {"gap_um": 50.0, "count": 16, "voltage_V": 100.0}
    loads = loads_of(card, T)
    assert bias_by_tilt(card, loads, T) is None

    def found(percent):
        waves = [{"order": 3, "amplitude_percent": percent, "azimuth_deg": 5.0}]
        charged = card.with_table("electrodes", {**electrodes, "gap_wave": waves})
        return bias_by_tilt(charged, loads, T)

    none, one, two = (found(percent).deg_per_h_per_g for percent in (0.0, 0.5, 1.0))
    assert none < 1e-6 * one
    assert two == pytest.approx(2 * one, rel=1e-3)
