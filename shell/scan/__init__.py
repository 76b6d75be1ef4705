"""Measured points of the faces of a shell: aligned, turned into waves around with their errors, and into a split."""
