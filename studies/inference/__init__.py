"""One joint inference: a card's values, starts of runs and effects as columns with priors in one linear-Gaussian model of all responses."""
