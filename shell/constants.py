"""Constants of nature, exact by definition; `scipy.constants` has them too and takes longer to load than a mode to solve."""

zero_Celsius = 273.15  # K
