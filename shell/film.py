r"""A thin film on the faces of the shell, a coating or electrodes: what its stiffness and its mass do to a frequency.

A film of thickness t ≪ h follows the face it lies on. Its strain energy is that of plane stress at the face, its mass moves
with the face, and the shape of the mode is stationary, so that to first order in t/h

    δω² / ω² = Σ_faces ∫ t [σ_f(ε) : ε - ω² ρ_f u²] dA / ω² ∫ ρ u² dV.

A film of the resonator's own material is a thicker wall (Hadamard's formula). What is left out is of the order (t/h)².
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from shell.elastic import Elastic
from shell.errors import ShellError
from shell.modes import Mode
from shell.quadrature import Array
from shell.solution import surface_energies, total
from shell.system import ShellGroup

Faces = Literal["inner", "outer", "both"]
THICKEST = 0.05  # t/h up to which the first order is meant


@dataclass(frozen=True)
class Film:
    """A film on the shell; stem and root stay bare.

    Attributes
    ----------
    elastic : E, ν, ρ of the film.
    thickness : t in m, a number or a function of the position 0 ... 1 on the meridian.
    faces : "inner", "outer" or "both".
    """

    elastic: Elastic
    thickness: float | Callable[[Array], ArrayLike]
    faces: Faces = "both"

    def __post_init__(self) -> None:
        if self.faces not in ("inner", "outer", "both"):
            raise ShellError(f"a film lies on the inner face, the outer or both, not {self.faces!r}.")

    def at(self, position: Array) -> Array:
        """The thickness (m) at positions on the meridian."""
        given = self.thickness(position) if callable(self.thickness) else self.thickness
        t = np.broadcast_to(np.asarray(given, dtype=float), position.shape)
        if not np.all(np.isfinite(t) & (t >= 0)):
            raise ShellError("the thickness of a film is 0 or positive everywhere.")
        return t


def film_shift(mode: Mode, film: Film) -> float:
    """Relative change of the mode's frequency by a film.

    Raises
    ------
    ShellError
        Where the film is no film: more than a twentieth of the wall.
    """
    solution = mode.solution
    if solution is None:
        raise ShellError("Rayleigh's closed form carries no energies: use theory solid or shell.")
    on = {"inner": (0,), "outer": (1,), "both": (0, 1)}[film.faces]
    changed = 0.0
    for number, group in enumerate(solution.system.groups):
        if not isinstance(group, ShellGroup):
            continue
        wall = group.place.section.thickness
        t = film.at(group.table.position)
        if np.any(t > THICKEST * wall):
            raise ShellError(
                f"a film of {float(np.max(t / wall)):.2g} of the wall is too thick for the first-order theory of films (at most {THICKEST:g})."
            )
        moved = sum(surface_energies(solution, number, film.elastic))
        changed += float(np.sum(moved[..., on] * (2 * t / wall)[..., None]))  # type: ignore[index]
    return changed / (2 * solution.eigenvalue * total(solution.kinetic))
