"""Command lines that cannot be worked: one plain message that names the mend, status 2, nothing on stdout and no file."""

import importlib
import inspect
import math
import shlex

import pytest

from studies.cli import COMMANDS, main
from studies.instrument.card import shipped_cards

WITH_A_CARD = (
    "loss TYPO", "loop TYPO", "cards TYPO", "modes TYPO", "materials --compare --card TYPO", "compare free-dome TYPO", "tcf TYPO",
    "thermal TYPO 'soak 20 1h'", "simulate TYPO 'soak 20 1h' --out out", "render TYPO --out out.ply", "mesh TYPO --out out.msh",
    "study run STUDY --out out --card TYPO", "diagnose RUN --card TYPO", "diagnose --plan 'step 20 -10 5h' --card TYPO",
    "fit thermal RUN --card TYPO", "fit whole-angle RUN --card TYPO", "fit ringdown RUN --card TYPO", "acceptance TYPO RUN",
    "calibrate TYPO RUN", "electrodes TYPO", "scan TYPO RUN", "trim TYPO --split 0.1 --axis 10", "twin TYPO --c out",
    "fleet LOT --out out --card TYPO", "loads TYPO",
)  # fmt: skip
"""Every command that takes a card reads the whole of it, whatever table it needs."""
STUDY = """schema = "hrg.study/1"
name = "s"
card = "hrg-30mm"
sampling = { method = "grid" }
parameter = [{ name = "resonator.radius_mm", values = [15.0] }]
quantity = [{ name = "frequency", theory = "shell" }]
"""
DESIGN = """schema = "hrg.design/1"
card = "free-dome"
parameter = [{{ name = "resonator.thickness_mm", low = 0.8, high = 1.0 }}]
objective = [{{ column = "{column}" }}]
constraint = [{{ column = "frequency_n2_Hz", low = {low}, high = 5000.0 }}]
"""
DESIGNS = {"near": {"column": "sep"}, "far": {"column": "qqqqqq"}, "crossed": {"low": 6000.0}}
REFUSED = {
    "optimise NEAR --out out": "[[objective]] number 1: column = 'sep' is unknown; did you mean 'separation_n0_Hz'?",
    "optimise FAR --out out": " more.",
    "optimise CROSSED --out out": "[[constraint]] number 1: low must be below high for 'frequency_n2_Hz', not 6000 and 5000.",
    **dict.fromkeys(WITH_A_CARD, "[loss]: unknown key 'invers_q'; did you mean 'inverse_q'"),
    "nonsense": "nonsense",
    "cards none.toml --debug": "Traceback",  # only where it is asked for
    "compare free-dome": "two cards or more",
    "compare free-dome no-such": "no-such",
    "derive --bell --code c": "leave out --code",
    "derive --bell --dynamics": "choose one",
    "derive --code fortran": "fortran",
    "derive --dynamics --harmonic 3": "--dynamics holds for any harmonic",
    "derive --harmonic 1": "harmonic",
    "derive --harmonic 12 --rim-angle-deg 0.001": "hrg: ",
    "derive --latex --code c": "--code",
    "derive --pole-angle-deg 95": "hrg: ",
    "derive --rim-angle-deg 179.99999": "hrg: ",
    "derive --rim-angle-deg 180": "hrg: ",
    "derive --rim-angle-deg 1e-9": "hrg: ",
    "diagnose --plan 'soak 20 2h' --card nobody": "nobody",
    "effects histeresis": "hysteresis",
    "fit ringdown none.csv": "there is no such file",
    "acceptance hrg-30mm none.csv": "there is no such file",
    "acceptance hrg-30mm RUN --output banana": "--output banana: no record has this column; known: ",
    "fit frequency HRG --order 7": "order",
    "fit frequency none.csv": "no such file",
    "fit frequency ROW": "'time' has 1 row;",
    "diagnose ROW": "is needed, with two values or more",
    "diagnose RUN --plan 'soak 20 1h'": "run.csv: this is a record of a run; --plan takes profiles",
    "diagnose HRG --plan 'soak 20 1h'": "hrg_table1.csv: this is a steady-state table; --plan takes profiles",
    "fit bias RUN --average 100 --window 50": "--window 50: the rate is taken over three averages of 100 s",
    "simulate hrg-30mm RUN --out x.csv --start 30h": "run.csv: --start of 108000 s is longer than the record, 3900 s",
    "scan free-dome RUN": "run.csv: is a record of a run, with time_s; points must be",
    "diagnose --plan RUN": "run.csv: this is a record of a run; --plan takes profiles",
    "calibrate hrg-30mm": "DATA is missing",
    "calibrate hrg-30mm ROW": "has 1 of the 10 rows",
    "calibrate hrg-30mm RUN --hold-out 3": "there is 1 record, numbered from 1",
    "diagnose RUN --chamber 'rate 1 range 85 -40'": "the lower one first",
    "fit bias RUN --average -5": "--average -5: must be positive",
    "fit cross-damping RUN --frequency 4.432 --quality 1e4": "--frequency 4.432: frequency_Hz of the records is 4432 Hz (median)",
    "fit cross-damping RUN --order 50": "--order 50: must be 1 to 9",
    "fit cross-damping RUN --quality 1e4 --calibration-temperature -300": "no gyro has this temperature",
    "fit frequency HRG --resolution 0": "--resolution 0: must be positive",
    "fit frequency HRG --reference-temperature -300": "a reference temperature of -300 °C is impossible",
    "thermal hrg-30mm 'soak 20 1h' --rows 100000000": "must be 2 to 10000",
    "fit frequency HRG --order 0": "--order 0: must be 1 to 9",
    "fit scale RUN --no-filter --cutoff 2": "--no-filter: --cutoff and --order are of the filter",
    "twin free-dome --fmu twin.txt": "--fmu twin.txt: the ending must be one of .fmu",
    "fit scale RUN --order 0": "--order 0: must be at least 1",
    "show UNITS": "units.csv, line 2: a line of units, as it seems: take it out",
    "loss free-dome --anchor": "hrg: --anchor: the anchor loss is what a stem sends into its base, and free-dome has no stem",
    "thermal hrg-30mm 'soak 20'": "has 1 value after 'soak'",
    "loads hrg-30mm --pressure -5": "--pressure -5: must be 0 or above",
    "fit thermal": "DATA is missing. See 'hrg fit thermal --help'.",
    "fit thermal HRG --confidence 90": "--confidence 90",
    "keys card --table los": "did you mean 'loss'",
    "keys crad": "did you mean 'card'",
    "loads free-dome": "held against no load",
    "loads hrg-30mm --along 0 --across 0": "no load is given",
    "loads hrg-30mm --harmonic 1": "n = 2 and above",
    "loop free-dome": "To change it, copy it: hrg card new MY.toml --like free-dome.",
    "loop hrg-30mm-loops --hours -1 --out run.csv": "--hours -1: must be positive",
    "loop hrg-30mm-loops --hours 1e9 --out run.csv": "more than",
    "loop hrg-30mm-loops --hours 2": "--hours: only for a simulated run; add --out",
    "loop hrg-30mm-loops --hours 2 --profile 'soak 20 1h' --out run.csv": "leave out --hours or --profile",
    "loop hrg-30mm-loops --hours inf --out run.csv": "--hours",
    "loop hrg-30mm-loops --profile 'soak 20 1h'": "--profile: only for a simulated run",
    "loop hrg-30mm-loops --row 10 --noiseless": "--row, --noiseless: only for a simulated run",
    "loop hrg-30mm-loops --seed 3": "--seed: only for a simulated run",
    "twin free-dome --c folder --fmi 2.0": "--fmi 2.0: the version of an FMU; add --fmu FILE.fmu",
    "loop hrg-30mm-loops --seed -1 --out run.csv": "--seed",
    "loss free-dome --from -100 --to 20": "outside the range",
    "loss free-dome --from 30 --to 20": "hrg: ",
    "materials fused-silca": "fused-silica",
    "materials silica": "did you mean 'fused-silica'?",  # a word that a name has as a part
    "materials silicone": "did you mean 'silicon'?",
    "mesh hrg-30mm --out solid.inp --complete": "--complete",
    "mesh hrg-30mm --out solid.msh --layers 99": "--layers 99: must be 1 to 16",
    "mesh hrg-30mm --out solid.msh --around 3": "--around 3: must be 8 to 720",
    "mesh hrg-30mm --out solid.msh --spacing-mm -1": "--spacing-mm -1: must be positive",
    "mesh free-dome --out solid.msh --spacing-mm 1e-4": "--spacing-mm 0.0001: must be at least 0.01178, of this",
    "fleet nowhere --out out": "nowhere: there is no such folder",
    "fleet file --out out": "file: is a file; give the folder",
    "scan free-dome none FEW": "20 points are too few for the split of n = 4; ",
    "scan free-dome none FEW --highest 2 --harmonic 1": "20 points are too few for the split of n = 1; ",
    "simulate free-dome 'staircase 20 -10 7 30min' --out run.csv": "'staircase 20 -10 7 30min': steps of 7 K do not lead from 20 to -10 °C; take steps of 6 or 7.5 K.",
    "mesh hrg-30mm --out solid.stl": ".msh",
    "modes free-dome 3": "too many arguments",
    "modes hrg-30mm --count 0": "count",
    "render --out mode.png": "a card is missing",
    "render free-dom --out mode.png": "did you mean 'free-dome'",
    "render free-dome --colour rainbow --out mode.ply": "rainbow",
    "render free-dome --colour temperature --out mode.ply": "--field",
    "render free-dome --swing-mm 1 --view axis --out mode.html": "--swing-mm, --view: without effect on mode.html",
    "render free-dome --colour energy --out mode.stl": "--colour: without effect on mode.stl",
    "render free-dome --field RUN --out mode.ply": "--field: without effect",
    "render free-dome --harmonic 2 3 --out mode.png": "only in an .html page",
    "render free-dome --index -1 --out mode.stl": "--index -1: must be 0 or above",
    "render free-dome --out mode": "the ending",
    "render free-dome --out mode.bmp": "the ending must be one of .png",
    "render free-dome --temperature 1 2 3 4 5 --out mode.png": "4 at most",
    "render free-dome --temperature 900 --theory shell --out mode.stl": "outside the range",
    "render free-dome cvg-25mm --out mode.stl": "1 at most",
    "reproduce --out file/sub": "cannot be written",
    "scan free-dome none": "no face given",
    "scan free-dome none none.asc": "there is no such file",
    "simulate hrg-30 'soak 20 1h' --out x.csv": "did you mean 'hrg-30mm'",
    "simulate hrg-30mm 'soak 20 1h' --out x.csv --row -1": "--row -1: must be positive",
    "simulate hrg-30mm 'soak 20 1h' --out x.csv --seed -1": "--seed",
    "simulate hrg-30mm 'step 20 -90 5h' --out x.csv": "reaches -90 °C",
    "simulate hrg-30mm 'stepp 20 -10 5h' --out x.csv": "'stepp' is not a kind of profile",
    "study run STUDY --out file/out": "there is no folder",
    "study run STUDY": "--out",
    "study status .": "no study",
    "tcf": "CARD is missing",
    "tcf hrg-30m": "hrg-30mm",
    "tcf hrg-30mm --from -300 --theory shell": "outside the range",
    "loop hrg-30mm-loops --temperature 300": "300 °C is outside the range of fused-silica, law 'spinner' (-60 to 150 °C)",
    "loads hrg-30mm --rotation 1e14": "a relative shift of f of 4.11e+15; the theory is linear",
    "loads hrg-30mm --across 1e8": "MPa; the theory is linear and does not hold from 7.26e+03 MPa up",
    "simulate free-dome 'soak 20 1h' --out run.csv --row 1e-300": "make 3.6e+297 million rows",
    "simulate free-dome 'soak 20 1h' --out run.csv --row 1e-308": "make inf million rows",
    "tcf hrg-30mm --step 0": "step",
    "tcf none.toml": "no such file",
    "thermal hrg-30mm 'soak 20 1h' --rows 1": "--rows 1",
    "thermal hrg-30mm nothere.csv": "there is no such file",
    "thermal hrg-30mm step 20 -10 5h": '"step 20 -10 5h"',
    "trim free-dome --split 0.05 --axis 10 --goal inf": "--goal",
    "electrodes hrg-30mm-loops --split -1 --axis 3": "--split -1: must be positive",
    "fit whole-angle run.csv --bryan-factor 7": "--bryan-factor 7: must be between 0 and 1",
    "scan free-dome inner.asc --save card.html": "--save card.html: a card or a model is a TOML file; give a name that ends in .toml",
    "trim free-dome --split 0.05 --axis 10 --teeth 1000000000": "hrg: ",
    f"trim free-dome --split 0.05 --axis 10 --unbalance 1:{'9' * 400}@35": "hrg: ",
    "trim free-dome --split 0.05 --axis 10 --width-mm 1e-308": "hrg: ",
    "trim free-dome --split 0.05 --axis 10 --width-mm 1e308": "hrg: ",
    "trim free-dome --split 0.05 --axis nan": "--axis nan: must be a finite number",
    "trim free-dome --split 0.1": "--axis is missing: give one for each --split",
    "trim free-dome --split 0.1 --axis 3 --cut edge --position 0.9": "lies at position 1",
    "trim free-dome --split 0.1 --axis 3 --unbalance 4:3@2": "write k:µg@degrees",
    "trim free-dome --split 0.5 --axis 3 --cut edge": "no depth of these cuts",  # it relieves what its mass does
    "trim free-dome --split 1e-4 --axis 3": "measure more accurately before cutting",
    "trim free-dome --split 500 --axis 3": "deeper than allowed",
    "twin free-dome": "--fmu",
    **{
        f"{words} {number}": "must be a finite number"
        for number in ("inf", "nan", "-1e308", "1e16")
        for words in (
            "loads free-dome --rotation",
            "tcf free-dome --step",
            "loop hrg-30mm-loops --rate",
            "simulate free-dome 'step 20 -10 5h' --out run.csv --row",
        )
    },
}


