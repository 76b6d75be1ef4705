r"""What double precision loses of the frequency of a thin shell.

The factored stiffness is K + ΔK, with rounding errors ΔK of about 1e-16 of the membrane stiffness, and this is no longer
small beside the bending stiffness, (h/R)² times less. So the vector q that was found is not the one of K, and the forces

    r = ∫ σ(q) : ε dV - ω² ∫ ρ u(q) · u dV

on the functions of the level, which strains tell without loss, do not vanish. They take rᵀ K⁻¹ r off ω² ∫ ρ u² dV, as the
forces on the functions that the level lacks do (shell.surplus). What the iteration left undone is in r as well.
"""

import numpy as np

from shell.eigen import Factor
from shell.solution import Solution, total

THIN = 1e-3  # h/R from which on the loss lies below 1e-13; it grows at most as (R/h)^4


def find_loss(solution: Solution, factor: Factor, density: float) -> float:
    """Relative error of the frequency by the forces that a mode leaves on the functions of its own level.

    Parameters
    ----------
    solution : the mode.
    factor : of the stiffness, over `density`, that it was found with.
    """
    groups = solution.system.groups
    r = solution.system.gather(
        [
            group.table.loads(stress, force)
            for group, stress, force in zip(groups, solution.stress, solution.force, strict=True)
        ]
    )
    answer = factor.solve(np.asfortranarray(r[:, None]))[:, 0] / density
    return float(r @ answer) / (2 * solution.eigenvalue * total(solution.kinetic))
