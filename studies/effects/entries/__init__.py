"""One file an effect; each defines `EFFECT`."""
