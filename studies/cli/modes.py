"""`hrg modes`: frequencies, Bryan factors and sensitivities of a card's modes.

Where the card has imperfections or charged electrodes, the pairs n >= 1 have `split` in the JSON besides: `split_Hz`, `slow_Hz`, `fast_Hz`,
`slow_axis_deg` (azimuth of an antinode of the slower mode), `shift_ppm` of the mean, all to first order, and `every_order_split_Hz`; and
`parts`, split_Hz, slow_axis_deg and shift_ppm by the imperfection, the measured split and the electrodes alone. With `--spin` the lowest modes of
n >= 2 in the solid theory have `spin`: `rate_deg_per_s`, `lower_wave_Hz` and `upper_wave_Hz`, and `shift_ppm` of their mean with its parts; with
`--amplitude` all modes of n >= 2 there have `amplitude`: `amplitude_um`, `shift_ppb` with its parts, `shift_Hz_per_um2`.
Where the card has a [mount] the pairs of n >= 1 have `mount`: `strain_ppm` of the base, `shift_ppm`, `slope_ppm_per_degC`, `per_strain`.
Where the card has films ([[loss.film]]), modes have `films`: `film`, `shift_ppm`, and the `missing` keys where that is null. Where its material is
a crystal, the lowest pairs of n = 2, 3, 5, 6, 7, 9 … have `crystal`: `antinode_along_100_Hz`, `other_Hz`, `split_Hz`, `relative_split`.
"""

from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from studies.cli.output import Answer, answers

if TYPE_CHECKING:
    from shell.modes import Mode
    from shell.resonator import Resonator
    from studies.instrument.card import Instrument


@answers("hrg.modes/1")
def modes(
    card: str,
    *,
    harmonic: Annotated[tuple[int, ...], Parameter(consume_multiple=True)] = (2,),
    count: int = 1,
    temperature: float | None = None,
    theory: Literal["solid", "shell", "rayleigh"] = "solid",
    tolerance: float = 1e-5,
    sensitivities: bool = False,
    spin: float | None = None,
    amplitude: float | None = None,
) -> Answer:
    """Compute the lowest modes of a resonator: frequency, Bryan factor, energies, sensitivities.

    Parameters
    ----------
    card : str
        Path of a card, or the name of one that ships (hrg cards).
    harmonic : tuple[int, ...]
        One or more circumferential harmonics n, for example --harmonic 0 1 2 3.
    count : int
        Number of modes of each harmonic.
    temperature : float
        Temperature of the resonator in °C; the card's reference temperature unless given.
    theory : str
        solid (three-dimensional), shell (Naghdi) or rayleigh (closed form, hemisphere of constant thickness).
    tolerance : float
        Relative error that the frequency may have against its own theory.
    sensitivities : bool
        Show how each frequency follows E, nu, rho, thickness and radius, and where its energy is.
    spin : float
        Rate of spin about the axis in °/s: the two waves that run around, and what the second order of the rate does to both.
    amplitude : float
        Largest displacement in µm: what the nonlinear geometry of a large vibration does to the frequency.
    """
    from dataclasses import asdict

    from scipy.constants import zero_Celsius

    from shell.modes import solve_modes
    from studies.cli.amplitude import describe_amplitude, print_amplitude
    from studies.cli.crystal import crystal_pairs, print_crystal
    from studies.cli.films import describe_films, print_films
    from studies.cli.mount import describe_mount, print_mount
    from studies.cli.output import print_table
    from studies.cli.spin import print_spin, spin_pairs
    from studies.errors import InputError, naming
    from studies.instrument.card import load_card

    if count < 1:
        raise InputError(f"--count {count}: at least one mode must be asked for.")
    if min(harmonic) < 0:
        raise InputError(f"--harmonic {min(harmonic)}: a harmonic is a whole number from 0 up.")
    if not 0 < tolerance < 1:
        raise InputError(f"--tolerance {tolerance:g}: it is a relative error between 0 and 1.")
    instrument = load_card(card)
    T = instrument.reference_temperature if temperature is None else temperature + zero_Celsius
    with naming(instrument.path):
        resonator, elastic = instrument.at(T)
        found = [m for n in harmonic for m in solve_modes(resonator, elastic, n, count, theory, tolerance)]
        detailed = theory != "rayleigh"
        films = describe_films(found, instrument) if detailed else {}
        mount = describe_mount(found, instrument, T)
        crystal = crystal_pairs(found, instrument.keys("material").cubic, tolerance)
    share, mean = _material_share(instrument, T), _mean_thickness(resonator)
    split = _find_splits(instrument, found, T) if detailed else {}
    spinning = {} if spin is None else spin_pairs(found, elastic, spin)
    large = {} if amplitude is None else describe_amplitude(found, amplitude)
    entries = []
    for m in found:
        entry = {
            "harmonic": m.harmonic,
            "index": m.index,
            "label": m.label,
            "frequency_Hz": m.frequency,
            "bryan_factor": m.bryan_factor,
            "relative_error_estimate": m.relative_error_estimate,
        }
        if detailed:
            entry |= {
                "material_uncertainty_Hz": share * m.frequency if share else None,
                "frequency_per_thickness_Hz_per_um": _per_micrometre(m, mean),
                "modal_mass_kg": m.modal_mass,
                "sensitivities": asdict(m.sensitivities),
                "energy_fractions": asdict(m.energy_fractions),
            }
        if id(m) in split:
            entry["split"] = split[id(m)]
        for key, known in (
            ("spin", spinning),
            ("amplitude", large),
            ("mount", mount),
            ("films", films),
            ("crystal", crystal),
        ):
            if id(m) in known:
                entry[key] = known[id(m)]
        entries.append(entry)
    yield {
        "schema": "hrg.modes/1",
        "card": instrument.name,
        "temperature_degC": T - zero_Celsius,
        "theory": theory,
        "modes": entries,
    }
    rows = [
        [
            str(m.harmonic),
            str(m.index),
            m.label,
            f"{m.frequency:.4f}",
            f"{m.bryan_factor:.5f}",
            f"{m.relative_error_estimate:.0e}",
            f"{share * m.frequency:.2g}" if share else "—",
            f"{_per_micrometre(m, mean):+.3g}" if detailed else "",
        ]
        for m in found
    ]
    columns = ["n", "index", "kind", "f (Hz)", "Bryan", "rel. error", "± Hz", "Hz/µm"]
    spread = (
        "what the material's published values leave (one standard deviation)"
        if share
        else "not known: the card gives its material without uncertainty"
    )
    note = (
        f"The relative error is the solver's, against the exact solution of the same theory; ± Hz is {spread};"
        " Hz/µm of wall thickness."
    )
    if theory == "rayleigh":
        note = "Rayleigh's closed form ignores the free edge: on a hemisphere it lies several per cent too high."
    print_table(f"{instrument.name} at {T - zero_Celsius:g} °C, {theory}", columns, rows, note)
    if split:
        _print_splits(found, split)
    if spinning:
        print_spin(found, spinning)
    if large:
        print_amplitude(found, large)
    if mount:
        print_mount(found, mount)
    if films:
        print_films(found, films)
    if crystal:
        print_crystal(found, crystal)
    if sensitivities and detailed:
        _print_details(found)


