"""What a simulation gets wrong, where no card is given: a campaign of records against a library of physical effects.

`campaign` puts records on one grid (`checks`); `response` says what is diagnosed; `baseline` is what counts as
the simulation; `noise` and `evidence` weigh linear models by marginal likelihood; `model` joins baseline and effects;
`scan` looks at every shape of every effect, `search` grows models, `clock` lets a reference clock judge; `lack_of_fit` looks for
what no effect explains, `held_out` measures the worth; `inquiry` is all that for one response, `causes` joins the responses,
`verdict` finds the words, `investigate` is the whole of it.
`table` does the same for steady-state tables, with a card too; `planning` looks ahead. Records beside a card: `studies.inference`.
All constants are in `calibration.toml`.
"""
