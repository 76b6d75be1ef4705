"""Published values through the whole command: `hrg reproduce` writes the page, the tables and the contract's summary."""

import json

import numpy as np
import pytest

from shell import render
from studies.cli import main
from studies.papers import hrg

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """With 2 virtual gyros instead of 12: what is asserted does not depend on how many (test_recovery_bias_twin has more)."""
    out = tmp_path_factory.mktemp("report")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("studies.reports.reproduce.GYROS", 2)
        patch.setattr("studies.reports.gyro_papers.MAP_POINTS", 7)
        assert main(["reproduce", "--out", str(out)]) == 0
    return out


@pytest.fixture(scope="module")
def summary(folder):
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))


def test_all_files_appear_and_nothing_else(folder):
    assert sorted(p.name for p in folder.iterdir()) == ["report.html", "summary.json", "table1.csv", "table2.csv"]


def test_summary_has_the_contract_and_the_published_numbers(summary):
    assert summary["schema"] == "hrg.reproduce/1"
    assert summary["cubic"]["reference_temperature_degC"] == 0
    np.testing.assert_allclose(
        summary["cubic"]["coefficients"], [4424.90095, 0.3715556, -9.70238e-4, 1.527778e-5], rtol=2e-7
    )
    printed, _ = hrg.printed_table2()
    np.testing.assert_allclose(summary["table2"]["calculated_degC"], printed, atol=1.001e-3)
    assert len(summary["table2"]["error_degC"]) == 7


def test_measured_and_simulated_sensitivity_are_about_80(summary):
    """Measured 79.2 ppm/°C; the paper's cited value is about 80; Spinner's law and the solid solver give it within its uncertainty."""
    sensitivity = summary["sensitivity_ppm_per_degC"]
    assert sensitivity["measured"] == pytest.approx(79.2, abs=0.05)
    assert sensitivity["uncertainty"] > 3
    assert abs(sensitivity["simulated"] - 80) < 2 * sensitivity["uncertainty"]


def test_imposed_law_leaves_structure_of_the_published_size(summary):
    """Theory sheet: about 0.148 Hz rms left and a curvature of -0.23, about three times the law's (-0.065 to -0.09)."""
    assert summary["law_imposed"]["residual_rms_Hz"] == pytest.approx(0.148, abs=0.01)
    assert summary["law_imposed"]["curvature_measured_ppm_per_degC2"] == pytest.approx(-0.23, abs=0.01)
    assert -0.095 < summary["law_imposed"]["curvature_law_ppm_per_degC2"] < -0.06


def test_page_is_self_contained_and_shows_the_mode(folder):
    text = (folder / "report.html").read_text(encoding="utf-8")
    for word in ("Table 1", "Table 2", "quartic", "ppm/°C", "Spinner"):
        assert word in text
    assert 'src="http' not in text
    assert "<link" not in text
    assert "data:image/png;base64" in text or render.REMEDY in text
