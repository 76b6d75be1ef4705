"""Looking ahead: runs that could come next, what they would tell, and what a planned campaign could tell apart."""
