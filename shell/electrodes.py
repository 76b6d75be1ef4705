r"""Electrodes over a face of the shell: electrostatic softening and split of a harmonic pair.

An electrode at a gap g pulls with the energy -½ ε₀ V²/(g - w) per area, w the displacement of the face towards it. Its second
derivative is a spring of negative stiffness, -ε₀ V²/g³ per area, which lowers the pair and, by its wave 2n, splits it:

    δ(ω²) = -Σ_j V_j² ∫ ε₀/g³ w² dA / ∫ ρ |u|² dV,

for each orientation of the mode (shell.imperfection.pair). For a full ring of electrodes this is δ(ω²)/ω² =
-ε₀ V²/(g³ ρ h ω²) times the mode factor h ∫ w² dA / ∫ |u|² dV. The waves of the gap enter through 1/g³, all orders of it. The frequency
is the root, f √(1 + δ(ω²)/ω²): exact where the springs leave the shape of the mode, which on a shell moves it by less than 1e-2 (δ(ω²)/ω²)².
The stress by the static pull, ½ ε₀ V²/g² per area, and the field's curvature between round faces are left out: of the softening of a ring's
n = 2 they take 1.5 g/R and give back 0.5 g/R (less where the electrodes stand around it), far less than a gap's own uncertainty makes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import pi

import numpy as np

from shell.cross_section import cut
from shell.errors import ShellError
from shell.imperfection.field import NOTHING, Complex, Field, values_around
from shell.imperfection.pair import Pair
from shell.imperfection.split import Split, shift_of
from shell.quadrature import Array, gauss
from shell.resonator import FaceName

VACUUM = 8.8541878188e-12  # ε₀, F/m (CODATA 2022)
PIECE = pi / 12  # longest piece of an electrode that is integrated at once, rad


@dataclass(frozen=True)
class Electrode:
    """A patch over the face: azimuth of its middle and width (rad), the positions (0 ... 1) between which it lies, its volts."""

    azimuth: float
    width: float
    voltage: float
    first: float = 0.0
    last: float = 1.0


def ring_of_electrodes(
    count: int, coverage: float, voltage: float | Sequence[float], azimuth: float = 0.0, first: float = 0.0,
    last: float = 1.0,
) -> tuple[Electrode, ...]:  # fmt: skip
    """Equal electrodes around, the first one centred at `azimuth`, which cover a share of the circle."""
    if not (count >= 1 and 0 < coverage <= 1):
        raise ShellError(f"electrodes cover a share of the circle above 0 and up to 1, not {coverage:g}.")
    volts = np.broadcast_to(np.asarray(voltage, dtype=float), (count,))
    width = 2 * pi * coverage / count
    return tuple(Electrode(azimuth + 2 * pi * k / count, width, float(v), first, last) for k, v in enumerate(volts))


@dataclass(frozen=True, eq=False)
class Electrodes:
    """Electrodes with their gap."""

    pair: Pair  # the mode that feels them
    electrodes: tuple[Electrode, ...]  # patches with their voltages
    gap: float  # mean gap, m
    # relative departure of the gap over the shell, g = gap (1 + departure); its waves 1, 2, ... are the gap harmonics
    departure: Field = NOTHING
    face: FaceName = "inner"  # the face that they look at

    def __post_init__(self) -> None:
        if not self.gap > 0:
            raise ShellError(f"the gap must be positive, not {1e6 * self.gap:g} µm.")
        size = self.pair.resonator.size
        if self.gap > 0.2 * size:
            raise ShellError(f"a gap of {1e3 * self.gap:g} mm is too wide for {1e3 * size:g} mm of radius: is it in µm?")  # fmt: skip
        for one in self.electrodes:
            if not (one.width > 0 and 0 <= one.first < one.last <= 1):
                raise ShellError("an electrode has a positive width and lies between 0 <= first < last <= 1.")

    @property
    def voltages(self) -> Array:
        """Of every electrode, V."""
        return np.array([one.voltage for one in self.electrodes])

    @cached_property
    def per_square_volt(self) -> tuple[Array, Complex]:
        """Mean and z of δ(ω²)/ω² (`Split.of_squares`) per V² on each electrode."""
        n = self.pair.mode.harmonic
        means, waves = [], []
        for one in self.electrodes:
            area, w, theta, weight, gap = self._patch(one)
            spring = -VACUUM / gap**3 * (area * w**2)[:, None] * weight / (pi * self.pair.scale)
            # of the two orientations ∫ spring cos² nθ: the mean of the two and the wave between them
            means.append(float(spring.sum()) / 2)
            waves.append(complex((spring * np.exp(2j * n * theta)).sum()) / 2)
        return np.array(means), np.array(waves)

    @property
    def mean(self) -> float:
        """Mean δ(ω²)/ω² by the voltages."""
        return float(self.per_square_volt[0] @ self.voltages**2)

    def soften(self) -> Split:
        """The pair under the voltages."""
        if self._bearing(10) < 1.0 and self.pull_in < 1.0:  # a few places tell where the voltage is far from it
            raise ShellError(
                f"the electrodes pull in the shell: {self.voltages.max():g} V is {1 / self.pull_in:.3g} times the pull-in voltage at "
                f"a gap of {1e6 * self.gap:g} µm. Lower the voltage or widen the gap."
            )
        mode, z = self.pair.mode, complex(self.per_square_volt[1] @ self.voltages**2)
        return Split.of_squares(mode.harmonic, mode.frequency, self.mean, z)

    @cached_property
    def pull_in(self) -> float:
        """Factor by which all voltages can grow before the shell, bending in this mode, is pulled onto an electrode.

        The largest s with a solution of K q = s² F(q), F = ½ ∫ ε₀ V² w/(g - q w)² dA; √(8/27) of the balance for a small one.
        """
        return float(np.sqrt(self._bearing(200)))

    def _bearing(self, steps: int) -> float:
        """Return the largest s² of `pull_in` at the places that part the way into so many steps."""
        patches = [(one.voltage, *self._patch(one)) for one in self.electrodes if one.voltage]
        if not patches:
            return float("inf")
        n = self.pair.mode.harmonic
        stiffness = pi * self.pair.scale  # ∫ ρ |u|² dV ω² of the eigenvector as it is scaled
        largest = max(float(abs(w).max()) for _, _, w, *_ in patches)
        travel = np.arange(1, steps) / steps * self.gap / largest
        best = np.inf
        for turn in {round(one.azimuth % (pi / n), 9) for one in self.electrodes if one.voltage}:
            for sign in (1.0, -1.0):
                force = np.zeros_like(travel)
                for volts, area, w, theta, weight, gap in patches:
                    shape = sign * w[:, None] * np.cos(n * (theta - turn))
                    left = np.maximum(gap - travel[:, None, None] * shape, 1e-9 * gap)
                    force += VACUUM / 2 * volts**2 * (shape * area[:, None] * weight / left**2).sum(axis=(1, 2))
                if np.any(force > 0):
                    best = min(best, float(np.max((stiffness * travel / force)[force > 0])))
        return float(best)

    def ohmic_loss(self, resistance: float) -> float:
        """1/Q by the bias currents through a resistance (Ω) in series with every electrode, mean over the pattern's azimuths.

        The moving face changes the capacitance C by c' = ∫ ε₀ w cos(nθ)/g² dA per displacement; the current i ω V c'/(1 + i ω R C)
        heats R (transduction: Senturia, Microsystem Design, 2001, ch. 6):

            1/Q = Σ_j ω R V_j² c'_j²/(1 + (ω R C_j)²) / (ω² ∫ ρ |u|² dV).
        """
        n, omega, found = self.pair.mode.harmonic, 2 * pi * self.pair.mode.frequency, 0.0
        for one in self.electrodes:
            area, w, theta, weight, gap = self._patch(one)
            patch = VACUUM * area[:, None] * weight
            change = complex((patch * w[:, None] / gap**2 * np.exp(1j * n * theta)).sum())
            delay = omega * resistance * float((patch / gap).sum())
            found += omega * resistance * one.voltage**2 * abs(change) ** 2 / 2 / (1 + delay**2)
        return found / (pi * self.pair.scale)

    def per_volt(self) -> float:
        """df/dV when all voltages change together by the same volts, over f of the perfect pair, 1/V."""
        return float(self.per_square_volt[0] @ self.voltages / np.sqrt(1 + self.mean))

    def per_kelvin(self, gap_expansion: float) -> float:
        """Change of f per kelvin by the electrodes alone, from (1/g) dg/dT, over f of the perfect pair, 1/K."""
        return float(-1.5 * gap_expansion * self.mean / np.sqrt(1 + self.mean))

    def _patch(self, one: Electrode) -> tuple[Array, Array, Array, Array, Array]:
        """Area per radian and w at places along the meridian; azimuths with weights; the gap (places, azimuths)."""
        position, area, w = self._bands[one.first, one.last]
        pieces = max(1, int(np.ceil(one.width / PIECE)))
        x, weights = gauss(8)
        starts = one.azimuth - one.width / 2 + one.width / pieces * np.arange(pieces)[:, None]
        theta = (starts + one.width / pieces * (x + 1) / 2).ravel()
        weight = np.tile(weights * one.width / pieces / 2, pieces)
        gap = np.full((position.size, theta.size), self.gap)
        gap = gap * (1 + values_around(self.departure, self.departure.orders, position, theta))
        if np.any(gap <= 0):
            raise ShellError("the gap closes somewhere: its relative departure falls below -1.")
        return area, w, theta, weight, gap

    @cached_property
    def _bands(self) -> dict[tuple[float, float], tuple[Array, Array, Array]]:
        """Places of every band of the face: position, area per radian that each stands for (m²), displacement out of the material."""
        return {band: self._lay_band(*band) for band in {(one.first, one.last) for one in self.electrodes}}

    def _lay_band(self, first: float, last: float) -> tuple[Array, Array, Array]:
        solution, resonator = self.pair.solution, self.pair.resonator
        side = float(resonator.height_of(self.face))
        x, weights = gauss(12)
        rows: list[tuple[float, float, float]] = []
        for group in solution.system.chains.values():
            for one, two in pairwise(np.array(group.chain.breaks) / resonator.length):
                low, high = max(one, first), min(two, last)
                if high - low < 1e-12:
                    continue
                for at, weight in zip((low + high) / 2 + (high - low) / 2 * x, weights, strict=True):
                    here = cut(resonator, solution.system, float(at), np.array([side]))
                    half = here.section.thickness[0] / 2
                    # per unit of η and of position the volume of the cut is A ρ h/2 ds
                    area = here.table.volume[0, 0, 0] / float(half[0]) * resonator.length * weight * (high - low) / 2
                    rows.append((float(at), float(area), side * float(here.displacements(solution.unknowns)[2, 0])))
        if not rows:
            raise ShellError("the electrodes face a solid root or corner only: place them over the shell.")
        position, area, w = np.array(rows).T
        return position, area, w


ROUNDING = 1e-9  # of what all electrodes do together: nothing
LIGHT = 1e-6  # weight of the voltages beside that of the split they null


@dataclass(frozen=True)
class Trim:
    """Voltages that null a split: of every electrode, V; `left` the z of the split that stays; `shift` of f that they add."""

    voltages: tuple[float, ...]
    left: complex
    shift: float


def trim_voltages(electrodes: Electrodes, z: complex, limit: float) -> Trim:
    """The voltages, of least Σ V⁴ and none above `limit` (V), with which electrodes null a split (z of `Split.squares`).

    They are alike on electrodes that act alike, so that an even ring of one gap is not pulled sideways, Σ V² exp(iθ) = 0.
    """
    from scipy.optimize import lsq_linear

    means, waves = electrodes.per_square_volt
    scale, count = float(abs(waves).max()), len(waves)
    effect, aim = np.array([waves.real, waves.imag]) / scale, -np.array([z.real, z.imag]) / (scale * limit**2)
    sides = np.concatenate([aim, np.zeros(count)])
    sought = lsq_linear(np.vstack([effect, LIGHT * np.eye(count)]), sides, (0.0, 1.0), "bvls", tol=1e-15)
    if float(np.hypot(*(effect @ sought.x - aim))) > 1e-6 * float(np.hypot(*aim)):
        n, hertz = electrodes.pair.mode.harmonic, electrodes.pair.mode.frequency
        if not (most := hertz * along(electrodes, z, limit)):
            raise ShellError(f"no voltage on these electrodes nulls a split along this axis: set others, such as {8 * n} around, or trim by mass.")  # fmt: skip
        raise ShellError(
            f"{limit:g} V on these electrodes null a split of at most {most:.3g} Hz along this axis "
            f"({hertz * reach(electrodes, limit):.3g} Hz along any), not {hertz * abs(z):.4g} Hz: raise the voltage, narrow the gap, "
            "set more or other electrodes, or trim by mass first."
        )
    squares = np.maximum(np.asarray(sought.x), 0.0) * limit**2
    shift = shift_of(electrodes.mean + means @ squares) - shift_of(electrodes.mean)
    return Trim(tuple(np.sqrt(squares).tolist()), complex(waves @ squares + z), float(shift))


def reach(electrodes: Electrodes, limit: float) -> float:
    """The largest relative split that voltages up to a limit (V) can null at any axis: the inscribed circle of Σ x_j z_j, x_j <= V²."""
    _, waves = electrodes.per_square_volt
    normals = np.exp(1j * (np.angle(waves)[:, None] + np.array([-pi / 2, pi / 2]))).ravel()
    support: Array = np.maximum((waves[:, None] * np.conj(normals)).real, 0.0).sum(axis=0)
    whole = float(np.abs(waves).sum())
    return float(support.min()) * limit**2 if support.min() > ROUNDING * whole else 0.0


def along(electrodes: Electrodes, z: complex, limit: float) -> float:
    """The largest relative split along the axis of z that voltages up to a limit (V) can null: 0 <= x_j <= V² with Σ x_j z_j = -t z/|z|, t most."""
    from scipy.optimize import linprog

    _, waves = electrodes.per_square_volt
    scale, turned = float(np.abs(waves).max()), -waves * np.conj(z) / abs(z)
    bounds = [(0.0, 1.0)] * len(waves)
    best = linprog(-turned.real / scale, A_eq=[turned.imag / scale], b_eq=[0.0], bounds=bounds)
    most = -float(best.fun or 0.0)
    return most * scale * limit**2 if most > ROUNDING * len(waves) else 0.0
