"""Constants of nature (SI of 2019); `scipy.constants` has them too and takes longer to load than a run to compute."""

zero_Celsius = 273.15  # K
Stefan_Boltzmann = 5.6703744191844314e-8  # W/(m² K⁴), σ = 2 π⁵ k⁴ / (15 h³ c²)
