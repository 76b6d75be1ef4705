"""What diagnoses of the tests' own records share."""

import pytest

from studies.effects import find_effect
from studies.inference import signatures
from tests.sketches import coarsen


@pytest.fixture
def coarser(monkeypatch):
    """A diagnosis takes as few means of a run as the batch of campaigns."""
    coarsen(monkeypatch, 60)


@pytest.fixture
def only(monkeypatch):
    """Let a diagnosis know a few effects alone: those that contend."""
    return lambda *names: monkeypatch.setattr(
        signatures, "library", lambda: {name: find_effect(name) for name in names}
    )
