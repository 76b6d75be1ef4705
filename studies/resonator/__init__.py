"""Resonators of instruments: frequency over temperature, splits, scans, trimming, comparison."""
