"""Blind devices for `hrg calibrate CARD modes.csv`: does the 90 % interval hold in nine of ten, and how close are E and wall?

    python -m tests.benchmarks.mode_inversion [DEVICES] [HARMONIC.INDEX ...]

Devices are drawn from the card's priors, solved by NGSolve in the (r, z) plane (order 9; within 1e-7 of the exact frequency), and read
with errors of 1e-6. The inversion sees them through an interpolant over Poisson's ratio and wall of the workbench's own solver, to
1e-7 as in the command. A device takes some six seconds. Of 200 devices the intervals held
in 90.6 % (modulus 90, ratio 90, wall 92 and 90 %); at the 90th percentile E was off by 1.1e-5, the wall by 0.03 µm.
"""

import sys

import numpy as np

from shell.interpolation import Exploration
from studies.calibration.priors import to_standard
from studies.instrument.card import build_instrument
from studies.inversion.invert import _estimates, _fit, _priors
from studies.inversion.model import ModeModel, Which
from tests.benchmarks import fourier_ngsolve
from tests.benchmarks.finite_ngsolve import dome

CARD = {
    "schema": "hrg.card/1",
    "name": "glass-dome",
    "resonator": {
        "shape": "hemisphere",
        "radius_mm": 15.0,
        "thickness_mm": [[0.0, {"value": 0.9, "sd": 0.009}], [1.0, {"value": 0.9, "sd": 0.009}]],
        "support": "free",
    },
    "material": {
        "name": "glass",
        "youngs_modulus_GPa": {"value": 72.6, "relative_sd": 0.01},
        "poisson_ratio": {"value": 0.17, "sd": 0.005},
        "density_kg_m3": 2203.0,
    },
}
NOISE = 1e-6
WIDTH = 4.0
MODULUS = "material.youngs_modulus_GPa"


class Interpolated(ModeModel):
    """The model of a card by a sparse polynomial in all coordinates but the modulus, which scales f exactly."""

    def build(self, modes: list[Which]) -> "Interpolated":
        """Solve the nodes: values between ±4 prior standard deviations."""
        free = [k for k, value in enumerate(self.priors.values) if "youngs" not in value.name]

        def spread(x: np.ndarray) -> np.ndarray:
            u = np.zeros(len(self.priors.values))
            u[free] = WIDTH * x
            return u

        self.__dict__["free"], self.__dict__["polynomials"] = free, {}
        for mode in modes:
            nodes = Exploration(lambda x, m=mode: self.solve([m], spread(x)), len(free))
            nodes.refine(2e-8, 150)
            print(f"n = {mode.harmonic}, index {mode.index}: {len(nodes.surpluses)} solves", flush=True)
            self.__dict__["polynomials"][mode] = nodes.polynomial()
        return self

    def solve(self, modes, u):
        """Return ln f by the solver."""
        return super().predict(modes, u)[0]

    def predict(self, modes, u):
        """See `ModeModel`."""
        x = (u[self.free] / WIDTH)[None]
        stiff = np.log(self.priors.at(u)[MODULUS] / self.priors.at(0 * u)[MODULUS]) / 2
        return np.array([self.polynomials[m](x)[0, 0] + stiff for m in modes]), np.full(len(modes), 5e-8)

    def derivatives(self, modes, u):
        """See `ModeModel`."""
        x = (u[self.free] / WIDTH)[None]
        J = np.zeros((len(modes), len(u)))
        for axis, k in enumerate(self.free):
            J[:, k] = [self.polynomials[m](x, axis)[0, 0] / WIDTH for m in modes]
        J[:, self.priors.names.index(MODULUS)] = 0.5 * self.priors.slopes(u)[0, 0] / self.priors.at(u)[MODULUS]
        return J


R, H = 15e-3, 0.9e-3
ORDER, SIZE = 9, 1.6e-3


def other_solver(mesh, card, T: float, mode: Which, near: float) -> float:
    """The frequency (Hz) nearest to `near`: a dome of even wall whose mesh is moved to that of the card."""
    import ngsolve as ng

    body, elastic = card.at(T)
    (_, pole), (_, rim) = body.thickness
    rho = ng.sqrt(ng.x**2 + ng.y**2)
    wall = pole + (rim - pole) * ng.atan2(ng.x, ng.y) / (np.pi / 2)
    stretch = (rho - R) * (wall / H - 1) / rho
    moved = (stretch * ng.x, stretch * ng.y)
    found, _ = fourier_ngsolve.modes(mesh, elastic, mode.harmonic, 2, ORDER, 1.0005 * near, moved=moved)
    return float(found[np.argmin(abs(found - near))])


def main(devices: int, named: list[str]) -> None:
    """Print how often the intervals hold, and how far the values are off, at the median and the 90th percentile."""
    card = build_instrument(CARD)
    T = card.reference_temperature
    modes = [Which(int(n), int(k), T) for n, k in (name.split(".") for name in named)]
    priors = _priors(card, ())
    rng, mesh = np.random.default_rng(20), fourier_ngsolve.section(dome(R, H), [], SIZE, [])
    model = Interpolated(card, priors, 1e-7).build(modes)
    start = model.derivatives(modes, np.zeros(len(priors.values)))
    held, off = [], []
    for device in range(devices):
        true = {value.name: value.draw(rng) for value in priors.values}
        place = np.linalg.solve(priors.root, [to_standard(value, true[value.name]) for value in priors.values])
        near = np.exp(model.predict(modes, place)[0])
        f = [other_solver(mesh, card.with_values(true), T, m, one) for m, one in zip(modes, near, strict=True)]
        y = np.log(f) + NOISE * rng.standard_normal(len(modes))
        fit = _fit(model, modes, y, np.full(len(modes), NOISE), start)
        found = _estimates(priors, fit.point, fit.covariance)
        held.append([one.low <= true[one.parameter] <= one.high for one in found])
        off.append([abs(one.value - true[one.parameter]) for one in found])
        if device % 20 == 19:
            share = 100 * np.mean(held, axis=0)
            print(
                f"{device + 1} devices: intervals hold in {np.mean(held):.1%}; by value {np.round(share)} %", flush=True
            )
    for name, middle, most in zip(priors.names, np.median(off, axis=0), np.percentile(off, 90, axis=0), strict=True):
        print(f"{name}: off by {middle:.2g} at the median, {most:.2g} at the 90th percentile")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200, sys.argv[2:] or ["2.0", "3.0", "4.0", "5.0", "0.0", "1.0"])
