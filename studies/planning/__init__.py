"""Looking ahead with a card's own simulation: what a planned campaign could tell apart, and which run should come next."""
