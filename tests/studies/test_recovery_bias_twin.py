"""The twins of the HRG paper's figure 6: what holds for every honest draw, on a few seeds."""

import numpy as np
import pytest

from studies.papers.bias_twin import study_twin


@pytest.mark.slow
def test_the_training_run_flatters_and_a_warming_run_is_worse():
    one = [study_twin(seed)[0] for seed in range(3)]
    training = np.median([fit.training_gain for fit in one])
    cooling, warming = (np.median([getattr(fit, run).gain for fit in one]) for run in ("cooling", "warming"))
    assert training > 1.2
    assert training > 0.95 * cooling
    assert warming < cooling
