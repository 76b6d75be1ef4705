"""State space and transfer functions of the loops: closed forms, the loops' own answer to a step, and both kinds of file."""

import json

import numpy as np
import pytest
from scipy.io import loadmat
from scipy.signal import dlsim

from studies.cli import main
from studies.instrument.card import load_card
from studies.resonator.law import law_of
from studies.simulation.loop_study import study_loops
from studies.simulation.state_space import state_space


def study_of(card):
    law = law_of(card, 290.0, 296.0)
    return study_loops(card, float(law.frequency(293.15)), 1e-7, law.bryan_factor)


@pytest.fixture(scope="module")
def study():
    return study_of(load_card("hrg-30mm-loops"))


def test_limits_transfer_functions(study):
    """The polynomials are the sampled loop gain L(z), and L/(1 + L) is 1 at rest: the controllers integrate."""
    found = state_space(study)["transfer"]
    f = np.geomspace(1e-3, 450.0, 50)
    z = np.exp(2j * np.pi * f * study.loops.step)
    assert set(found) == {"amplitude", "phase", "rate", "quadrature"}
    for name, one in found.items():
        L = np.polyval(one["open"]["numerator"], z) / np.polyval(one["open"]["denominator"], z)
        far = f > 1.0  # nearer to z = 1 polynomials lose digits, products do not
        expected = study.loops.open_loop(name, study.decay, f)
        np.testing.assert_allclose(L[far], expected[far], rtol=1e-9)
        factors = [np.prod(z[:, None] - one["open"][part], axis=1) for part in ("zeros", "poles")]
        np.testing.assert_allclose(one["open"]["gain"] * factors[0] / factors[1], expected, rtol=1e-9)
        closed = np.polyval(one["closed"]["numerator"], z) / np.polyval(one["closed"]["denominator"], z)
        np.testing.assert_allclose(closed, L / (1 + L), rtol=1e-9)
        rest = [np.polyval(one["closed"][part], 1.0) for part in ("numerator", "denominator")]
        assert rest[0] == pytest.approx(rest[1], rel=1e-9)


def test_limits_wave(study):
    """Without electronics' errors a rate moves the node by n k Ω τ of the antinode; the poles decay with 1/τ."""
    keys = {"frequency_split_mHz": 0.0}
    card = load_card("free-dome").with_table("loop", keys).with_table("bias", {"damping_anisotropy": 0.0})
    ideal = study_of(card)
    wave = state_space(ideal)["wave"]
    still = -wave["C"] @ np.linalg.solve(wave["A"], wave["B"])
    node, rate = wave["outputs"].index("pickoff_node_real"), wave["inputs"].index("rate_rad_per_s")
    assert still[node, rate] == pytest.approx(2 * ideal.bryan_factor / ideal.decay, rel=1e-12)
    np.testing.assert_allclose(np.linalg.eigvals(wave["A"]), -ideal.decay, rtol=1e-9)


def test_limits_closed_loops(study):
    """The sampled system answers a step as the loops themselves do, and shows the rate that is there, as far as gains allow."""
    loops = state_space(study)["loops"]
    count = 2000
    step = np.zeros((count, len(loops["inputs"])))
    step[:, loops["inputs"].index("forcing_node_real_per_s")] = 1.0
    system = (*(loops[name] for name in "ABCD"), loops["step_s"])
    _, answer, _ = dlsim(system, step)
    _, expected = study.closed().answer_step("rate", 1, count)
    np.testing.assert_allclose(
        -answer[:, loops["outputs"].index("command_rate_per_s")], expected[1:], rtol=1e-9, atol=1e-9
    )
    still = loops["D"] + loops["C"] @ np.linalg.solve(np.eye(len(loops["A"])) - loops["A"], loops["B"])
    gain = still[loops["outputs"].index("measured_rate_rad_per_s"), loops["inputs"].index("rate_rad_per_s")]
    assert gain == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
def test_contract_files(tmp_path, refuse):
    """JSON and .mat hold the same; another ending is refused before anything is written."""
    for name in ("loops.json", "loops.mat"):
        assert main(["loop", "hrg-30mm-loops", "--state-space", str(tmp_path / name)]) == 0
    text, mat = json.loads((tmp_path / "loops.json").read_text()), loadmat(tmp_path / "loops.mat", simplify_cells=True)
    assert text["schema"] == mat["schema"] == "hrg.state-space/1"
    for system in ("wave", "loops"):
        shape = np.array(text[system]["D"]).shape
        assert shape == (len(text[system]["outputs"]), len(text[system]["inputs"]))
        assert len(text[system]["states"]) == len(text[system]["A"])
        assert list(mat[system]["inputs"]) == text[system]["inputs"]
        for part in "ABCD":
            np.testing.assert_array_equal(mat[system][part], np.array(text[system][part]))
    np.testing.assert_array_equal(
        mat["transfer"]["rate"]["open"]["numerator"], text["transfer"]["rate"]["open"]["numerator"]
    )
    assert ".json or .mat" in refuse(["loop", "hrg-30mm-loops", "--state-space", str(tmp_path / "loops.txt")])
    assert not (tmp_path / "loops.txt").exists()
