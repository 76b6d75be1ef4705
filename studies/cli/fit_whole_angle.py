"""`hrg fit whole-angle`: splits, axes, gain ratio and phase error from a whole-angle run.

With --json one object, schema `hrg.fit-whole-angle/1`: `data`, `confidence`, `estimates` (by the card's keys: `value`,
`sd`, `low`, `high`), `undetermined` (sentences), `saved` (path or null).
"""

from math import degrees, pi
from typing import TYPE_CHECKING

from studies.cli.output import answers
from studies.results import Column, Result, Sentence, Table

if TYPE_CHECKING:
    from compensation.wave_fit import WaveFit
    from studies.instrument.card import Instrument
    from studies.instrument.tables.loop import Loop

KEYS = {
    # estimate: key of the card, factor to its unit
    "decay": ("loss.inverse_q", 0.0),
    "damping_split": ("bias.damping_anisotropy", 0.0),
    "damping_axis": ("bias.damping_axis_deg", degrees(1)),
    "frequency_split": ("loop.frequency_split_mHz", 1e3 / (2 * pi)),
    "frequency_axis": ("loop.frequency_axis_deg", degrees(1)),
    "gain_ratio": ("loop.pickoff_gain_ratio", 1.0),
    "skew": ("loop.pickoff_skew_mrad", 1e3),
    "phase_error": ("loop.pickoff_phase_deg", degrees(1)),
    "rate": ("bias.offset_deg_per_h", degrees(3600)),
}


@answers("hrg.fit-whole-angle/1")
def fit_whole_angle(
    run: str,
    *,
    card: str | None = None,
    bryan_factor: float | None = None,
    quadrature_volts_per_hertz: float | None = None,
    confidence: float = 0.95,
    save: str | None = None,
) -> Result:
    """Fit damping and frequency split with their axes, gain ratio and phase error to a whole-angle run, with intervals.

    The record needs time_s, pattern_angle_deg (unwrapped) and bias_deg_per_h or measured_rate_deg_per_s (the indicated rate,
    less the commanded turn); inverse_q (the drive's effort), frequency_Hz and quadrature_V where they were
    recorded, rate_deg_per_s where a rate was applied. Turn the wave both ways: one way does not determine the gain ratio. The
    phase error is that of the whole path; the drives' own gain ratio is taken from the card.

    Parameters
    ----------
    run : str
        The record (CSV).
    card : str
        Its card: gives the Bryan factor, the scale of quadrature_V, and the drives' gains.
    bryan_factor : float
        In place of the card's.
    quadrature_volts_per_hertz : float
        Scale of quadrature_V; without it and without a card, that column is left out.
    confidence : float
        Of the intervals.
    save : str
        Write the card with the values found and their uncertainties.
    """
    from studies.cli.output import say
    from studies.errors import InputError
    from studies.instrument.card import load_card, save_card
    from studies.law import law_of

    if not 0 < confidence < 1:
        raise InputError(f"--confidence {confidence:g}: a confidence lies between 0 and 1, such as 0.95.")
    instrument = load_card(card) if card else None
    if save is not None and instrument is None:
        raise InputError("--save writes the card with the values found; name it by --card.")
    loop = instrument.loop if instrument is not None else None
    if bryan_factor is None:
        if instrument is None:
            raise InputError("the Bryan factor is not known: name the card by --card, or give --bryan-factor.")
        T = instrument.reference_temperature
        bryan_factor = law_of(instrument, T - 5, T + 5).bryan_factor
    if quadrature_volts_per_hertz is None and loop is not None:
        quadrature_volts_per_hertz = loop.quadrature_V_per_Hz
    found, frequency = _fit_record(run, bryan_factor, quadrature_volts_per_hertz, loop, confidence)
    estimates = _in_card_units(found, frequency)
    if save is not None and instrument is not None:
        save_card(_with_estimates(instrument, estimates), save)
        say(f"card: {save}")
    payload = {
        "schema": "hrg.fit-whole-angle/1",
        "data": run,
        "confidence": confidence,
        "estimates": estimates,
        "undetermined": list(found.undetermined),
        "saved": save,
    }
    rows = [{"key": key, **estimate} for key, estimate in estimates.items()]
    columns = [Column("key", "key of the card"), *(Column(name, name, digits=5) for name in ("value", "low", "high"))]
    return Result(
        payload,
        "Whole-angle run",
        f"Splits, axes, gain ratio and phase error from {run}.",
        [
            Table("Whole-angle run", rows, columns, f"Intervals of {100 * confidence:g} %."),
            *(Sentence(f"Not determined: {sentence}", "warning") for sentence in found.undetermined),
        ],
    )


