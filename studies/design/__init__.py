"""Designing: dimensions for objectives under constraints, by full solves alone, with tolerances and a front."""
