"""Instruments: a card (TOML) is parsed whole, once, when it is loaded, into frozen typed parts with their uncertainties.

To add a table `[loop]`, or keys to a table that exists, add one file to `studies/instrument/tables/`:

    class Loop(Keys, frozen=True, kw_only=True):                                                   # keys = fields, in the units of their names
        \"\"\"What the table says.\"\"\"

        bandwidth_Hz: Annotated[float, number(above=0.0, relative_sd=0.3)] = 50.0   # bounds, and the documented uncertainty
        kind: Literal["open", "closed"] = "open"
        def __post_init__(self): ...                                     # ValueError("a sentence.") where keys contradict

    TABLE = CardTable("loop", Loop)        # build=function(keys, place) makes another part of it, in SI units
                                           # CardTable("loss", FilmLoss, part="film") owns further keys of [loss]

It is found by discovery; every command then checks it, `instrument.part("loop")` (`part("loss", "film")`) is the part,
`with_values({"loop.bandwidth_Hz": 60.0})` changes it, and `instrument.uncertain` holds "loop.bandwidth_Hz".
"""