def _fit_record(
    path: str, bryan_factor: float, volts_per_hertz: float | None, loop: "Loop | None", confidence: float
) -> "tuple[WaveFit, float | None]":
    """Fit what is in a record; also its mean frequency in Hz, where it has one."""
    import numpy as np

    from compensation.wave_fit import fit_whole_angle as fit
    from studies.cli.output import say
    from studies.errors import InputError, naming
    from studies.record import read_record

    record = read_record(path)
    rate = record["measured_rate_deg_per_s"] if "measured_rate_deg_per_s" in record else record["bias_deg_per_h"] / 3600
    frequency = record.columns.get("frequency_Hz")
    quadrature = decay = None
    if "quadrature_V" in record and volts_per_hertz is not None:
        quadrature = np.pi * record["quadrature_V"] / volts_per_hertz
    elif "quadrature_V" in record:
        say(
            "note: quadrature_V is left out, its scale is unknown; give --quadrature-volts-per-hertz or a card with [loop]."
        )
    if "inverse_q" in record:
        if frequency is None:
            raise InputError(f"{path}: inverse_q is a rate of decay only with frequency_Hz; add that column.")
        decay = np.pi * frequency * record["inverse_q"]
    with naming(path):
        found = fit(
            record["time_s"],
            np.radians(record["pattern_angle_deg"]),
            np.radians(rate),
            coupling=2 * bryan_factor,
            applied=np.radians(record["rate_deg_per_s"]) if "rate_deg_per_s" in record else 0.0,
            decay=decay,
            frequency=None if frequency is None else 2 * np.pi * frequency,
            quadrature=quadrature,
            drive_gain_ratio=loop.drive_gain_ratio if loop else 0.0,
            drive_skew=1e-3 * loop.drive_skew_mrad if loop else 0.0,
            confidence=confidence,
        )
    return found, None if frequency is None else float(np.mean(frequency))


def _with_estimates(instrument: "Instrument", estimates: dict[str, dict[str, float]]) -> "Instrument":
    """The card with the values found and their uncertainties; an anisotropy below 0 is none."""
    values = {
        key: {"value": e["value"], "sd": e["sd"]}
        for key, e in estimates.items()
        if key in KEYS_OF_CARD and not (key == "bias.damping_anisotropy" and e["value"] < 0)
    }
    if "loop" not in instrument.content:
        instrument = instrument.with_table("loop", {"mode": "whole-angle"})
    return instrument.with_values(values)


KEYS_OF_CARD = tuple(key for key, _ in KEYS.values() if key != "bias.offset_deg_per_h")


def _in_card_units(found: "WaveFit", frequency: float | None) -> dict[str, dict[str, float]]:
    """Return the estimates by the keys of a card; anisotropy over 1/τ, and 1/Q, where drive effort and frequency are known."""
    from math import pi

    estimates = {}
    for name, e in found.estimates.items():
        key, factor = KEYS[name]
        if name == "decay" and frequency is not None:
            factor = 1 / (pi * frequency)
        elif name == "damping_split":
            if "decay" not in found.estimates:
                key, factor = "damping_split_per_s", 1.0
            else:
                factor = 1 / found.estimates["decay"].value
        estimates[key] = {part: getattr(e, part) * factor for part in ("value", "sd", "low", "high")}
    return estimates
