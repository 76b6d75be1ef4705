"""`hrg tcf`: frequency against temperature and its parts."""

from typing import TYPE_CHECKING, Any, Literal

from studies.cli.arguments import FromDegC, ToDegC, lay_temperatures
from studies.cli.output import Answer, answers

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from shell.law import FrequencyLaw

MOST_HARMONIC = 50  # a law of a higher one takes minutes
PARTS = ("E", "nu", "rho", "h", "r", "base")
LEAST = 0.005  # ppm/°C, that is shown


@answers("hrg.tcf/1")
def tcf(
    card: str,
    *,
    from_degC: FromDegC = -20.0,
    to_degC: ToDegC = 40.0,
    step: float = 10.0,
    harmonic: int = 2,
    theory: Literal["solid", "shell", "rayleigh"] = "solid",
    measured: str | None = None,
) -> Answer:
    """Show the frequency over temperature, its slope in ppm/°C, and the slope's parts from E, μ, ρ, h, r and a [mount].

    Parameters
    ----------
    card : str
        Path of a card, or the name of one that ships (hrg cards).
    from_degC : float
        Lowest temperature in °C.
    to_degC : float
        Highest temperature in °C.
    step : float
        Step in °C.
    harmonic : int
        Circumferential harmonic n.
    theory : str
        solid (three-dimensional), shell (Naghdi) or rayleigh (closed form).
    measured : str
        A steady-state table (temperature_degC,frequency_Hz) whose local slopes stand beside; with the card hrg-30mm it is
        the HRG paper's Table 1 unless another is given.
    """
    from scipy.constants import zero_Celsius

    from studies.cli.output import print_table
    from studies.errors import InputError
    from studies.instrument.card import load_card
    from studies.law import check_slope_known, law_of

    if harmonic > MOST_HARMONIC and theory != "rayleigh":
        raise InputError(
            f"--harmonic {harmonic}: the law over temperature is solved up to n = {MOST_HARMONIC}; hrg modes goes higher."
        )
    temperatures = lay_temperatures(from_degC, to_degC, step)
    instrument = load_card(card)
    check_slope_known(instrument)
    T = instrument.material.check(temperatures)
    law = law_of(instrument, float(T[0]), float(T[-1]), theory, harmonic)
    points, moves = _points(law, T), _moves(law, T)
    local = _measured_slopes(instrument.name, measured)
    yield {
        "schema": "hrg.tcf/1",
        "card": instrument.name,
        "theory": theory,
        "harmonic": harmonic,
        "law": instrument.material.law,
        "relative_error": law.error,
        "points": points,
        "prior": moves,
        "measured": [{"temperature_degC": T, "slope_ppm_per_degC": s} for T, s in local],
    }
    shown_parts = PARTS if law.mount else PARTS[:-1]
    rows = [
        [f"{p['temperature_degC']:.1f}", f"{p['frequency_Hz']:.3f}"]
        + [f"{p['parts_ppm_per_degC'][k]:+.2f}" for k in shown_parts]
        + [f"{p['slope_ppm_per_degC']:.2f} ± {p['uncertainty_ppm_per_degC']:.1f}"]
        for p in points
    ]
    columns = ["T (°C)", "f (Hz)", "E", "μ", "ρ", "h", "r", *(["base"] if law.mount else []), "slope"]
    note = f"Slopes in ppm/°C; ± is one standard deviation by the prior of law '{instrument.material.law}'."
    if law.mount:
        note += " Base: the stress of the card's [mount], which expands otherwise."
    print_table(f"{instrument.name}, n = {harmonic}, {theory}", columns, rows, note)
    if moves:
        shown = sorted({0, len(T) // 2, len(T) - 1})
        print_table(
            "Uncertainty of the law: change of the slope by one standard deviation (ppm/°C)",
            ["Coefficient", "Standard deviation", *(f"at {T[k] - zero_Celsius:g} °C" for k in shown)],
            [
                [m["coefficient"], f"{m['sd']:.2g}", *(f"{m['moves_slope_ppm_per_degC'][k]:+.2f}" for k in shown)]
                for m in moves
                if max(map(abs, m["moves_slope_ppm_per_degC"])) >= LEAST
            ],
        )
    if local:
        beside = [[f"{T:.1f}", f"{s:.2f}"] for T, s in local]
        print_table("Measured, between neighbouring points", ["T (°C)", "slope (ppm/°C)"], beside)


def _points(law: "FrequencyLaw", T: "NDArray[np.float64]") -> "list[dict[str, Any]]":
    from scipy.constants import zero_Celsius

    parts = law.parts(T)
    f, slope, spread = law.frequency(T), 1e6 * parts.total, 1e6 * law.slope_uncertainty(T)
    return [
        {
            "temperature_degC": float(T[k]) - zero_Celsius,
            "frequency_Hz": float(f[k]),
            "slope_ppm_per_degC": float(slope[k]),
            "uncertainty_ppm_per_degC": float(spread[k]),
            "parts_ppm_per_degC": {name: 1e6 * float(getattr(parts, name)[k]) for name in PARTS},
        }
        for k in range(len(T))
    ]


def _moves(law: "FrequencyLaw", T: "NDArray[np.float64]") -> "list[dict[str, Any]]":
    """Return what one standard deviation of each open coefficient of the law moves the slope by."""
    slopes, prior = law.slope_derivatives(T), law.material.prior
    return [
        {"coefficient": name, "sd": float(sd), "moves_slope_ppm_per_degC": (1e6 * sd * slopes[name]).tolist()}
        for name, sd in zip(prior.names, prior.sd, strict=True)
        if name in slopes
    ]


def _measured_slopes(card: str, path: str | None) -> list[tuple[float, float]]:
    """Return (temperature, slope in ppm/°C) between neighbouring points of a table; empty without one."""
    from studies.papers import hrg
    from studies.record import read_frequency_table

    if path is not None:
        table = read_frequency_table(path)
        T, f = table.values["temperature_degC"], table.values["frequency_Hz"]
    elif card == hrg.CARD:
        T, f = hrg.printed_table1()
    else:
        return []
    at, slopes = hrg.local_slopes(T, f)
    return list(zip(at.tolist(), slopes.tolist(), strict=True))
