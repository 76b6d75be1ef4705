"""Constants of nature, exact by definition (`scipy.constants` takes longer to load than a mode to solve), and of intervals."""

zero_Celsius = 273.15  # K
NINETY = 1.6448536269514722  # standard deviations to either end of a 90 % interval of a normal number