def _find_splits(instrument: "Instrument", found: "list[Mode]", T: float) -> "dict[int, dict[str, Any]]":
    """What the card's imperfection and electrodes make of each pair, by the identity of its mode."""
    from math import degrees

    from studies.instrument.imperfect import is_imperfect

    if not is_imperfect(instrument):
        return {}
    from studies.splitting import SplitPair

    entries: dict[int, dict[str, Any]] = {}
    for m in found:
        if m.harmonic < 1:
            continue
        whole = SplitPair(instrument, m, T)
        slow, fast = whole.split.frequencies
        parts = {"imperfection": whole.imperfection, "measured": whole.measured, "electrodes": whole.electrodes}
        entries[id(m)] = {
            "split_Hz": whole.split.hertz,
            "slow_Hz": slow,
            "fast_Hz": fast,
            "slow_axis_deg": degrees(whole.split.slow_axis),
            "shift_ppm": 1e6 * whole.split.shift,
            "every_order_split_Hz": whole.of_every_order().hertz,
            "parts": {
                name: {"split_Hz": p.hertz, "slow_axis_deg": degrees(p.slow_axis), "shift_ppm": 1e6 * p.shift}
                for name, p in parts.items()
            },
        }
    return entries


def _print_splits(found: "list[Mode]", split: "dict[int, dict[str, Any]]") -> None:
    from studies.cli.output import print_table

    rows = [
        [
            str(m.harmonic),
            str(m.index),
            f"{s['slow_Hz']:.5f}",
            f"{s['fast_Hz']:.5f}",
            f"{s['split_Hz']:.5f}",
            f"{s['every_order_split_Hz']:.5f}",
            f"{s['slow_axis_deg']:.2f}",
            f"{s['shift_ppm']:+.3f}",
        ]
        for m in found
        if (s := split.get(id(m)))
    ]
    columns = ["n", "index", "slow (Hz)", "fast (Hz)", "split (Hz)", "every order", "slow axis (°)", "shift (ppm)"]
    print_table("Pairs with the card's imperfection and electrodes", columns, rows, "Antinode of the slower mode.")


def _material_share(instrument: "Instrument", T: float) -> float:
    import numpy as np

    from studies.law import law_of

    return float(law_of(instrument, T, T).uncertainty(np.array([T]))[0])


def _mean_thickness(resonator: "Resonator") -> float:
    return float(sum(h for _, h in resonator.thickness) / len(resonator.thickness))


def _per_micrometre(mode: "Mode", thickness: float) -> float:
    """Return df/dh in Hz/µm, for a wall that grows everywhere by the same part."""
    return float(mode.frequency * mode.sensitivities.thickness / thickness * 1e-6)


def _print_details(found: "list[Mode]") -> None:
    from studies.cli.output import print_table

    names = ["n", "index"]
    slopes = [
        [
            str(m.harmonic),
            str(m.index),
            *(f"{x:+.4f}" for x in (s.E, s.nu, s.rho, s.thickness, s.radius)),
            f"{1e3 * m.modal_mass:.4f}",
        ]
        for m in found
        for s in [m.sensitivities]
    ]
    columns = [*names, "ln E", "ν", "ln ρ", "ln h", "ln r", "modal mass (g)"]
    note = "ν at constant E; ln r moves every length but the thickness. Modal mass for a largest displacement of 1."
    print_table("Derivatives of ln f", columns, slopes, note)
    shares = [
        [str(m.harmonic), str(m.index), *(f"{100 * x:.3f}" for x in (e.bending, e.membrane, e.shear, e.root, e.stem))]
        for m in found
        for e in [m.energy_fractions]
    ]
    columns = [*names, "bending", "membrane", "transverse shear", "root", "stem"]
    print_table("Shares of the strain energy (%)", columns, shares, "Root: the solid cap, fillet or corner.")
