"""The temperature coefficient of frequency, d ln f/dT, and its parts from E, ν, ρ, h and r (HRG paper eq. 15)."""

from studies.law import law_of
from studies.sweeps.case import Case, Options
from studies.sweeps.quantity import HARMONIC, TEMPERATURE, THEORY, Column, Number, Quantity, mode_stem

PARTS = ("E", "nu", "rho", "h", "r")


def _columns(options: Options) -> tuple[Column, ...]:
    stem, n = mode_stem("tcf", options), options["harmonic"]
    parts = [Column(f"{stem}_{part}", "ppm/°C", f"TCF, n = {n}, part of {part}") for part in PARTS]
    return (Column(stem, "ppm/°C", f"TCF, n = {n}"), *parts)


def _evaluate(case: Case, options: Options) -> tuple[Number, ...]:
    T = case.temperature(options)
    found = law_of(case.instrument, T, T, options["theory"], options["harmonic"]).parts(T)
    return tuple(Number(1e6 * float(value)) for value in (found.total, *(getattr(found, part) for part in PARTS)))


QUANTITY = Quantity(
    "tcf",
    "Relative slope of the frequency over temperature and its five parts.",
    {"harmonic": HARMONIC, "theory": THEORY, "temperature_degC": TEMPERATURE},
    _columns,
    _evaluate,
)
