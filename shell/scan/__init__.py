"""Measured points of the faces of a shell: alignment, circumferential harmonics with their errors, and the resulting split."""
