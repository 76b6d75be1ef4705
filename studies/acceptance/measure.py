"""A value with its interval for every quantity that the records give."""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from compensation.arrays import Array
from compensation.decimation import average_blocks
from compensation.linearity import measure_nonlinearity, same_rate
from compensation.noise_regression import ColouredFit, fit_coloured
from compensation.regression import LinearFit, fit_linear
from compensation.ringdown.answer import Estimate
from compensation.ringdown.trace import analyse_trace
from compensation.stability import AllanDeviation, NoiseCoefficients
from studies.acceptance.lags import MOST, PARTS, jackknife, lags_and_without, left_by, slope_behind
from studies.acceptance.runs import temperature_column
from studies.errors import InputError, naming
from studies.fits.ringdown import Decay
from studies.record import Record
from studies.record.misread import named
from studies.record.one_law import Course
from studies.record.stability import read_stability

FEWEST = 20  # averages of a run over temperature that are not made wider
SENSITIVITIES = "temperature", "rate of temperature"
MOST_BENDS = 2  # of the bias over temperature: a parabola, a cubic
BLOCK = 100.0  # averaging of the output over temperature (s)
WARM_BLOCK = 10.0
HOLD_PARTS = 4  # of a constant rate, whose means tell its noise
MOST_POINTS = 100_000
CONFIDENCE = 0.9
LONG = 0.5  # of the longest drift record: a shorter one does not tell its slow noise
YEAR = 365.25 * 86400.0


@dataclass(frozen=True)
class Measured:
    """A value with the ends of its interval, of which None are not known, and the files that it came from."""

    value: float
    low: float | None
    high: float | None
    sources: tuple[str, ...]


Found = dict[str, Measured]


def within(
    value: float, sd: float, sources: Sequence[str], free: float = np.inf, least: float = -np.inf, scale: float = 1.0
) -> Measured:
    """Return a value, times `scale`, with the interval of its standard error of `free` degrees of freedom, not below `least`."""
    spread = 0.5 + CONFIDENCE / 2
    reach = sd * float(scipy.special.ndtri(spread) if free == np.inf else scipy.special.stdtrit(free, spread))
    return Measured(value * scale, max(value - reach, least) * scale, (value + reach) * scale, tuple(sources))


def of_fit(fit: LinearFit, place: int, sources: Sequence[str], scale: float = 1.0, shift: float = 0.0) -> Measured:
    """Return a coefficient of a straight fit, plus `shift`, with its interval."""
    value, sd = float(fit.coefficients[place]) + shift, float(fit.standard_errors[place])
    return within(value, sd, sources, fit.degrees_of_freedom, scale=scale)


def measure_drift(records: Sequence[Record], output: str) -> tuple[Found, str, AllanDeviation, NoiseCoefficients]:
    """Bias, its repeatability, and the largest noise coefficients of the long records (12.11), with the record of the largest bias instability."""
    means: list[tuple[float, float]] = []
    for record in records:
        time = record["time_s"]  # a mean is of at least ten rows, and there are at most some thousands of them
        width = max(10 * float(np.median(np.diff(time))), float(time[-1] - time[0]) / 2000)
        blocks = average_blocks(time, {"output": record[output]}, width)
        y = blocks.columns["output"]
        with naming(record.path):
            fit = fit_coloured(np.ones((len(y), 1)), y, ["bias"], [slice(0, len(y))])
        means.append((float(y.mean()), float(np.sqrt(fit.regression.covariance[0, 0]))))
    found: Found = {}
    paths = [record.path for record in records]
    values = np.array([value for value, _ in means])
    if len(records) == 1:
        found["bias_deg_per_h"] = within(*means[0], paths)
    else:
        spread, free = float(values.std(ddof=1)), len(values) - 1
        found["bias_deg_per_h"] = within(float(values.mean()), spread / math.sqrt(len(values)), paths, free)
        found["bias_repeatability_deg_per_h"] = _deviation(spread, free, paths)
    lasts = [float(np.ptp(record["time_s"])) for record in records]
    long = [record for record, own in zip(records, lasts, strict=True) if own >= LONG * max(lasts)]
    each = [(record.path, *_stability(record, output)) for record in long]
    angle = [within(one.N, one.N_uncertainty, [path], least=0.0, scale=1 / 60) for path, _, one in each]
    rate = [within(one.K, one.K_uncertainty, [path], least=0.0, scale=60.0) for path, _, one in each]
    flicker = [Measured(*allan.bias_instability, (path,)) for path, allan, _ in each]
    found["angle_random_walk_deg_per_rt_h"] = largest(angle)
    found["rate_random_walk_deg_per_h_per_rt_h"] = largest(rate)
    found["bias_instability_deg_per_h"] = largest(flicker)
    return found, *max(each, key=lambda one: one[1].bias_instability[0])


