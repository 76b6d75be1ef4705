"""`hrg fit whole-angle`: splits, axes, gain ratio and phase error from a whole-angle run.

With --json one object, schema `hrg.fit-whole-angle/1`: `data`, `confidence`, `estimates` (by the card's keys: `value`,
`sd`, `low`, `high`), `undetermined` (sentences), `saved` (path or null).
"""

from typing import TYPE_CHECKING

from studies.cli.output import Answer, answers

if TYPE_CHECKING:
    from compensation.wave_fit import WaveFit

KEYS = {
    # estimate: key of the card, factor to its unit
    "decay": ("loss.inverse_q", 0.0),
    "damping_split": ("bias.damping_anisotropy", 0.0),
    "damping_axis": ("bias.damping_axis_deg", 57.29577951308232),
    "frequency_split": ("loop.frequency_split_mHz", 1e3 / 6.283185307179586),
    "frequency_axis": ("loop.frequency_axis_deg", 57.29577951308232),
    "gain_ratio": ("loop.pickoff_gain_ratio", 1.0),
    "skew": ("loop.pickoff_skew_mrad", 1e3),
    "phase_error": ("loop.pickoff_phase_deg", 57.29577951308232),
    "rate": ("bias.offset_deg_per_h", 206264.80624709636),
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
) -> Answer:
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
    import numpy as np

    from compensation.wave_fit import fit_whole_angle as fit
    from studies.cli.output import print_table, say
    from studies.errors import InputError, naming
    from studies.instrument.card import load_card, save_card
    from studies.law import law_of
    from studies.record import read_record

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
    record = read_record(run)
    rate = record["measured_rate_deg_per_s"] if "measured_rate_deg_per_s" in record else record["bias_deg_per_h"] / 3600
    frequency = record.columns.get("frequency_Hz")
    quadrature = None
    if "quadrature_V" in record:
        if quadrature_volts_per_hertz is None:
            say(
                "note: quadrature_V is left out, its scale is unknown; give --quadrature-volts-per-hertz or a card with [loop]."
            )
        else:
            quadrature = np.pi * record["quadrature_V"] / quadrature_volts_per_hertz
    decay = None
    if "inverse_q" in record:
        if frequency is None:
            raise InputError(f"{run}: inverse_q is a rate of decay only with frequency_Hz; add that column.")
        decay = np.pi * frequency * record["inverse_q"]
    with naming(run):
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
    estimates = _in_card_units(found, None if frequency is None else float(np.mean(frequency)))
    if save is not None and instrument is not None:
        axes = {"bias.damping_anisotropy": 0.0}
        values = {
            key: {"value": e["value"], "sd": e["sd"]}
            for key, e in estimates.items()
            if key in KEYS_OF_CARD and not (key in axes and e["value"] < 0)
        }
        if "loop" not in instrument.content:
            instrument = instrument.with_table("loop", {"mode": "whole-angle"})
        save_card(instrument.with_values(values), save)
        say(f"card: {save}")
    yield {
        "schema": "hrg.fit-whole-angle/1",
        "data": run,
        "confidence": confidence,
        "estimates": estimates,
        "undetermined": list(found.undetermined),
        "saved": save,
    }
    rows = [[key, *(f"{e[name]:.5g}" for name in ("value", "low", "high"))] for key, e in estimates.items()]
    print_table(
        "Whole-angle run", ["key of the card", "value", "low", "high"], rows, f"Intervals of {100 * confidence:g} %."
    )
    for sentence in found.undetermined:
        print(f"not determined: {sentence}")


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
