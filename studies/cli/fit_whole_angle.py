"""`hrg fit whole-angle`: splits, axes, gain ratio and phase error from a whole-angle run."""

from math import degrees, pi

import numpy as np

from compensation.wave_fit import WaveFit
from compensation.wave_fit import fit_whole_angle as fit
from studies.cli.arguments import Confidence, Run
from studies.cli.output import answers, keep_card, say
from studies.errors import InputError, naming
from studies.instrument.card import Instrument, load_card
from studies.instrument.tables.loop import Loop
from studies.record import read_record
from studies.resonator.law import law_of
from studies.results import Result, Sentence, Table

KEYS = {
    # estimate: key of the card, factor to its unit, name, unit
    "decay": ("loss.inverse_q", 0.0, "Mean loss 1/Q", ""),
    "damping_split": ("bias.damping_anisotropy", 0.0, "Damping split Δ(1/τ) over 1/τ", ""),
    "damping_axis": ("bias.damping_axis_deg", degrees(1), "Damping axis", "°"),
    "frequency_split": ("loop.frequency_split_mHz", 1e3 / (2 * pi), "Frequency split", "mHz"),
    "frequency_axis": ("loop.frequency_axis_deg", degrees(1), "Frequency axis", "°"),
    "gain_ratio": ("loop.pickoff_gain_ratio", 1.0, "Pick-off gain ratio", ""),
    "skew": ("loop.pickoff_skew_mrad", 1e3, "Pick-off skew", "mrad"),
    "phase_error": ("loop.pickoff_phase_deg", degrees(1), "Phase error", "°"),
    "rate": ("bias.offset_deg_per_h", degrees(3600), "Mean bias", "°/h"),
}
SPLIT_PER_S = "damping_split_per_s"  # where 1/τ is not known
NAMES = {key: (name, unit) for key, _, name, unit in KEYS.values()} | {SPLIT_PER_S: ("Damping split Δ(1/τ)", "1/s")}
KEYS_OF_CARD = tuple(key for key, *_ in KEYS.values() if key != "bias.offset_deg_per_h")
NO_SCALE = "note: quadrature_V is not used because its scale is unknown; give --quadrature-volts-per-hertz or a card with [loop]."


@answers("hrg.fit-whole-angle/1")
def fit_whole_angle(
    run: Run,
    *,
    card: str | None = None,
    bryan_factor: float | None = None,
    quadrature_volts_per_hertz: float | None = None,
    confidence: Confidence = 0.9,
    save: str | None = None,
) -> Result:
    """Find damping and frequency splits with their axes, gain ratio and phase error in a whole-angle run, with intervals.

    The record needs time_s, pattern_angle_deg (unwrapped) and bias_deg_per_h or measured_rate_deg_per_s (the indicated rate
    less the commanded precession). It may have inverse_q (drive effort), frequency_Hz, quadrature_V, and rate_deg_per_s if a
    rate was applied. Precess the wave in both directions: one direction does not determine the gain ratio. The phase error is
    that of the whole path; the gain ratio of the drives is taken from the card.

    Args:
        card: Its card: gives the Bryan factor, the scale of quadrature_V and the gains of the drives.
        bryan_factor: Bryan factor, used instead of the card's.
        quadrature_volts_per_hertz: Scale of quadrature_V; without it and without a card, that column is not used.
        save: Write the card with the estimates and their uncertainties.
    """
    instrument = load_card(card) if card else None
    if save is not None and instrument is None:
        raise InputError("--save writes a card with the estimates: name the card to start from with --card.")
    loop = instrument.loop if instrument is not None else None
    if bryan_factor is None:
        if instrument is None:
            raise InputError("the Bryan factor is not known: name the card with --card, or give --bryan-factor.")
        T = instrument.reference_temperature
        bryan_factor = law_of(instrument, T - 5, T + 5).bryan_factor
    if quadrature_volts_per_hertz is None and loop is not None:
        quadrature_volts_per_hertz = loop.quadrature_V_per_Hz
    found, frequency = _fit_record(run, bryan_factor, quadrature_volts_per_hertz, loop, confidence)
    estimates = _in_card_units(found, frequency)
    if save is not None and instrument is not None:
        keep_card(_with_estimates(instrument, estimates), save)
    payload = {"data": run, "confidence": confidence, "saved": save}
    payload |= {"estimates": estimates, "undetermined": found.undetermined}
    rows = [{"quantity": NAMES[key][0], "unit": NAMES[key][1], "key": key} | e for key, e in estimates.items()]
    columns = f"Quantity | value ± sd: Value | low … high ± sd: {100 * confidence:g} % interval | Unit | key: Key of the card"  # fmt: skip
    return Result(
        payload,
        "Errors of a whole-angle gyro",
        f"Damping, splits, gains and phase error found in {run}.",
        [
            Table("Estimates", rows, columns, "±: one standard deviation."),
            *(Sentence(f"Not determined: {sentence}.", "warning") for sentence in found.undetermined),
        ],
    )


def _fit_record(
    path: str, bryan_factor: float, volts_per_hertz: float | None, loop: Loop | None, confidence: float
) -> tuple[WaveFit, float | None]:
    record = read_record(path)
    rate = record["measured_rate_deg_per_s"] if "measured_rate_deg_per_s" in record else record["bias_deg_per_h"] / 3600
    frequency = record.columns.get("frequency_Hz")
    quadrature = decay = None
    if "quadrature_V" in record and volts_per_hertz is not None:
        quadrature = np.pi * record["quadrature_V"] / volts_per_hertz
    elif "quadrature_V" in record:
        say(NO_SCALE)
    if "inverse_q" in record:
        if frequency is None:
            raise InputError(f"{path}: inverse_q gives the decay rate only with frequency_Hz beside it; add that column.")  # fmt: skip
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


def _with_estimates(instrument: Instrument, estimates: dict[str, dict[str, float]]) -> Instrument:
    """Return the card with the estimates and their uncertainties; an anisotropy below 0 is left out."""
    values = {
        key: {"value": e["value"], "sd": e["sd"]}
        for key, e in estimates.items()
        if key in KEYS_OF_CARD and not (key == "bias.damping_anisotropy" and e["value"] < 0)
    }
    if "loop" not in instrument.content:
        instrument = instrument.with_table("loop", {"mode": "whole-angle"})
    return instrument.with_values(values)


def _in_card_units(found: WaveFit, frequency: float | None) -> dict[str, dict[str, float]]:
    """Return the estimates by the keys of a card; anisotropy over 1/τ, and 1/Q, where drive effort and frequency are known."""
    estimates = {}
    for name, e in found.estimates.items():
        key, factor, *_ = KEYS[name]
        if name == "decay" and frequency is not None:
            factor = 1 / (pi * frequency)
        elif name == "damping_split":
            if "decay" not in found.estimates:
                key, factor = SPLIT_PER_S, 1.0
            else:
                factor = 1 / found.estimates["decay"].value
        estimates[key] = {part: getattr(e, part) * factor for part in ("value", "sd", "low", "high")}
    return estimates
