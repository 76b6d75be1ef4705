"""Compensation models of the four papers, as functions of arrays."""

__version__ = "0.1.0"
