"""What the closed loops of a card leave of rate at rest: bias, its spread by the card's uncertain values, random walk."""

from studies.errors import InputError
from studies.sweeps.case import Case
from studies.sweeps.quantity import Column, Number, Quantity, Temperature


class LoopDrift(Quantity, frozen=True, kw_only=True, tag="loop-drift"):
    """Bias of the closed loops of [loop], one standard deviation of it, and angle random walk."""

    temperature_degC: Temperature | None = None

    def list_columns(self) -> tuple[Column, ...]:
        return (
            Column("loop_bias", "°/h", "bias of the closed loops"),
            Column("loop_bias_sd", "°/h", "standard deviation of the bias, by the card's uncertain values"),
            Column("loop_random_walk", "°/√h", "angle random walk"),
        )

    def evaluate(self, case: Case) -> tuple[Number, ...]:
        """Return them for the frequency, the 1/Q and the Bryan factor of the design."""
        from studies.loss.damping_law import settled_loss
        from studies.simulation.loop_study import study_loops

        if case.instrument.loop is None:
            raise InputError(f"{case.instrument.path}: the card has no [loop]; add one.")
        T = case.temperature(self.temperature_degC)
        mode = case.mode(2, 0, "solid", T)
        inverse_q, instrument = settled_loss(case.instrument, T)
        found = study_loops(instrument, mode.frequency, inverse_q, mode.bryan_factor)
        total = found.sources[-1]
        return Number(total.bias), Number(total.sd), Number(found.noise["all"][1])
