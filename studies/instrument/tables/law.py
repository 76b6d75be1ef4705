"""`[law]`: a gyro without geometry, its frequency a polynomial of the temperature that follows the housing through lags in series.

    f = f₀ (1 + a₁ x + a₂ x² + a₃ x³),   x = T − T_ref,   T(t) = T_r(t − delay),
    lag_j c_j dT_j/dt = (1 − ρ_j) (T_{j−1} − T_j) + ρ_j (1 − δ) g(T_{j−1}, T_j) + ρ_j δ g(T_h, T_j),   g(T, T') = (T⁴ − T'⁴)/(4 T₀³),

from the housing, T_h, to the resonator, T_r: one lag, unless `second_lag_s` and `third_lag_s` are given; T₀ = 20 °C. Of the heat exchange
ρ is radiated, `radiated_share` of the resonator's and `base_radiated_share` (the same unless given) of that between; δ, `direct_share`, is the part of the
resonator's radiation that is with the housing, 0 between. c_j = exp(s_j (T_j − T₀)) with s `capacity_slope_per_K` of the resonator and
`base_capacity_slope_per_K` between. The lump before the resonator gives what the resonator takes, by `capacity_ratio`; no other takes
heat from the one before it.

It stands in place of `[resonator]`, `[material]` and `[thermal]`.
"""

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from compensation.arrays import Array
from shell.errors import ShellError
from studies.instrument.registry import CardPlace, CardTable
from studies.schema.keys import Keys, Note, number
from thermal.network import Capacity, growing

BETWEEN = ("base", "stem")  # what lies between the housing and the resonator where there are two lags and more
NO_LOAD = 1e-8  # ratio of heat capacities of lumps that take no heat from what they follow
LEAST = 1e-3  # of f over f₀: a polynomial is no law down to 0


class LawKeys(Keys, frozen=True, kw_only=True):
    """Coefficients at the card's reference temperature, and time constants."""

    f0_Hz: Annotated[float, number("at the reference temperature", above=0.0, relative_sd=1e-3, example=4432.07)] | None = None  # fmt: skip
    a1_per_K: Annotated[float, number("of x", least=-1e-2, most=1e-2, sd=2e-5)] = 8e-5
    a2_per_K2: Annotated[float, number("of x²", sd=2e-7)] = 0.0
    a3_per_K3: Annotated[float, number("of x³", sd=2e-9)] = 0.0
    lag_s: Annotated[float, number("of the resonator behind its housing", above=0.0, relative_sd=1.0)] = 1500.0
    second_lag_s: Annotated[float, number("in series with it", above=0.0, relative_sd=1.0)] | None = None
    third_lag_s: Annotated[float, number("in series with both", above=0.0, relative_sd=1.0)] | None = None
    radiated_share: Annotated[float, number("of the heat exchange at 20 °C; below 0 where conductance falls with temperature", least=-0.5, most=0.95, sd=0.3)] | None = None  # fmt: skip
    direct_share: Annotated[float, number("of the resonator's radiation, with the housing and past the lags between", least=0.0, most=1.0, sd=0.5)] | None = None  # fmt: skip
    base_radiated_share: Annotated[float, number("of the heat exchange of the lags between at 20 °C", least=-0.5, most=0.95, sd=0.3)] | None = None  # fmt: skip
    capacity_ratio: Annotated[float, number("heat capacity of the resonator over that of the lump before it", above=0.0, most=10.0, sd=0.3)] | None = None  # fmt: skip
    capacity_slope_per_K: Annotated[float, number("relative, of the resonator's heat capacity; about 2e-3 of fused silica", least=-5e-3, most=5e-3, sd=1e-3)] | None = None  # fmt: skip
    base_capacity_slope_per_K: Annotated[float, number("the same of what lies between; 2e-3 of silica, 0.5e-3 of metals", least=-5e-3, most=5e-3, sd=1e-3)] | None = None  # fmt: skip
    chamber_lag_s: Annotated[float, number("of the housing behind its chamber", above=0.0, relative_sd=1.0)] = 600.0
    delay_s: Annotated[
        float,
        number(
            "beside the resonator's lag; where noise.housing_lag_s is 0, less the lag of the housing's sensor", sd=10.0
        ),
    ] = 0.0
    bias_bend: Annotated[float, number("part of the bend of f that the bias follows: 1 f, eq. 21; 0 T", sd=0.5)] = 1.0
    note: Note = ""

    def __post_init__(self) -> None:
        given = tuple(getattr(self, key) for key in self.__struct_fields__)
        if self.f0_Hz is None and given != self.__struct_defaults__:
            raise ValueError("f0_Hz, the frequency at the reference temperature, is missing; add it.")


