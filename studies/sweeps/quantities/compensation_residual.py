"""What a polynomial compensation leaves of the frequency over temperature (HRG paper eqs. 16-18, Table 2)."""

import numpy as np

from shell.constants import zero_Celsius
from studies.errors import InputError
from studies.sweeps.case import Case, Options
from studies.sweeps.quantity import HARMONIC, THEORY, Column, Number, Quantity, mode_stem, number, whole


def _columns(options: Options) -> tuple[Column, ...]:
    low, high = options["from_degC"], options["to_degC"]
    if not high > low or options["points"] <= options["order"] + 1:
        raise InputError(
            f"compensation-residual needs from_degC < to_degC and more than {options['order'] + 1} points, not"
            f" {low:g} to {high:g} °C with {options['points']}."
        )
    words = f"polynomial of order {options['order']}, n = {options['harmonic']}"
    return (
        Column(mode_stem("compensation_residual", options), "Hz", f"rms residual of a {words}"),
        Column(mode_stem("compensation_error", options), "°C", f"largest temperature error of a {words}"),
    )


def _evaluate(case: Case, options: Options) -> tuple[Number, ...]:
    from compensation.frequency import fit_frequency

    T = np.linspace(options["from_degC"], options["to_degC"], options["points"])
    f = np.array([case.modes(options["harmonic"], 1, options["theory"], x + zero_Celsius)[0].frequency for x in T])
    fit = fit_frequency(T, f, options["order"], float(np.mean(T)))
    return (
        Number(float(np.sqrt(np.mean(fit.residuals**2)))),
        Number(float(np.abs(fit.temperature(f) - T).max())),
    )


QUANTITY = Quantity(
    "compensation-residual",
    "Rms residual and largest temperature error of a polynomial in T over a range.",
    {
        "harmonic": HARMONIC,
        "theory": THEORY,
        "from_degC": number(-20.0, "lowest temperature in °C"),
        "to_degC": number(40.0, "highest temperature in °C"),
        "points": whole(7, "settled temperatures, evenly spaced", least=3, most=101),
        "order": whole(3, "order of the polynomial", least=1, most=9),
    },
    _columns,
    _evaluate,
)
