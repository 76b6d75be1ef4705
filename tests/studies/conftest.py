"""What holds for all tests of commands and campaigns."""

import pytest

from tests.sketches import coarsen


@pytest.fixture(autouse=True, scope="module")
def coarse():
    """Diagnoses take coarse means."""
    with pytest.MonkeyPatch.context() as patch:
        coarsen(patch)
        yield
