"""Parametric studies: a readable spec, any number of designs, a store that loses nothing, and what the results mean."""
