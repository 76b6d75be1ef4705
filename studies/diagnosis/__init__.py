"""What a diagnosis says, and steady-state tables.

`response` says what is diagnosed, `checks` that records are of one gyro and in their units, `verdict` finds the words. `table` compares
a steady-state table with the forms that effects leave in a steady state. Records, with a card or without: `studies.inference`.
All constants are in `calibration.toml`.
"""