def largest(found: Sequence[Measured]) -> Measured:
    """Return the largest of a quantity over records, each of which is to keep a limit: of values, and of ends of intervals, where all have them."""
    lows, highs = ([end for one in found if (end := getattr(one, name)) is not None] for name in ("low", "high"))
    value = max(found, key=lambda one: one.value)
    return Measured(
        value.value,
        max(lows) if len(lows) == len(found) else value.low,
        max(highs) if len(highs) == len(found) else None,
        value.sources,
    )


def _stability(record: Record, output: str) -> tuple[AllanDeviation, NoiseCoefficients]:
    time, y = record["time_s"], record[output]
    step = float(np.median(np.diff(time)))
    width = step * math.ceil(len(y) / MOST_POINTS)
    with naming(record.path):
        if width > step or not np.isfinite(y).all() or np.ptp(np.diff(time)) > 1e-3 * step:
            y = average_blocks(time, {"output": y}, width).columns["output"]
        found = read_stability(y, width, CONFIDENCE)
        return found.allan, found.noise


def _deviation(deviation: float, free: int, sources: Sequence[str]) -> Measured:
    """Return a standard deviation with the χ² interval of its degrees of freedom."""
    low, high = (float(scipy.special.chdtri(free, 0.5 - side * CONFIDENCE / 2)) for side in (1, -1))
    return Measured(deviation, deviation * math.sqrt(free / low), deviation * math.sqrt(free / high), tuple(sources))


