"""Reports: one self-contained HTML page each, made of a few kinds of blocks."""
