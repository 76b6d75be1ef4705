"""Lumped thermal networks: chamber profile to temperatures."""

__version__ = "0.1.0"