def measure_temperature(records: Sequence[Record], output: str) -> Found:
    """Bias over temperature and its rate, fitted together, what they leave, and the frequency's slope (12.8), each at the mean temperature.

    The bias bends over temperature where that lowers m ln SSE + p ln m of whitened rows: a bend that is left out is told as a rate.

    The temperature is that of the resonator, which lags as the frequency shows, or where it is not measured as the bias does.
    """
    whole = sum(float(np.ptp(record["time_s"])) for record in records)
    followed = [_follow(record, whole / MOST) for record in records if record.has_values("frequency_Hz")]
    paths = [record.path for record in records]
    found: Found = {}
    lags, without = (0.0, 0.0), list[tuple[float, float]]()
    if followed:
        lags, without, value, sd = slope_behind(followed)
        scale = 1e6 / float(np.mean(np.concatenate([run.output for run in followed])))
        found["frequency_temperature_slope_ppm_per_K"] = within(value, sd, paths, PARTS - 1, scale=scale)
    courses = [_course(record, output, BLOCK) for record in records if record.has_values(output)]
    if courses:
        y = np.concatenate([run.output for run in courses])
        ends = np.cumsum([0, *(len(run.time) for run in courses)])
        runs = [slice(int(a), int(b)) for a, b in itertools.pairwise(ends)]
        names = [*(f"offset {k + 1}" for k in range(len(runs))), *SENSITIVITIES]
        if not followed:
            late, parts = lags_and_without(courses, _behind)
            gain = len(y) * math.log(left_by(courses, _behind, lags) / left_by(courses, _behind, late))
            if gain > 2 * math.log(len(y)):  # both pay for themselves
                lags, without = late, [own for _, own in parts]

        def fit_behind(lags: Sequence[float], bends: int = 0, theta: float | None = None) -> ColouredFit:
            X, powers = _behind(courses, lags, bends), range(2, 2 + bends)
            with naming(", ".join(paths)):
                return fit_coloured(X, y, [*names, *(f"temperature^{n}" for n in powers)], runs, theta)

        levels = len(np.unique(np.concatenate([run.drive for run in courses])))
        most = max(min(MOST_BENDS, levels - 2), 0)
        theta = fit_behind(lags, most).theta  # a bend that is left is no noise
        bent = [fit_behind(lags, bends, theta).regression.sum_of_squares for bends in range(most + 1)]
        m = len(y)
        bends = int(np.argmin([m * math.log(max(own, 1e-300)) + p * math.log(m) for p, own in enumerate(bent)]))
        fit, chosen = fit_behind(lags), fit_behind(lags, bends).regression
        both = slice(len(runs), len(names))
        b, free = chosen.coefficients[both], max(len(y) - len(names) - bends, 1)
        by_lags = (
            jackknife([fit_behind(own, bends).regression.coefficients[both] for own in without]) if without else 0.0
        )
        sd_of = np.hypot(chosen.standard_errors[both], by_lags)
        found["bias_temperature_slope_deg_per_h_per_K"] = within(float(b[0]), float(sd_of[0]), paths, free)
        found["bias_temperature_rate_deg_per_h_s_per_K"] = within(float(b[1]), float(sd_of[1]), paths, free)
        left = [fit.residuals[rows] - fit.residuals[rows].mean() for rows in runs]
        size = float(np.sqrt(np.mean(np.concatenate(left) ** 2)))
        found["bias_temperature_residual_deg_per_h"] = _deviation(size, free, paths)
    return found


def _behind(runs: Sequence[Course], lags: Sequence[float], bends: int = 1) -> Array:
    """Columns of a bias behind lags: an offset of each run, the temperature, its rate, and powers of it."""
    followed = [run.behind(*lags) for run in runs]
    T = np.concatenate(followed)
    curves = (scipy.interpolate.CubicSpline(run.time, own) for own, run in zip(followed, runs, strict=True))
    slope = np.concatenate([curve(run.time, 1) for curve, run in zip(curves, runs, strict=True)])
    offsets = scipy.linalg.block_diag(*(np.ones((len(own), 1)) for own in followed))
    return np.column_stack([offsets, T - T.mean(), slope, *((T - T.mean()) ** n for n in range(2, 2 + bends))])


def _temperature_of(record: Record) -> str:
    column = temperature_column(record)
    if column is None:
        raise InputError(f"{record.path}: a test over temperature needs a temperature column.")
    return column


def _check_length(record: Record, blocks: Array) -> None:
    if len(blocks) < 10:
        need = f"a test over temperature needs ten averages of {BLOCK:g} s or more"
        raise InputError(f"{record.path}: {need}; record longer.")


def _follow(record: Record, width: float) -> Course:
    """Return the averages of a record's frequency and temperature, over `width` (s) where that is more than usual and leaves enough."""
    return _course(record, "frequency_Hz", max(BLOCK, min(width, float(np.ptp(record["time_s"])) / FEWEST)))


def _course(record: Record, output: str, width: float) -> Course:
    """Return averages over `width` (s) of an output and of the temperature."""
    names = _temperature_of(record), output
    with naming(record.path):
        blocks = average_blocks(record["time_s"], {name: record[name] for name in names}, width)
    _check_length(record, blocks.time)
    return Course(blocks.time, *(blocks.columns[name] for name in names))


