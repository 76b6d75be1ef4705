"""A gyro between corners of a chamber programme, behind one lag: records of the tests' own making."""

from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from studies.calibration.fit import fit
from studies.inference.diagnosis import build_problem
from studies.inference.linear import Linear
from studies.inference.polynomial_card import polynomial_card
from studies.inference.search import Search
from studies.inference.signatures import Signatures
from studies.record import Record

LAG = 1200.0  # s
FINE = 5.0  # s
CYCLE = [(0, 20), (0.5, 20), (2, 55), (3, 55), (5, -15), (6, -15), (7.5, 30), (8, 30)]
BACK = [(0, 30), (0.5, 30), (2.5, -20), (4, -20), (6, 50), (7, 50), (8, 20)]
STAIRS = [(1.35 * step + pause, 12.0 * step - 20.0) for step in range(6) for pause in (0.0, 1.2)]


@dataclass
class Bench:
    """Corners in h and °C, rows every so many seconds, each off its moment by a part of that."""

    corners: list
    sampling: float = 60.0
    seed: int = 1
    jitter: float = 0.0
    rng: np.random.Generator = field(init=False)

    def __post_init__(self):
        self.rng = np.random.default_rng(self.seed)
        hours, levels = np.array(self.corners, dtype=float).T
        self.fine = np.arange(0.0, 3600.0 * hours[-1] + FINE, FINE)
        self._chamber = np.interp(self.fine, 3600.0 * hours, levels)
        even = np.arange(0.0, self.fine[-1], self.sampling)
        self.time = np.sort(even + self.jitter * self.rng.uniform(-0.5, 0.5, even.size) * self.sampling)

    @property
    def chamber(self):
        return np.interp(self.time, self.fine, self._chamber)

    def behind(self, tau, late=0.0):
        """What follows the chamber with a lag, read so many seconds late."""
        keep = np.exp(-FINE / tau)
        half = 0.5 * (1.0 - keep)
        first = self._chamber[0]
        followed, _ = lfilter([half, half], [1.0, -keep], self._chamber, zi=[first * (1.0 - half)])
        return np.interp(self.time - late, self.fine, followed)

    def gyro(self, late=0.0):
        return self.behind(LAG, late)

    @property
    def rate(self):
        return (self.chamber - self.gyro()) / LAG

    def frequency(self, noise, late=0.0):
        x = self.gyro(late) - 20.0
        return 5000.0 * (1.0 + 8e-5 * x + 4e-8 * x**2) + noise * self.rng.standard_normal(x.size)

    def record(self, number=0, keep=slice(None), start=None, **columns):
        table = {"time_s": self.time, "housing_temperature_degC": self.chamber} | columns
        table = {name: values[keep] for name, values in table.items()}
        return Record(table, path=f"run{number}.csv", sha256=f"{number}{self.seed}", start=start)


def searched(records, *named):
    """Return the search beside the polynomial card of records, its bank of the named effects alone, and the model without effects."""
    found = fit(build_problem(polynomial_card(records), records))
    search = Search(Linear.of(found), Signatures.at(found.problem, found.point), found.noise, bank=[])
    search.bank = search.signatures.shapes_of((e, r) for e, r in search.signatures.applicable() if e.name in named)
    return search, search.settle((), found.noise)
