"""Elastic constants, wall and stem from the frequencies of many modes (resonant ultrasound's question, for shells of revolution)."""
