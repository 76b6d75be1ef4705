"""The twin's drift and mean rate beside the published closed forms, and its verdicts on what is claimed of loops."""

import pytest

from studies.papers.loop_claims import study_claims


def test_drift_mean_rate_and_verdicts():
    found = study_claims()
    # 1 % at Q = 1e7, k = 0.277, 4432 Hz; √(15.041² − 2.592²)
    assert found.drift[0] == pytest.approx(2.592, rel=1e-3)
    assert found.mean_rate[0] == pytest.approx(14.816, rel=1e-3)
    assert [claim.verdict for claim in found.claims] == [
        "met", "not met", "met conditionally", "met", "met conditionally",
    ]  # fmt: skip
    # ε π Δf/(n k) = 0.065 deg/h at 60 mHz: 0.93 µrad
    assert "stable to 0.9 µrad" in found.claims[2].twin
