"""How far the nearest other mode is from a mode, in Hz: parasitic modes close by couple under vibration."""

from shell.separation import nearest_mode
from studies.sweeps.case import Case, Options
from studies.sweeps.quantity import (
    HARMONIC,
    TEMPERATURE,
    THEORY,
    Column,
    Number,
    Quantity,
    mode_stem,
    whole,
)


def _columns(options: Options) -> tuple[Column, ...]:
    stem, n = mode_stem("separation", options), options["harmonic"]
    return (
        Column(stem, "Hz", f"distance of the nearest other mode from n = {n}"),
        Column(f"{stem}_nearest_harmonic", "1", f"harmonic of the mode nearest to n = {n}"),
    )


def _evaluate(case: Case, options: Options) -> tuple[Number, ...]:
    n, theory, at = options["harmonic"], options["theory"], case.temperature(options)
    own = case.modes(n, 1, theory, at)[0]
    nearest = nearest_mode(
        lambda m, count: case.modes(m, count, theory, at), own, range(options["highest"] + 1), options["each"]
    )
    error = sum(mode.frequency * mode.relative_error_estimate for mode in (own, nearest))
    return (Number(nearest.frequency - own.frequency, error), Number(float(nearest.harmonic), 0.0))


QUANTITY = Quantity(
    "mode-separation",
    "Signed distance of the nearest other mode, among harmonics 0 ... `highest`, and its harmonic.",
    {
        "harmonic": HARMONIC,
        "theory": THEORY,
        "temperature_degC": TEMPERATURE,
        "highest": whole(4, "highest harmonic that is searched", most=20),
        "each": whole(2, "modes of each harmonic that are solved at least", least=1, most=10),
    },
    _columns,
    _evaluate,
)