def measure_scale(record: Record) -> Found:
    """Scale factor, its nonlinearity and asymmetry, from the means of constant rates (12.9); what repeats at a rate is nonlinearity and no error of the line."""
    applied, measured = record["rate_deg_per_s"], record["measured_rate_deg_per_s"]
    keep = np.isfinite(applied) & np.isfinite(measured)
    applied, measured = applied[keep], measured[keep]
    rounded = same_rate(applied)
    edges = [0, *(np.flatnonzero(np.diff(rounded) != 0) + 1), len(rounded)]
    levels = []
    for begin, end in itertools.pairwise(edges):
        settled = slice(begin + (end - begin) // 4, end)  # the first quarter is the table's and the filter's
        y = measured[settled]
        if len(y) >= 8:
            parts = [float(part.mean()) for part in np.array_split(y, HOLD_PARTS)]
            levels.append((float(applied[settled].mean()), float(y.mean()), float(np.var(parts, ddof=1)) / HOLD_PARTS))
    rates, means, squares = np.array(levels).T if levels else np.zeros((3, 0))
    if len(np.unique(same_rate(rates))) < 3:
        raise InputError(f"{record.path}: a scale factor needs at least three constant rates of eight rows each.")
    full, source = float(np.abs(rates).max()), [record.path]
    sd, free = _error_of_means(rates, means, float(squares.mean()))
    with naming(record.path):
        departure = measure_nonlinearity(rates, means)
    found = {"scale_factor_nonlinearity_ppm": within(departure, sd / full, source, free, least=0.0, scale=1e6)}
    line = np.linalg.pinv(np.column_stack([rates, np.ones_like(rates)]))[0]
    gain = float(line @ means)
    for name, times in (("measured_rate_deg_per_s", 1 / (gain or np.nan)), ("rate_deg_per_s", gain)):
        if misread := named(name, times):
            raise InputError(
                f"{record.path}: {name} {misread[0]}: measured_rate_deg_per_s changes {gain:.4g} times as much as rate_deg_per_s. {misread[1]}."
            )
    error = gain - 1.0
    found["scale_factor_error_ppm"] = within(error, sd * float(np.linalg.norm(line)), source, free, scale=1e6)
    if rates.min() < 0 < rates.max():
        # ΔK/K of b + K Ω + ½ ΔK |Ω|: the scale factor of positive rates less that of negative ones, over their mean (IEEE 528)
        both = np.linalg.pinv(np.column_stack([rates, np.abs(rates) / 2, np.ones_like(rates)]))[:2]
        K, difference = (float(own) for own in both @ means)
        asymmetry = within(difference / K, sd * float(np.linalg.norm(both[1])) / abs(K), source, free, scale=1e6)
        found["scale_factor_asymmetry_ppm"] = asymmetry
    return found


def _error_of_means(rates: Array, means: Array, noise: float) -> tuple[float, int]:
    """Return the standard error of a mean and its degrees of freedom: of repeated rates where they scatter more than `noise`, the variance from within the holds, lets expect (5 %), else of both."""
    _, kind = np.unique(same_rate(rates), return_inverse=True)
    apart = means - (np.bincount(kind, means) / np.bincount(kind))[kind]
    within_holds, repeated = (HOLD_PARTS - 1) * len(rates), len(rates) - int(kind.max()) - 1
    squares = float(apart @ apart)
    if repeated and squares > repeated * noise * scipy.special.fdtri(repeated, within_holds, 0.95):
        return math.sqrt(squares / repeated), repeated
    return math.sqrt((squares + within_holds * noise) / (repeated + within_holds)), repeated + within_holds


def measure_warm_up(record: Record, output: str, band: float | None) -> tuple[Found, float]:
    """Time from power-on until the means over 50 s stay within the band of the final output, the last quarter's mean (12.5, 12.6)."""
    step = float(np.median(np.diff(record["time_s"])))
    width = max(WARM_BLOCK, 7 * step)
    blocks = average_blocks(record["time_s"], {"output": record[output]}, width)
    y, t = blocks.columns["output"], blocks.time - record["time_s"][0]
    if len(y) < 20:
        raise InputError(f"{record.path}: a warm-up needs at least twenty averages of {width:g} s; record longer.")
    scatter = float(np.std(np.diff(y[3 * len(y) // 4 :]))) / math.sqrt(2)
    band = band if band is not None else 3 * scatter
    final = float(y[3 * len(y) // 4 :].mean())
    departure = np.abs(np.convolve(y - final, np.full(5, 0.2), mode="valid"))
    t = t[2:-2]
    margin = 2 * scatter / math.sqrt(5)

    def last_above(level: float) -> float:
        above = np.flatnonzero(departure > level)
        return float(t[above[-1]] + width / 2) if len(above) else 0.0

    value, low, high = (last_above(level) for level in (band, band + margin, band - margin))
    if value > 0.75 * t[-1]:
        raise InputError(
            f"{record.path}: the output leaves the band of ±{band:g} °/h in the last quarter of the record: the gyro has not"
            " warmed up, or the band is narrower than the noise. Record longer or widen [warm_up] band_deg_per_h."
        )
    return {"warm_up_time_s": Measured(value, max(low - width / 2, 0.0), high + width / 2, (record.path,))}, band


def measure_run_down(record: Record) -> Found:
    """Decay time of the amplitude with the drive off, and Q = π f τ (12.14)."""
    if "vibration_amplitude_V" not in record:
        raise InputError(f"{record.path}: a run-down needs the column vibration_amplitude_V.")
    frequency = float(np.nanmean(record["frequency_Hz"])) if "frequency_Hz" in record else None
    with naming(record.path):
        found = analyse_trace(record["time_s"], record["vibration_amplitude_V"], frequency)
    return _run_down(found.estimates, record.path)


def measure_decays(decays: Sequence[Decay]) -> Found:
    """The same of free decays as they were recorded (12.14), of the one that runs down fastest."""
    for decay in decays:
        if "decay_time_s" not in decay.estimates:
            raise InputError(f"{decay.path}: two lines in a spectrum are not a run-down; give a decay over time.")
    every = [_run_down(decay.estimates, decay.path) for decay in decays]
    return min(every, key=lambda found: found["run_down_time_s"].value, default={})


def _run_down(estimates: Mapping[str, Estimate], path: str) -> Found:
    tau, loss = (estimates.get(name) for name in ("decay_time_s", "inverse_q"))
    found = {"run_down_time_s": within(tau.value, tau.sd, [path])} if tau else {}
    return found | ({"quality_factor": within(1 / loss.value, loss.sd / loss.value**2, [path])} if loss else {})


def measure_seal(records: Sequence[Record]) -> Found:
    """Growth of 1/Q per year, the change with temperature fitted beside it (an indication for 12.3; the tracer gas is not replaced)."""
    rows, sources = [], []
    dated = [record for record in records if record.start is not None and "inverse_q" in record]
    for record in dated:
        column, loss = temperature_column(record), record["inverse_q"]
        T = record[column] if column is not None else np.zeros(len(loss))
        assert record.start is not None
        for part in np.array_split(np.flatnonzero(np.isfinite(loss) & np.isfinite(T)), 5):
            if len(part):
                at = record.start.timestamp() + float(record["time_s"][part].mean())
                rows.append((at, float(T[part].mean()), float(loss[part].mean())))
        sources.append(record.path)
    if len(dated) < 2:
        return {}
    at, T, loss = np.array(rows).T
    if np.ptp(at) < 86400 or len(rows) < 5:
        return {}
    X, names = ((at - at.mean()) / YEAR)[:, None], ["year"]
    if np.ptp(T) > 0.5:
        X, names = np.column_stack([X, T - T.mean()]), ["year", "temperature"]
    return {"inverse_q_trend_per_year": of_fit(fit_linear(X, loss, names), 1, sources)}
