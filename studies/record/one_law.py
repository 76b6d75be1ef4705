"""An output of some runs by one law of what it follows with a lag: y = c₀ + c₁ x + c₂ x² + sᵣ e^(−t/τ) in run r, τ ẋ + x = T; with further lags, Σ cⱼ xⱼ too."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.memory import follow_lag
from studies.record import Record

LAGS = (0.0, *np.logspace(1.5, 5.0, 12).tolist())  # s
ROWS, FEWEST = 300, 8  # means of all runs, and the fewest of one that counts
NEAR = 2.0  # times shorter or longer than the likeliest of `LAGS` the lag may be


@dataclass(frozen=True)
class Course:
    """Time from the start (s) of one run, what its output follows, and the output."""

    time: Array
    drive: Array
    output: Array
    _behind: dict[tuple[float, ...], Array] = field(default_factory=dict, init=False, repr=False, compare=False)

    def behind(self, *lags: float) -> Array:
        """Return what is followed behind lags (s) in series, settled where the first mean begins; each once, since every law tries the same lags."""
        if lags not in self._behind:
            half, begin = (self.time[1] - self.time[0]) / 2, 1.5 * self.drive[0] - 0.5 * self.drive[1]
            steps, found = np.r_[half, np.diff(self.time)], np.r_[begin, self.drive]
            for lag in lags:
                found = follow_lag(found, steps, lag)
            self._behind[lags] = found[1:]
        return self._behind[lags]

    def earlier(self, by: float) -> "tuple[Course, Course] | None":
        """Return the course with what is followed read later by `by` s, as if it had been logged so late, and the same rows as they are; None where these are too few."""
        then = self.time + by
        both = (then >= self.time[0]) & (then <= self.time[-1])
        if np.count_nonzero(both) < max(FEWEST, self.time.size // 3):
            return None
        time, output = self.time[both] - self.time[both][0], self.output[both]
        drives = np.interp(then[both], self.time, self.drive), self.drive[both]
        return Course(time, drives[0], output), Course(time, drives[1], output)


@dataclass(frozen=True)
class Law:
    """Further lags (s) of a law, what its bend makes at most at one standard deviation of what is followed, of the changes of the output, its longest lag (s), and whether it is a cubic."""

    further: tuple[float, ...] = ()
    bend: float = np.inf
    longest: float = np.inf
    cubic: bool = False


@dataclass(frozen=True, order=True)
class Followed:
    """What the law leaves (rms) with a lag (s), and by how much the run that may lie apart does."""

    left: float
    lag: float
    apart: float = 0.0


ONE_LAG = Law()
LEVELLED = Law(tuple(np.logspace(2.2, 3.6, 5).tolist()), longest=5000.0)
"""With longer lags, and starts that fade with them, runs would have levels of their own."""
ANY_PATH = Law(tuple(np.logspace(2.0, 4.6, 5).tolist()))  # what these lags do together is near to any heat path's work


def course_of(record: Record, drive: str, output: str, runs: int = 1) -> Course | None:
    """Return one of some runs as means of groups of its rows; None where too few are complete."""
    columns = [np.asarray(record[name], dtype=float) for name in ("time_s", drive, output)]
    complete = np.flatnonzero(np.isfinite(columns).all(axis=0))
    if complete.size < FEWEST:
        return None
    groups = np.array_split(complete, min(max(ROWS // runs, 3 * FEWEST), complete.size))
    time, x, y = (np.array([column[rows].mean() for rows in groups]) for column in columns)
    return Course(time - time[0], x, y)


def parabola(runs: Sequence[Course], lags: Sequence[float]) -> Array:
    """Return the columns of a bend and a slope about the mean of what is followed behind lags in series, a level, and what each start was off by."""
    x = np.concatenate([run.behind(*lags) for run in runs])
    x = x - x.mean()
    slowest = max(lags)
    faded = np.concatenate([np.exp((run.time[0] - run.time) / slowest) if slowest else 0.0 * run.time for run in runs])
    return np.column_stack(
        [x**2 - np.mean(x**2), x, np.ones_like(x), *(_rows_of(runs, k) * faded for k in range(len(runs)))]
    )


def follow(runs: Sequence[Course], lag: float, law: Law = ONE_LAG, apart: Sequence[int] = ()) -> Followed:
    """Return what a law leaves with one lag, where some runs have levels of their own."""
    X, y = parabola(runs, [lag]), np.concatenate([run.output for run in runs])
    more = [np.concatenate([run.behind(tau) for run in runs]) for tau in law.further]
    X = np.column_stack(
        [
            X,
            *([X[:, 1] ** 3] if law.cubic else []),
            *(one - one.mean() for one in more),
            *(_rows_of(runs, k) for k in apart),
        ]
    )
    y = y - y.mean()
    found = _solve(X, y)
    most = law.bend * float(y.std()) / max(float(X[:, 1].var()), 1e-300)
    if abs(found[0]) > most:  # else a temperature in another unit bends the law to its needs
        found[0] = np.copysign(most, found[0])
        found[1:] = _solve(X[:, 1:], y - X[:, 0] * found[0])
    return Followed(float(np.std(y - X @ found)), lag, float(found[-1]))


def likeliest(runs: Sequence[Course], law: Law = ONE_LAG, apart: Sequence[int] = ()) -> Followed:
    """Return what a law leaves with the lag that leaves least."""
    best = min(follow(runs, lag, law, apart) for lag in LAGS if lag <= law.longest)
    if not best.lag:
        return best
    ends = np.log(best.lag / NEAR), np.log(min(best.lag * NEAR, law.longest))
    found = scipy.optimize.minimize_scalar(
        lambda u: follow(runs, float(np.exp(u)), law, apart).left,
        bounds=ends,
        method="bounded",
        options={"xatol": 0.01},
    )
    return min(best, follow(runs, float(np.exp(found.x)), law, apart))


def _rows_of(runs: Sequence[Course], k: int) -> Array:
    """1 in the rows of a run, else 0."""
    return np.concatenate([np.full(len(run.time), float(j == k)) for j, run in enumerate(runs)])


def _solve(X: Array, y: Array) -> Array:
    return np.asarray(scipy.linalg.lstsq(X, y, lapack_driver="gelsy", check_finite=False)[0])