SLOW = (
    "trim free-dome --split 0.5 --axis 3 --cut edge",
    "derive --harmonic 12 --rim-angle-deg 0.001",
    "derive --rim-angle-deg 1e-9",
)


@pytest.fixture(scope="module")
def given(tmp_path_factory, pytestconfig):
    """Files that commands are given: a card with a typo, a record, a lot of it, a study, the paper's table."""
    folder = tmp_path_factory.mktemp("given")
    card = shipped_cards()["hrg-30mm"].read_text(encoding="utf-8").split("[loss]")
    (folder / "typo.toml").write_text(f"{card[0]}[loss]\ninvers_q = 1e-7\n", encoding="utf-8")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    for name, of in DESIGNS.items():
        (folder / f"{name}.toml").write_text(DESIGN.format(**{"column": "frequency_n2_Hz", "low": 4000.0} | of))
    rows = "".join(f"{t},20.0,{4432 + 0.01 * math.sin(t):.4f}\n" for t in range(0, 4000, 100))
    round_ = "".join(f"{15.45 * math.sin(a)} {15.45 * math.cos(a)} 0.5\n" for a in range(20))
    (folder / "few.asc").write_text(round_)
    for place in (folder, folder / "lot" / "a", folder / "lot" / "b"):
        place.mkdir(parents=True, exist_ok=True)
        (place / "run.csv").write_text("time_s,housing_temperature_degC,frequency_Hz\n" + rows, encoding="utf-8")
    (folder / "row.csv").write_text("time_s,housing_temperature_degC,frequency_Hz\n0,20.0,4432.0\n", encoding="utf-8")
    (folder / "units.csv").write_text("time_s,frequency_Hz\ns,Hz\n0,4432.0\n1,4432.0\n", encoding="utf-8")
    files = {
        "UNITS": folder / "units.csv",
        "TYPO": folder / "typo.toml",
        **{name.upper(): folder / f"{name}.toml" for name in DESIGNS},
        "STUDY": folder / "study.toml",
        "RUN": folder / "run.csv",
        "LOT": folder / "lot",
        "ROW": folder / "row.csv",
        "FEW": folder / "few.asc",
    }
    return {name: str(path) for name, path in files.items()} | {
        "HRG": str(pytestconfig.rootpath / "studies/papers/hrg_table1.csv")
    }


@pytest.mark.parametrize("words", [pytest.param(w, marks=[pytest.mark.slow] * (w in SLOW)) for w in REFUSED])
def test_it_is_refused_in_one_message(words, given, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    assert main([given.get(word, word) for word in shlex.split(words)]) == 2
    out, err = capsys.readouterr()
    assert REFUSED[words] in err
    assert len(err) < 400 + 2 * len(str(tmp_path)) or "--debug" in words or "9" * 400 in words
    assert ("Traceback" in err) == ("--debug" in words)
    assert out == ""
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_every_command_that_takes_a_card_is_tried():
    takes = set()
    for name, (target, _) in COMMANDS.items():
        module, function = target.split(":")
        if {"card", "cards"} & set(inspect.signature(getattr(importlib.import_module(module), function)).parameters):
            takes.add(name)
    assert takes <= {" ".join(words.split()[:k]) for words in WITH_A_CARD for k in (1, 2)}
