"""Modes of a resonator of your own: frequencies of a cylinder on its bottom, and what a micrometre of wall changes."""

import hrg

ALLOY = hrg.Elastic(E=191e9, nu=0.29, rho=8110.0)


def solve_cup() -> list[hrg.Mode]:
    """Solve the lowest modes n = 1, 2, 3 of a cup of 25 mm diameter, by shell theory."""
    cup = hrg.cylinder(12.5e-3, 0.6e-3, 18e-3, bottom_thickness=1e-3, clamp_radius=3e-3)
    return [hrg.solve_modes(cup, ALLOY, n, theory="shell", tolerance=1e-4)[0] for n in (1, 2, 3)]


if __name__ == "__main__":
    for mode in solve_cup():
        print(f"n = {mode.harmonic}: {mode.frequency:.2f} Hz, Bryan factor {mode.bryan_factor:.4f}")
        print(f"  d ln f / d ln h = {mode.sensitivities.thickness:+.3f}, d ln f / d ln E = {mode.sensitivities.E:+.3f}")
