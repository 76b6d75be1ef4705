"""What tests of whole diagnoses share."""

import pytest


@pytest.fixture
def coarse_grid(monkeypatch):
    """A grid of 300 steps for all runs, where a claim does not hang on the engine's own 800: half the time or less."""
    monkeypatch.setattr("studies.diagnosis.campaign.MOST_BINS", 300)
