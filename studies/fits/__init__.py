"""Fits of models to records: what each `hrg fit` command computes."""
