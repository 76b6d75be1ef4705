r"""Measured thickness profiles: hundreds of points become a few polynomials, and elements break only at real kinks.

Between points the thickness is linear by definition, so every point is a kink; most are sampling and noise. A piece of the
meridian takes a polynomial, fitted by least squares; it is cut in two where that describes the points much better, which it
does at kinks and steps and not in noise. What the polynomials leave, δ = h - h_fit, changes a frequency by

    d ln f = Σ S δ/h  +  at most about 5 <(δ/h)²>,

S the mode's own sensitivity to the thickness along the meridian (the second term: a beam of stiffness h³ lies between the
mean of h³ and the mean of h⁻³). Both are part of the error that is stated.
"""

from dataclasses import dataclass, fields, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.polynomial import legendre as series

from shell.quadrature import Array, gauss
from shell.resonator import Resonator
from shell.solution import AlongMeridian

FEW = 8  # knots up to which each is an element's end
DEGREE = 10
SMALL = 4e-9  # <(δ/h)²> that needs no further cut
WORTH = 0.2  # a cut leaves at most this share of the squares
SECOND_ORDER = 5.0


@dataclass(frozen=True, eq=False)
class Rest:
    """What the polynomials leave of the thickness: δ/h at positions 0 ... 1 with their weights (sum 1)."""

    position: Array
    weight: Array
    relative: Array

    @property
    def squares(self) -> float:
        """<(δ/h)²>."""
        return float(self.weight @ self.relative**2)

    def error(self, along: AlongMeridian) -> float:
        """Relative error of a mode's frequency by leaving it out."""
        wide = along.width > 0
        density = along.thickness[wide] / along.width[wide]
        first = np.interp(self.position, along.position[wide], density) @ (self.weight * self.relative)
        return abs(float(first)) + SECOND_ORDER * self.squares


@lru_cache(maxsize=64)
def fit_profile(resonator: Resonator) -> tuple[Resonator, Rest | None]:
    """Fit the thickness by polynomials; return the resonator to solve and the remaining deviation. A few knots are kept as they are."""
    position, value = np.array(resonator.thickness).T
    if resonator.pieces or len(position) - 2 <= FEW:
        return resonator, None
    steps = np.flatnonzero(np.diff(position) == 0) + 1
    bounds = np.concatenate([[0], steps, [len(position)]])
    pieces: list[_Piece] = []
    for first, last in pairwise(bounds):
        pieces += _cut(_fit(position[first:last], value[first:last]))
    knots: list[tuple[float, float]] = []
    for piece in pieces:
        ends = series.legval(np.array([-1.0, 1.0]), piece.coefficients)
        knots += [(float(piece.position[0]), float(ends[0])), (float(piece.position[-1]), float(ends[1]))]
    polynomials = tuple(tuple(piece.coefficients.tolist()) for piece in pieces)
    fitted = replace(resonator, thickness=tuple(knots), pieces=polynomials)
    rest = Rest(*(np.concatenate([vars(piece.rest)[f.name] for piece in pieces]) for f in fields(Rest)))
    return fitted, rest


@dataclass(frozen=True, eq=False)
class _Piece:
    """Points of a profile, the polynomial through them, and what it leaves at Gauss points between them."""

    position: Array
    value: Array
    coefficients: Array
    rest: Rest


def _fit(position: Array, value: Array) -> _Piece:
    x, w = gauss(3)
    widths = np.diff(position)
    at = (position[:-1, None] + widths[:, None] * (x + 1) / 2).ravel()
    weight = (widths[:, None] * w / 2).ravel()
    h = np.interp(at, position, value)
    scaled = 2 * (at - position[0]) / (position[-1] - position[0]) - 1
    degree = min(DEGREE, len(position) - 1)
    coefficients = series.legfit(scaled, h, degree, w=np.sqrt(weight))
    return _Piece(position, value, coefficients, Rest(at, weight, h / series.legval(scaled, coefficients) - 1))


def _cut(piece: _Piece) -> list[_Piece]:
    """The piece, or the pieces that describe its points much better."""
    rest = piece.rest
    if rest.squares <= SMALL * rest.weight.sum() or len(piece.position) < 3:
        return [piece]
    worst = float(rest.position[np.argmax(abs(rest.relative))])
    inner = piece.position[1:-1]
    k = 1 + int(np.argmin(abs(inner - worst)))
    # a kink is seen where the slope jumps most; where its neighbours are smooth, that is the better place to cut
    jumps = abs(np.diff(np.diff(piece.value) / np.diff(piece.position)))
    found = []
    for at in dict.fromkeys((1 + int(np.argmax(jumps)), k, len(piece.position) // 2)):
        halves = _fit(piece.position[: at + 1], piece.value[: at + 1]), _fit(piece.position[at:], piece.value[at:])
        found.append((sum(half.rest.squares for half in halves), halves))
    left, halves = min(found, key=lambda one: one[0])
    if left > WORTH * rest.squares:
        return [piece]
    return [part for half in halves for part in _cut(half)]
