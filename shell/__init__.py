"""Resonator mechanics: materials, meridians, derivation, shell modes."""

__version__ = "0.1.0"
