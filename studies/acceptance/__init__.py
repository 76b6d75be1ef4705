"""Acceptance of a gyro: the tests of IEEE Std 1431-2004 in its order, as far as records go, against limits.

`runs` tells which record serves which test · `measure` a value with its interval for every quantity that a record gives ·
`limits` the TOML of limits · `judgement` both together, and what record is missing for the rest.
"""
