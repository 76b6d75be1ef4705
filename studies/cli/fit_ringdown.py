"""`hrg fit ringdown`: frequencies, Q and axes from free decays.

With --json one object, schema `hrg.fit-ringdown/1`: `decays` (a list: `data`, `window_s`, `carrier_Hz`, `estimates` by name with
`value`, `sd`, `low`, `high`, `noise`, `widening`, `interference_Hz`, `remarks`), `gas` (1/Q over pressure: `inverse_q0`,
`slope_per_Pa`, their `_sd`, `scatter`; null without pressures), `saved`.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.cli.output import Answer, answers

if TYPE_CHECKING:
    from studies.ringdown import Decay


@answers("hrg.fit-ringdown/1")
def fit_ringdown(
    *data: str,
    card: str | None = None,
    frequency: float | None = None,
    harmonic: int = 2,
    save: str | None = None,
    report: str | None = None,
) -> Answer:
    """Fit frequencies, Q and the axes of elasticity and damping to ring-downs, with intervals beside the Cramér–Rao bound.

    A file holds one decay: time_s and pickoff_cos_V (and pickoff_sin_V) as raw samples, amplitude_cos_V with phase_cos_deg
    (and the same with sin) from a lock-in amplifier, or power_dBm. The free part is found by the program: drive, transient and
    noise floor are left out. Several files are several decays of one resonator; with '# pressure_Pa:' comments 1/Q is
    fitted over pressure.

    Parameters
    ----------
    data : str
        The files.
    card : str
        The resonator's card: an alias of its frequency is recognised, and --save writes it with what was found.
    frequency : float
        Carrier or reference frequency in Hz, in place of the file's comment.
    harmonic : int
        Harmonic number n of the pattern.
    save : str
        Write the card with the split, its axis, 1/Q and the damping axis of the (first) decay.
    report : str
        Write a page with the decays and what the fit leaves.
    """
    from studies.cli.output import print_table, say
    from studies.errors import InputError
    from studies.files.writing import write_text
    from studies.instrument.card import load_card, save_card
    from studies.reports.ringdown import decay_tables, ringdown_page
    from studies.ringdown import fit_gas, read_decay, with_decay

    if not data:
        raise InputError("name at least one file (CSV) with a free decay.")
    if save is not None and card is None:
        raise InputError("--save writes the card with what was found; name it by --card.")
    instrument = load_card(card) if card else None
    expected = None
    if instrument is not None:
        from studies.law import law_of

        T = instrument.reference_temperature
        expected = float(law_of(instrument, T - 5, T + 5).frequency(T))
    decays = []
    for path in data:
        say(f"fitting {path}")
        decays.append(read_decay(path, frequency=frequency, harmonic=harmonic, expected=expected))
    gas = fit_gas(decays)
    if save is not None and instrument is not None:
        save_card(with_decay(instrument, decays[0], harmonic), save)
        say(f"card: {save}")
    if report is not None:
        write_text(report, ringdown_page(decays, gas))
        say(f"report: {report}")
    yield {
        "schema": "hrg.fit-ringdown/1",
        "decays": [_payload(decay) for decay in decays],
        "gas": None
        if gas is None
        else {
            "inverse_q0": gas.inverse_q0,
            "inverse_q0_sd": gas.inverse_q0_sd,
            "slope_per_Pa": gas.slope,
            "slope_per_Pa_sd": gas.slope_sd,
            "scatter": gas.scatter,
        },
        "saved": save,
    }
    for table in decay_tables(decays, gas):
        print_table(table.caption, table.columns, table.rows, table.note)
    for decay in decays:
        for remark in decay.remarks:
            print(f"{Path(decay.path).name}: {remark}" if len(decays) > 1 else remark)


def _payload(decay: "Decay") -> dict[str, Any]:
    from dataclasses import asdict

    if decay.phased is not None:
        found = decay.phased
        return {
            "data": decay.path,
            "window_s": found.window,
            "carrier_Hz": found.fit.envelope.carrier or None,
            "estimates": {name: asdict(e) for name, e in found.estimates.items()},
            "noise": found.fit.noise.tolist(),
            "widening": found.fit.widening,
            "interference_Hz": [found.fit.envelope.carrier + line for line in found.lines],
            "remarks": found.remarks,
        }
    trace = decay.trace
    assert trace is not None
    estimates = {"decay_per_s": {"value": trace.decay, "sd": trace.sd, "low": trace.low, "high": trace.high}}
    if decay.inverse_q is not None:
        value, low, high = decay.inverse_q
        estimates["inverse_q"] = {"value": value, "sd": trace.sd * value / trace.decay, "low": low, "high": high}
    return {
        "data": decay.path,
        "window_s": trace.window,
        "carrier_Hz": decay.frequency,
        "estimates": estimates,
        "noise": [trace.noise],
        "widening": trace.sd / trace.bound,
        "interference_Hz": [],
        "remarks": trace.remarks,
    }
