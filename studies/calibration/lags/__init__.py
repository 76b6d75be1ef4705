"""How a resonator lags behind its housing, from records of frequency and housing temperature.

`records` reads them, `housing_run` puts them on even rows, `followers` are the models, `least_squares` fits one under
given noise, `identification` estimates noise and constants and says what the records leave open.
"""
