"""Keys of a material table, `schema = "hrg.materials/1"`, for people to look up (hrg keys material); `shell.materials` reads and checks it.

NAME, LAW and PROPERTY stand for names of one's own, or of the properties that `shell` knows.
"""

from typing import Annotated, Literal

import msgspec

from studies.schema.keys import Keys, Note, number, says

PROPERTIES = "shear_modulus, youngs_modulus (Pa; two of these and poisson_ratio), density (kg/m³), expansion (1/K), conductivity (W/(m K)), heat_capacity (J/(kg K))"
SOURCE = "where the numbers are from"
UNSETTLED = "sd of what no source settles: log_value, log_slope_per_K, log_curvature_per_K2; of poisson_ratio and expansion value, slope_per_K, curvature_per_K2"
Constants = dict[str, float]


class PropertyKeys(Keys, frozen=True, kw_only=True):
    """One property over temperature."""

    form: Annotated[Literal["constant", "linear", "parabola", "table"], says(f"PROPERTY is one of {PROPERTIES}")]
    value: Annotated[float, number("at at_degC; not of a table", example=1.9e11, unit="SI")] | None = None
    at_degC: Annotated[float, number("linear, parabola; required of a density", example=20.0)] | None = None
    slope: Annotated[float, number("linear: value (1 + slope (T − at_degC))", example=-2.5e-4, unit="1/K")] | None = (
        None
    )
    rise: Annotated[float, number("parabola: relative, from at_degC to maximum_degC", example=0.09)] | None = None
    maximum_degC: Annotated[float, number("parabola: where it is flat", example=1125.0)] | None = None
    temperature_degC: Annotated[tuple[float, ...], says("table: over range_degC, increasing", example=[-40.0, 20.0, 80.0])] = ()  # fmt: skip
    values: Annotated[tuple[float, ...], says("table: at these", example=[1.0, 1.1, 1.2])] = ()
    uncertainty: Annotated[Constants, says("standard uncertainty of any number", example={"value": 1e9})] | None = None
    unsettled: Annotated[Constants, says(UNSETTLED, example={"log_slope_per_K": 2e-5})] | None = None
    source: Annotated[str, says("if not that of the law")] = ""


class CrystalKeys(Keys, frozen=True, kw_only=True):
    """Elastic constants C (1 + slope x + curvature x²), x = T − at_degC, instead of moduli."""

    system: Annotated[Literal["cubic", "trigonal"], says("of the crystal")]
    axis: Annotated[str, says("along the resonator's axis: [001] or [111]; trigonal c", example="[001]")]
    at_degC: Annotated[float, number("where the constants hold", example=20.0)]
    C11: Annotated[float, number("at at_degC", example=1.66e11, unit="Pa")]
    C12: Annotated[float, number("at at_degC", example=6.4e10, unit="Pa")]
    C44: Annotated[float, number("at at_degC", example=7.96e10, unit="Pa")]
    C13: Annotated[float, number("trigonal", example=1.2e10, unit="Pa")] | None = None
    C14: Annotated[float, number("trigonal", example=-1.8e10, unit="Pa")] | None = None
    C33: Annotated[float, number("trigonal", example=1.06e11, unit="Pa")] | None = None
    slope: Annotated[Constants, says("1/K, by constant", example={"C11": -7e-5})] | None = None
    curvature: Annotated[Constants, says("1/K², by constant")] | None = None
    uncertainty: Annotated[Constants, says("Pa, by constant")] | None = None
    slope_uncertainty: Annotated[Constants, says("1/K, by constant with a slope")] | None = None


class LawKeys(Keys, frozen=True, kw_only=True):
    """What one source states."""

    source: Annotated[str, says(SOURCE, example="data sheet")]
    range_degC: Annotated[tuple[float, float], says("lowest and highest temperature at which it holds", example=[-40.0, 80.0])]  # fmt: skip
    note: Note = ""
    unchecked: Annotated[tuple[str, ...], says("properties that could not be compared with an open source")] = ()
    of_property: PropertyKeys | None = msgspec.field(name="PROPERTY", default=None)
    crystal: CrystalKeys | None = None


class Laws(Keys, frozen=True, kw_only=True):
    """The laws of a material."""

    law: LawKeys = msgspec.field(name="LAW")


class MaterialEntry(Keys, frozen=True, kw_only=True):
    """One material; a card takes it by NAME."""

    description: Annotated[str, says("free text")] = ""
    default: Annotated[str, says("the law that a card takes unless it says another; the first unless given")] = ""
    laws: Laws


class MaterialFile(Keys, frozen=True, kw_only=True):
    """A whole table."""

    schema: Annotated[Literal["hrg.materials/1"], says("kind of file")]
    material: MaterialEntry = msgspec.field(name="NAME")
