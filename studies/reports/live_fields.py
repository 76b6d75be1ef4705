"""What a page computes of the swinging mode beside its frequency: the parts of 1/Q, the split, the base's stress and the outline.

One interpolant over the dimensions (`shell.interpolation`) carries all of it. What depends on the temperature is a Chebyshev
series, whose coefficients are interpolated:

    ln(1/Q_i) = Σ_k L_ik(dimensions) T_k(x),      wave = (f_fast − f_slow)/f exp(2 i n α) = Σ_k w_k(dimensions) T_k(x).

A base that expands otherwise adds s(dimensions) ε(T) to ln f (`shell.law`).
"""

import base64
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from compensation.arrays import Array
from shell.family import SAFETY, Range, unseen_points
from shell.interpolation import Exploration, SparsePolynomial
from shell.layout import Theory
from shell.modes import Mode
from shell.prestress import Prestress
from studies.errors import UNUSABLE_INPUT, InputError
from studies.instrument.card import Instrument
from studies.loss.model import LossModel, loss_model
from studies.reports.webgl import outline_rows
from studies.resonator.law import mount_of
from studies.resonator.splitting import SplitPair, solve_lowest

LOSS_DEGREE, WAVE_DEGREE = 12, 1  # over temperature
THRESHOLD, MOST = 1e-4, 40  # of the grid: surplus of its first number, and designs that are computed
DIGITS = 10  # of a number in the page
SHIFT, ODD = slice(4, 7), slice(4, 10)  # of a row of the outline: the displacement; it and its slope
BETWEEN = 33  # temperatures at which the loss is judged
SMALL = 1e-12  # of a wave: no split


@dataclass(frozen=True, eq=False)
class Fields:
    """Loss, split and outline of one mode over the cube of the dimensions, one block of the interpolant after the other."""

    polynomial: SparsePolynomial
    blocks: dict[str, int]  # how many numbers each has, by name
    errors: dict[str, float]  # of each: ln(1/Q), wave over its largest, ln f by the base, displacements over largest
    losses: tuple[str, ...]  # names of the parts of 1/Q
    per_micrometre: bool  # whether the split is that of 1 µm of the wall's wave 2n, which splits by itself
    missing: tuple[str, ...]  # reasons

    def spell(self) -> dict[str, Any]:
        """Return what the page carries: numbers as text, outlines as single-precision bytes."""
        drawn = self.blocks.get("outline", 0)
        numbers, points = np.split(self.polynomial.surpluses, [self.polynomial.surpluses.shape[1] - drawn], axis=1)
        return {
            "indices": [list(index) for index in self.polynomial.indices],
            "numbers": [[float(f"{x:.{DIGITS}g}") for x in row] for row in numbers],
            "outline": base64.b64encode(points.astype("<f4").tobytes()).decode(),
            "losses": self.losses,
            "waves": self.blocks.get("wave", 0) // 2,
            "base": self.blocks.get("base", 0),
            "per_micrometre": self.per_micrometre,
            "errors": self.errors,
        }


def explore_fields(
    build: Callable[[Array], Instrument], dimensions: int, harmonic: int, theory: Theory, T: Range, nominal: Instrument,
    anchor: bool = False,
) -> Fields:  # fmt: skip
    """Interpolate what can be computed of the nominal design over the cube; `build` makes the instrument of a point."""
    found = _Measures(nominal, harmonic, theory, T, anchor)
    while True:
        grid = Exploration(lambda point: np.concatenate(list(found(build(point)).values())), dimensions)
        unseen = unseen_points(dimensions)
        try:
            grid.refine(THRESHOLD, MOST)
            truth = np.array([grid.function(point) for point in unseen])
            break
        except OutlineDiffers as error:
            found.missing["outline"] = str(error)
    sizes = {name: len(one) for name, one in found(nominal).items()}
    told = np.split(grid.polynomial()(unseen), np.cumsum(list(sizes.values()))[:-1], axis=1)
    known = np.split(truth, np.cumsum(list(sizes.values()))[:-1], axis=1)
    errors = {name: found.error(name, *pair) for name, *pair in zip(sizes, told, known, strict=True)}
    missing = tuple(one for one in found.missing.values() if one)
    return Fields(grid.polynomial(), sizes, errors, found.losses, not nominal.is_imperfect, missing)


class OutlineDiffers(InputError):
    """A design whose outline has other corners than the nominal one."""


