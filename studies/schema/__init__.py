"""Declared keys of the files that people write: cards, studies, maps, models, limits. Declared once, read by one function.

    class Loop(Keys, frozen=True, kw_only=True):
        \"\"\"What the table says.\"\"\"

        bandwidth_Hz: Annotated[float, number("where the open loop has gain 1", above=0.0, relative_sd=0.3)] = 50.0
        kind: Annotated[Literal["open", "closed"], says("how the gyro is read")] = "open"

From the class come the reader with its errors (`reader`), the commented forms of `hrg card new` and `hrg study new` and the
reference of `hrg keys` (`reference`).
"""
