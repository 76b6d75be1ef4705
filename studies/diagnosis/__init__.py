"""What a simulation gets wrong: a campaign of records against a library of physical effects.

`campaign` checks records and puts them on one grid; `baseline` is what counts as the simulation; `effects` holds one file
an effect; `scan`, `null` and `selection` find what is missing beyond chance; `discrepancy` is the witness for what no
effect explains; `verdict` puts it into words, `gain` measures the worth, `extension` makes a card of it, `plan` looks ahead.
"""
