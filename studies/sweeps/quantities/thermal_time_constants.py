"""The slowest time constants of the heat path from the chamber to the shell, and of shell and stem alone."""

from studies.sweeps.case import Case, Options
from studies.sweeps.quantity import TEMPERATURE, Column, Number, Quantity, whole


def _columns(options: Options) -> tuple[Column, ...]:
    path = [
        Column(f"time_constant_{k}", "s", f"time constant {k} of the heat path") for k in range(1, options["count"] + 1)
    ]
    return (*path, Column("time_constant_shell", "s", "slowest time constant of shell and stem alone"))


def _evaluate(case: Case, options: Options) -> tuple[Number, ...]:
    from studies.simulation.heat_path import build_network, build_shell_and_stem
    from thermal.relaxation import find_relaxation

    T = case.temperature(options)
    path = find_relaxation(build_network(case.instrument), T).time_constants[: options["count"]]
    alone = find_relaxation(build_shell_and_stem(case.instrument), T).time_constants[0]
    return tuple(Number(float(tau)) for tau in (*path, alone))


QUANTITY = Quantity(
    "thermal-time-constants",
    "Slowest time constants of the heat path, linearised at one temperature.",
    {"count": whole(2, "how many of the whole heat path", least=1, most=10), "temperature_degC": TEMPERATURE},
    _columns,
    _evaluate,
)