@dataclass
class _Measures:
    """What is computed of every design, and why the rest is not."""

    nominal: Instrument
    harmonic: int
    theory: Theory
    T: Range
    anchor: bool
    missing: dict[str, str] = field(default_factory=dict)
    losses: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        mode, self.size = self._mode(self.nominal), self.nominal.resonator.size
        rows = outline_rows(self.nominal.resonator, mode, self.size)
        self.places, self.shape = [_arc(run) for run in rows], np.concatenate(rows)
        try:
            model = self._model(self.nominal)
            parts = model.budget(_nodes(self.T, LOSS_DEGREE)).parts
            absent = [sentence.partition(":")[0] for sentence in model.left_out]
            self.missing["rest"] = f"Not in 1/Q: {', '.join(absent)} (see hrg loss)." if absent else ""
            self.losses = tuple(part.name for part in parts if (part.inverse_q > 0).all())
        except UNUSABLE_INPUT as error:
            self.missing["loss"] = f"There is no Q: {error}"
        try:
            self._wave(self.nominal)
        except UNUSABLE_INPUT as error:
            self.missing["wave"] = f"There is no split: {error}"
        try:
            self.mount = mount_of(self.nominal, self.theory, self.harmonic)
        except UNUSABLE_INPUT as error:
            self.mount, self.missing["base"] = None, f"f is without the stress of the base: {error}"
        if self.mount is None:
            self.missing.setdefault("base", "")

    def __call__(self, instrument: Instrument) -> dict[str, Array]:
        """Return the blocks of a design; the first number steers the interpolant."""
        blocks = {"loss": self._loss, "wave": self._wave, "base": self._base, "outline": self._outline}
        return {name: block(instrument) for name, block in blocks.items() if name not in self.missing}

    def error(self, name: str, told: Array, known: Array) -> float:
        """Return a bound of ln(1/Q), or of wave or displacement over its largest, from designs that the interpolant does not know."""
        if name == "outline":  # displacements are parts of the largest
            return SAFETY * float(abs(told - known).reshape(-1, self.shape.shape[1])[:, SHIFT].max())
        if name == "wave":
            return SAFETY * float(abs(told - known).sum(axis=1).max() / max(np.linalg.norm(known, axis=1).max(), SMALL))
        T = np.linspace(*self.T, BETWEEN)
        if name == "base":
            assert self.mount is not None
            strain = self.mount.strain(self.nominal.material, T)
            return float(SAFETY * abs(told - known).max() * abs(strain).max())
        series = self._log_loss(self._loss(self.nominal)[None], T)
        full = np.log(self._model(self.nominal).budget(T).inverse_q)
        over_designs = abs(self._log_loss(told, T) - self._log_loss(known, T)).max()
        return float(SAFETY * over_designs + abs(series - full).max())

    def _log_loss(self, coefficients: Array, T: Array) -> Array:
        """Return ln(1/Q) (designs, temperatures) by coefficients (designs, numbers)."""
        series = coefficients.reshape(len(coefficients), len(self.losses), -1)
        x = np.linspace(-1, 1, len(T))
        return np.asarray(np.log(np.exp(series @ chebyshev.chebvander(x, series.shape[2] - 1).T).sum(axis=1)))

    def _mode(self, instrument: Instrument, T: float | None = None) -> Mode:
        resonator, elastic = instrument.at(instrument.reference_temperature if T is None else T)
        return solve_lowest(resonator, elastic, self.harmonic, self.theory)

    def _model(self, instrument: Instrument) -> LossModel:
        return loss_model(instrument, self.harmonic, self.theory, self.anchor)

    def _loss(self, instrument: Instrument) -> Array:
        budget = self._model(instrument).budget(_nodes(self.T, LOSS_DEGREE))
        parts = {part.name: part.inverse_q for part in budget.parts}
        return _series(np.log([parts[name] for name in self.losses])).ravel()

    def _wave(self, instrument: Instrument) -> Array:
        if not self.harmonic:
            raise InputError("the mode n = 0 is no pair.")
        if not instrument.is_imperfect:
            wave = {"of": "wall", "order": 2 * self.harmonic, "amplitude_um": 1.0}
            instrument = instrument.with_table("imperfection", {"wave": [wave]})
        nodes = _nodes(self.T, WAVE_DEGREE).tolist()
        found = np.array([SplitPair(instrument, self._mode(instrument, T), T).split.wave for T in nodes])
        return np.concatenate([_series(found.real), _series(found.imag)])

    def _base(self, instrument: Instrument) -> Array:
        """Return ∂ ln f by the strain of the base beyond the resonator's own."""
        return np.array([Prestress(self._mode(instrument)).by_base])

    def _outline(self, instrument: Instrument) -> Array:
        """Return the outline at the same parts of its runs as in the nominal design, and in its sense."""
        runs = outline_rows(instrument.resonator, self._mode(instrument), self.size)
        if len(runs) != len(self.places):
            raise OutlineDiffers("The picture stays: the section's corners differ within the sliders' ranges.")
        sampled = [
            np.column_stack([np.interp(at, _arc(run), column) for column in run.T])
            for run, at in zip(runs, self.places, strict=True)
        ]
        found = np.concatenate(sampled)
        if np.sum(found[:, SHIFT] * self.shape[:, SHIFT]) < 0:
            found[:, ODD] *= -1
        return found.ravel()


def _nodes(T: Range, degree: int) -> Array:
    """Chebyshev's nodes between two temperatures, K; one where they are the same."""
    x = chebyshev.chebpts1(degree + 1) if T[0] < T[1] else np.zeros(1)
    return np.asarray((T[0] + T[1]) / 2 + (T[1] - T[0]) / 2 * x)


def _series(values: Array) -> Array:
    """Chebyshev coefficients (…, nodes) of values (…, nodes) at the nodes."""
    count = values.shape[-1]
    return np.asarray(np.linalg.solve(chebyshev.chebvander(chebyshev.chebpts1(count), count - 1), values.T).T)


def _arc(run: Array) -> Array:
    """Place of every point of a run along it, 0 … 1."""
    length = np.append(0.0, np.cumsum(np.hypot(*np.diff(run[:, :2], axis=0).T)))
    return np.asarray(length / length[-1])