@dataclass(frozen=True)
class PolynomialLaw:
    """Frequency law of `[law]`, with what a simulation asks of `shell.law.FrequencyLaw`."""

    f0: float  # Hz
    coefficients: tuple[float, float, float]  # of x, x², x³, 1/Kⁿ
    # reference_temperature, lowest, highest: K
    reference_temperature: float
    lags: tuple[float, ...]  # in series, from the housing to the resonator, s
    radiated_share: float  # of the resonator's heat exchange, at 20 °C
    direct_share: float  # of that with the housing
    base_radiated_share: float  # of what lies between
    capacity_ratio: float  # of the resonator to the lump before it
    # relative, 1/K
    capacity_slope: float  # of the resonator
    base_capacity_slope: float  # of what lies between
    # chamber_lag, delay: s
    chamber_lag: float
    delay: float = 0.0
    bias_bend: float = 1.0  # part of its bend that the bias follows
    lowest: float = 0.0
    highest: float = np.inf
    bryan_factor: float = 0.2774  # of a thin hemisphere
    solver_error: ClassVar[float] = 0.0  # relative: nothing is solved
    interpolation_error: ClassVar[float] = 0.0  # relative, between knots: there are none

    def frequency(self, temperature: ArrayLike, *, extrapolate: bool = False) -> Array:
        """Frequency (Hz) at temperatures (K)."""
        return np.asarray(np.exp(self.logarithm(temperature, extrapolate=extrapolate)))

    def logarithm(self, temperature: ArrayLike, *, extrapolate: bool = False) -> Array:
        """Return ln f, f in Hz."""
        x = np.asarray(temperature, dtype=float) - self.reference_temperature
        a1, a2, a3 = self.coefficients
        change = x * (a1 + x * (a2 + x * a3))
        if not (change > LEAST - 1.0).all():
            raise ShellError(f"the polynomial of the frequency is negative {np.ptp(x):.0f} K from its reference.")
        return np.asarray(np.log(self.f0) + np.log1p(change))

    def slope(self, temperature: ArrayLike) -> Array:
        """Return d ln f/dT, 1/K."""
        x = np.asarray(temperature, dtype=float) - self.reference_temperature
        a1, a2, a3 = self.coefficients
        return np.asarray((a1 + x * (2 * a2 + x * 3 * a3)) * self.f0 / self.frequency(temperature))

    def change_of_bias(self, change: Array, temperature: Array) -> Array:
        """Return the change of frequency (Hz) that the bias follows: f₀ a₁ x, and its part of the rest."""
        straight = self.f0 * self.coefficients[0] * (temperature - self.reference_temperature)
        return np.asarray(straight + self.bias_bend * (change - straight))

    def radiated_shares(self, last: bool) -> tuple[float, float]:
        """Return the parts of the heat exchange of the resonator, or of a lump between, that are radiation with the one before it and with the housing."""
        if not last:
            return self.base_radiated_share, 0.0
        return self.radiated_share * (1.0 - self.direct_share), self.radiated_share * self.direct_share

    def capacity(self, at_20_degC: float, last: bool) -> Capacity:
        """Return the heat capacity of the resonator, or of a lump between."""
        return growing(at_20_degC, self.capacity_slope if last else self.base_capacity_slope)

    @property
    def absent(self) -> tuple[str, ...]:
        """Lumps of a heat path with a geometry that its lags do not have."""
        return BETWEEN[len(self.lags) - 1 :]

    @property
    def uneven(self) -> Array:
        """What an uneven temperature does: nothing, for the resonator has one."""
        return np.zeros(4)

    def uncertainty(self, temperature: ArrayLike) -> Array:
        """Standard deviation of ln f by a material's prior: it has none."""
        return np.zeros_like(np.asarray(temperature, dtype=float))

    def between(self, lowest: float, highest: float) -> "PolynomialLaw":
        """Return the law between two temperatures (K)."""
        return replace(self, lowest=max(lowest, 0.0), highest=highest)


def build(keys: LawKeys, place: CardPlace) -> PolynomialLaw | None:
    """The law in SI units; None where the card has a geometry."""
    if keys.f0_Hz is None:
        return None
    coefficients = (keys.a1_per_K, keys.a2_per_K2, keys.a3_per_K3)
    return PolynomialLaw(
        keys.f0_Hz,
        coefficients,
        place.reference_temperature,
        tuple(lag for lag in (keys.lag_s, keys.second_lag_s, keys.third_lag_s) if lag is not None),
        keys.radiated_share or 0.0,
        keys.direct_share or 0.0,
        keys.radiated_share or 0.0 if keys.base_radiated_share is None else keys.base_radiated_share,
        keys.capacity_ratio or NO_LOAD,
        keys.capacity_slope_per_K or 0.0,
        keys.base_capacity_slope_per_K or 0.0,
        keys.chamber_lag_s,
        keys.delay_s,
        keys.bias_bend,
    )


TABLE = CardTable("law", LawKeys, build=build, optional=True)
