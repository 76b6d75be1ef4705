"""What a simulation gets wrong: a campaign of records against a library of physical effects.

`campaign` puts records on one grid (`checks`, `outliers`); `baseline` is what counts as the simulation; `effects` holds one
file an effect; `scan`, `null` and `selection` find what is missing beyond chance, `clock` what a reference clock adds;
`discrepancy` (smooth), `sharp` (bursts, steps, lines) and `patchwork` (effects that only patch up a curve) are the witnesses
for what no effect explains; `verdict` puts it into words, `gain` measures the worth, `extension` makes a card of it;
`next_run` and `plan` look ahead.
"""
