"""Many devices of one design: each calibrated and diagnosed by the one inference, then what the lot is, shares, and who differs."""
