"""Instruments: a card (TOML) becomes a resonator, a material and the tables that other parts read."""
