"""How far the nearest other mode is from a mode, in Hz: parasitic modes close by couple under vibration."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated

from studies.schema.keys import number, says
from studies.sweeps.case import TOLERANCE, Case
from studies.sweeps.quantity import Column, ModeQuantity, Number

if TYPE_CHECKING:
    from shell.modes import Mode


class ModeSeparation(ModeQuantity, frozen=True, kw_only=True, tag="mode-separation"):
    """Signed distance of the nearest other mode, among harmonics 0 ... `highest`, and its harmonic."""

    highest: Annotated[int, number("highest harmonic that is searched", least=0, most=20)] = 4
    each: Annotated[int, number("least number of modes solved for each harmonic", least=1, most=10)] = 2
    tolerance: Annotated[float, number("relative error allowed of the other harmonics", least=1e-8, most=1e-2)] = TOLERANCE  # fmt: skip
    distances: Annotated[bool, says("an extra column for the distance to each of these modes")] = False

    def list_columns(self) -> tuple[Column, ...]:
        stem = self.stem("separation")
        return (
            Column(stem, "Hz", f"distance of the nearest other mode from {self.words}"),
            Column(f"{stem}_nearest_harmonic", "1", f"harmonic of the mode nearest to {self.words}"),
            *(Column(f"{stem}_of_n{n}_{k}", "Hz", f"distance of n = {n}, mode {k} from {self.words}") for n, k in self._others),
        )  # fmt: skip

    def list_modes(self) -> "Iterable[tuple[int, int, float]]":
        """Return its own harmonic, and the others as exactly as asked."""
        return [
            (n, self.each, TOLERANCE if n == self.harmonic else self.tolerance)
            for n in {*range(self.highest + 1), self.harmonic}
        ]

    def evaluate(self, case: Case) -> tuple[Number, ...]:
        from shell.modes import nearest_mode

        at = case.temperature(self.temperature_degC)
        own = self.mode(case)

        def solve(n: int, count: int) -> "tuple[Mode, ...]":
            return case.modes(n, count, self.theory, at, TOLERANCE if n == self.harmonic else self.tolerance)

        nearest = nearest_mode(solve, own, range(self.highest + 1), self.each)
        error = sum(mode.frequency * mode.relative_error_estimate for mode in (own, nearest))
        each = []
        for n, k in self._others:
            found = solve(n, self.each)
            others = [mode for mode in found if (n, mode.index) != (own.harmonic, own.index)]
            each.append(Number(others[k].frequency - own.frequency))
        return (Number(nearest.frequency - own.frequency, error), Number(float(nearest.harmonic), 0.0), *each)

    @property
    def _others(self) -> list[tuple[int, int]]:
        """Harmonic and place of every mode that has a column of its own."""
        if not self.distances:
            return []
        return [(n, k) for n in range(self.highest + 1) for k in range(self.each - (n == self.harmonic))]
