"""Q of a mode from its loss budget, and the share that heat takes of its loss."""

from studies.loss.model import loss_model
from studies.sweeps.case import Case, Options
from studies.sweeps.quantity import HARMONIC, TEMPERATURE, THEORY, Column, Number, Quantity, mode_stem


def _columns(options: Options) -> tuple[Column, ...]:
    stem, n = mode_stem("q", options), options["harmonic"]
    return (
        Column(stem, "1", f"Q, n = {n}"),
        Column(f"{stem}_thermoelastic_part", "1", f"thermoelastic share of 1/Q, n = {n}"),
    )


def _evaluate(case: Case, options: Options) -> tuple[Number, ...]:
    budget = loss_model(case.instrument, options["harmonic"], options["theory"]).budget(case.temperature(options))
    total = float(budget.inverse_q[0])
    warm = sum(float(part.inverse_q[0]) for part in budget.parts if part.name == "thermoelastic")
    return Number(1 / total), Number(warm / total)


QUANTITY = Quantity(
    "q",
    "Q from the loss budget of the card: heat, bulk, surface, films, gas, activated losses and mount.",
    {"harmonic": HARMONIC, "theory": THEORY, "temperature_degC": TEMPERATURE},
    _columns,
    _evaluate,
)
