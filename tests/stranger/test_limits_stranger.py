"""Evidence: the stranger's campaigns have the SNR that their truth says, by a second computation, and are repeatable; the batch checks each that it draws."""

import json

import numpy as np
import pytest
from scipy.optimize import least_squares

from tests.stranger import make_campaign


def follow(time, drive, tau, start):
    """dθ/dt = (T_h − θ)/τ on the record's own rows, T_h linear between them."""
    out = [start]
    for h, first, last in zip(np.diff(time), drive, drive[1:], strict=False):
        slope = (last - first) / h
        out.append(last - slope * tau + (out[-1] - first + slope * tau) * np.exp(-h / tau))
    return np.array(out)


def snr_again(truth):
    """The SNR of the contract in the frequency from all rows, by a direct fit of every constant."""
    times = [t["time_s"] for t in truth.clean]
    target = np.concatenate([t["frequency"] for t in truth.clean])
    noise = np.concatenate([n["frequency"] for n in truth.noise])

    def model(p):
        x = [
            follow(t, c["reading"], np.exp(p[3]), p[4 + i])
            for i, (t, c) in enumerate(zip(times, truth.clean, strict=True))
        ]
        return np.polyval(p[:3], (np.concatenate(x) - 10) / 30)

    start = np.r_[-0.1, 10.5, target.mean(), np.log(1200), [c["reading"][0] for c in truth.clean]]
    scale = np.r_[1e-2, 1, 10, 0.1, np.ones(len(times))]
    fit = least_squares(lambda p: (model(p) - target) / 1e-3, start, x_scale=scale, xtol=1e-13, ftol=1e-13, gtol=1e-13)
    basis = np.linalg.qr(fit.jac / np.linalg.norm(fit.jac, axis=0))[0]
    return np.std(fit.fun * 1e-3) / np.std(noise - basis @ (basis.T @ noise))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "snr"), [("curvature", 3.0), ("mounting-stress", 1.0)])
def test_stated_snr_is_found_again_from_all_rows(tmp_path, name, snr):
    truth = make_campaign(11, "effect", name, snr, runs=2, folder=tmp_path)
    stated = next(h.snr for h in truth.hidden if h.response == "frequency")
    assert stated == pytest.approx(snr, rel=0.06)
    assert snr_again(truth) == pytest.approx(stated, rel=0.1)


def test_a_null_departs_from_the_baseline_by_less_than_can_be_seen(tmp_path):
    truth = make_campaign(21, "null", "white", runs=2, folder=tmp_path)
    rows = sum(len(n["frequency"]) for n in truth.noise)
    assert snr_again(truth) * np.sqrt(rows) < 3


@pytest.mark.slow
def test_the_same_seed_gives_the_same_files(tmp_path):
    for folder in ("a", "b"):
        make_campaign(8, "effect", "curvature", 3.0, runs=1, folder=tmp_path / folder)
    make_campaign(9, "effect", "curvature", 3.0, runs=1, folder=tmp_path / "c")
    text = {f: (tmp_path / f / "run_1.csv").read_bytes() for f in "abc"}
    assert text["a"] == text["b"] != text["c"]
    assert json.loads((tmp_path / "a/truth.json").read_text())["hidden"][0]["effect"] == "curvature"
