"""`hrg modes`: frequencies, Bryan factors and sensitivities of a card's modes.

Where the card has imperfections or charged electrodes, the pairs n >= 1 have `split` in the JSON besides: `split_Hz`, `slow_Hz`, `fast_Hz`,
`slow_axis_deg` (azimuth of an antinode of the slower mode), `shift_ppm` of the mean, the imperfection to first order, and `every_order_split_Hz`; and `parts`,
split_Hz, slow_axis_deg and shift_ppm by the imperfection, the measured split and the electrodes alone. Where the card has a [mount] the pairs of n >=
1 have `mount`: `strain_ppm` of the base, `shift_ppm`, `slope_ppm_per_degC`, `per_strain`. Where the card has films ([[loss.film]]), modes have
`films`: `film`, `shift_ppm`, and the `missing` keys where that is null. Where its material is a crystal, the lowest pairs of n = 2, 3, 5, 6, 7, 9 …
have `crystal`: `antinode_along_100_Hz`, `other_Hz`, `split_Hz`, `relative_split`.
"""

from math import degrees
from typing import TYPE_CHECKING, Annotated, Any, Literal

from shell.constants import zero_Celsius
from shell.errors import ShellError
from shell.law import mode_uncertainty
from shell.modes import Mode, solve_modes
from shell.prestress import Prestress, check_mount
from studies.cli.arguments import COUNT, FRACTION, MANY, WHOLE, AnyTheory, Card, Temperature, open_resonator
from studies.cli.output import answers
from studies.errors import naming
from studies.instrument.card import Instrument
from studies.reports.digits import to_numerical_error
from studies.reports.scenes import THEORIES, live_chapter, show_mode, view_blocks
from studies.resonator.law import known_material
from studies.results import Column, Result, Sentence, Table, Where, row_of

if TYPE_CHECKING:
    from shell.imperfection import Split
    from studies.results.page import Block

Entry = dict[str, Any]

FAR = 0.1  # relative difference of the first order from all orders from which on a split is doubted
MODE = "harmonic: n | index"
COLUMNS = (
    f"{MODE} | label: kind",
    Column(
        lambda m: to_numerical_error(m["frequency_Hz"], m["relative_error_estimate"] * m["frequency_Hz"], 4), "f", "Hz"
    ),
    "bryan_factor: Bryan factor .5f | relative_error_estimate: solver error, relative .0e | material_uncertainty_Hz:"
    " material uncertainty (Hz) .2g | frequency_per_thickness_Hz_per_um: df/dh (Hz/µm) +.3g",
)
SPLIT = (
    f"{MODE} | split.slow_Hz: slow (Hz) .5f | split.fast_Hz: fast (Hz) .5f | split.split_Hz: split (Hz) .5f"
    " | split.every_order_split_Hz: split, all orders (Hz) .5f | split.slow_axis_deg: slow axis (°) .2f | split.shift_ppm: shift (ppm) +.3f"
)
MOUNT = f"{MODE} | mount.per_strain: per strain +.4g | mount.shift_ppm: shift (ppm) +.4g | mount.slope_ppm_per_degC: slope (ppm/°C) +.3g"
FILMS = (
    f"{MODE} | film | shift_ppm: shift (ppm) +.4g",
    Column(lambda film: " and ".join(film["missing"]), "unknown without"),
)
CRYSTAL = (
    "harmonic: n | crystal.antinode_along_100_Hz: antinode along [100] (Hz) .4f | crystal.other_Hz: other mode (Hz) .4f"
    " | crystal.split_Hz: split (Hz) .4f | crystal.relative_error_estimate: solver error, relative .0e"
)
MISMATCH = (
    "The base has expanded {:.4g} ppm more than the resonator since they were joined. First order in the resulting stress"
    " and deformation. The frequencies above do not include it; those of hrg tcf and of simulations do."
)
BARE = "By stiffness and mass, to first order in the thickness. The frequencies above are those of the bare wall."
VOIGT = "[001] along the axis. The table above and every other command use the isotropic (Voigt-Reuss-Hill) mean of the elastic constants."
SLOPES = (
    f"{MODE} | sensitivities.E: ln E +.4f | sensitivities.nu: ν +.4f | sensitivities.rho: ln ρ +.4f"
    " | sensitivities.thickness: ln h +.4f | sensitivities.radius: ln r +.4f | modal_mass_kg: modal mass (g) ×1e3 .4f"
)
ENERGY = (
    f"{MODE} | energy_fractions.bending: bending ×100 .3f | energy_fractions.membrane: membrane ×100 .3f"
    " | energy_fractions.shear: transverse shear ×100 .3f | energy_fractions.root: root ×100 .3f | energy_fractions.stem: stem ×100 .3f"
)
ROOT = "Root: the solid joint of the shell with its stem or bottom, fillet included."
DERIVED = "ν at constant E; ln r: all lengths except the wall thickness. Modal mass: for a maximum displacement of 1."


@answers("hrg.modes/1")
def modes(
    card: Card,
    *,
    harmonic: Annotated[tuple[int, ...], MANY, WHOLE] = (2,),
    count: Annotated[int, COUNT] = 1,
    temperature: Temperature = None,
    theory: AnyTheory = "solid",
    tolerance: Annotated[float, FRACTION] = 1e-5,
    sensitivities: bool = False,
) -> Result:
    """Compute the lowest modes of a resonator: frequency, Bryan factor, energies, sensitivities.

    Args:
        harmonic: One or more circumferential harmonics n, for example --harmonic 0 1 2 3.
        count: Number of modes of each harmonic.
        tolerance: Largest relative discretization error of the frequency.
        sensitivities: Show sensitivities to E, ν, ρ, thickness and radius, and where the energy is.
    """
    instrument, T, resonator, elastic = open_resonator(card, temperature)
    detailed = theory != "rayleigh"
    with naming(instrument.path):
        found = [
            m for n in dict.fromkeys(harmonic) for m in solve_modes(resonator, elastic, n, count, theory, tolerance)
        ]
        more = [_effects(m, instrument, T, tolerance) for m in found]
    known, T0 = known_material(instrument), instrument.reference_temperature
    mean = float(sum(h for _, h in resonator.thickness) / len(resonator.thickness))
    entries = []
    for m, effects in zip(found, more, strict=True):
        names = ("harmonic", "index", "label", "bryan_factor", "relative_error_estimate")
        entry = row_of(m, *names, frequency_Hz="frequency")
        if detailed:
            # of a wall that grows everywhere by the same part
            per_micrometre = float(m.frequency * m.sensitivities.thickness / mean * 1e-6)
            entry |= {
                "material_uncertainty_Hz": m.frequency * mode_uncertainty(m, known, T0, T) or None,
                "frequency_per_thickness_Hz_per_um": per_micrometre,
                **row_of(m, "sensitivities", "energy_fractions", modal_mass_kg="modal_mass"),
            }
        entries.append(entry | effects)
    shown = entries if detailed else []
    where: Where = "everywhere" if sensitivities else "page"
    operating = min(harmonic, key=lambda n: abs(n - 2))
    seen = sorted(set(harmonic), key=lambda n: (n != operating, n))  # first the mode that the sliders move
    head = {"card": instrument.name, "temperature_degC": T - zero_Celsius, "theory": theory}
    name = f"{instrument.name} at {T - zero_Celsius:g} °C, {THEORIES[theory]}"
    return Result(
        {**head, "modes": entries},
        f"Modes of {instrument.name}",
        f"Natural frequencies and Bryan factors at {T - zero_Celsius:g} °C, {THEORIES[theory]}.",
        [
            Table(name, entries, COLUMNS, _note(theory, bool(known.prior.names))),
            *_effect_tables(entries),
            *_all_orders(entries),
            Table("Derivatives of ln f", shown, SLOPES, DERIVED, where),
            Table("Strain energy (%)", shown, ENERGY, ROOT, where),
            live_chapter(instrument, operating, theory, lambda: _view(instrument, seen, T, theory)),
        ],
    )


def _effects(m: Mode, instrument: Instrument, T: float, tolerance: float) -> Entry:
    """Return what else applies to a mode of a card at T (K), by its key in the JSON."""
    found = {
        "split": _split(m, instrument, T),
        "mount": _mount(m, instrument, T),
        "films": _films(m, instrument),
        "crystal": _crystal(m, instrument, T, tolerance),
    }
    return {key: entry for key, entry in found.items() if entry is not None}


def _split(m: Mode, instrument: Instrument, T: float) -> Entry | None:
    if m.theory == "rayleigh" or m.harmonic < 1 or not instrument.is_imperfect:
        return None
    from studies.resonator.splitting import SplitPair

    whole = SplitPair(instrument, m, T)
    slow, fast = whole.split.frequencies

    def told(one: "Split") -> Entry:
        return row_of(one, split_Hz="hertz", slow_axis_deg=("slow_axis", degrees(1)), shift_ppm=("shift", 1e6))

    parts = {name: told(getattr(whole, name)) for name in ("imperfection", "measured", "electrodes")}
    every = {"slow_Hz": slow, "fast_Hz": fast, "every_order_split_Hz": whole.of_every_order().hertz, "parts": parts}
    return told(whole.split) | every


def _mount(m: Mode, instrument: Instrument, T: float) -> Entry | None:
    mount = instrument.part("mount")
    if mount is None or m.theory != "solid" or not m.harmonic:
        return None
    with naming(f"{instrument.path} [mount]"):
        strain, slope = (float(x(instrument.material, T)) for x in (mount.strain, mount.strain_slope))
        check_mount(instrument.resonator, m.theory, m.harmonic)
        s = Prestress(m).by_base
    return {
        "strain_ppm": 1e6 * strain,
        "shift_ppm": 1e6 * s * strain + 0.0,  # no -0
        "slope_ppm_per_degC": 1e6 * s * slope,
        "per_strain": s,
    }


def _films(m: Mode, instrument: Instrument) -> list[Entry] | None:
    """Every film and its shift in ppm, null where its numbers are not known."""
    if m.theory == "rayleigh" or not instrument.part("loss", "loss_parts").film:
        return None
    from studies.loss.films import film_shifts

    shifts = film_shifts(instrument, m)
    return [row_of(one, "missing", film="material", shift_ppm=("relative", 1e6)) for one in shifts]


def _crystal(m: Mode, instrument: Instrument, T: float, tolerance: float) -> Entry | None:
    """Both modes of a lowest pair n >= 2 but multiples of 4."""
    given = instrument.keys("material").cubic
    crystal = given or instrument.material.cubic(T)
    if crystal is None or m.theory != "solid" or m.harmonic < 2 or m.harmonic % 4 == 0 or m.index:
        return None
    from shell.cubic import solve_cubic

    try:
        pair = solve_cubic(m.resonator, crystal, m.harmonic, tolerance)
    except ShellError:
        if given is not None:
            raise
        return None  # of a stem or a clamp; the material's caveat says so
    axes = {"antinode_along_100_Hz": "along_100", "other_Hz": "along_110"}
    lines = row_of(pair, "relative_split", "relative_error_estimate", **axes)
    return lines | {"split_Hz": abs(pair.along_110 - pair.along_100)}


def _effect_tables(modes: list[Entry]) -> list[Table]:
    of = {key: [row for row in modes if key in row] for key in ("split", "mount", "films", "crystal")}
    strain = next((row["mount"]["strain_ppm"] for row in of["mount"]), 0.0)
    films = [row | film for row in of["films"] for film in row["films"]]
    antinode = "Slow axis: an antinode of the slower mode. Slow, fast and shift: the imperfection to first order, the electrodes' springs exactly."
    return [
        Table("Pairs with imperfections and electrodes", of["split"], SPLIT, antinode),
        Table("Thermal mismatch with the base", of["mount"], MOUNT, MISMATCH.format(strain)),
        Table("Effect of the films", films, FILMS, BARE),
        Table("Pairs of the anisotropic crystal", of["crystal"], CRYSTAL, VOIGT),
    ]


def _view(instrument: Instrument, harmonics: list[int], T: float, theory: str) -> "list[Block]":
    drawn: Literal["solid", "shell"] = "solid" if theory == "solid" else "shell"
    words = " Rayleigh's closed form gives the frequencies of the table, not these shapes." * (theory == "rayleigh")
    return view_blocks([show_mode(instrument, n, temperature=T, theory=drawn) for n in harmonics], words)


def _note(theory: str, open_: bool) -> str:
    if theory == "rayleigh":
        return "Rayleigh's closed form ignores the free edge: on a hemisphere it lies about 10 % too high. Its error is not estimated more closely."
    spread = (
        "as card and material table state it, one standard deviation" if open_ else "not known: the card gives none"
    )
    return f"Solver error: against the exact solution of the same theory. Material uncertainty: {spread}."


def _all_orders(modes: list[Entry]) -> list[Sentence]:
    from shell.imperfection.split import ROUNDING

    found = []
    for row in modes:
        one, every = (row.get("split", {}).get(key, 0.0) for key in ("split_Hz", "every_order_split_Hz"))
        if abs(one - every) > max(FAR * max(one, every), ROUNDING * row["frequency_Hz"]):
            found.append(f"n = {row['harmonic']} ({one:.3g} and {every:.3g} Hz)")
    words = "to first order and of all orders the splits differ by more than 10 %"
    return [Sentence(f"The imperfections are large: {words} for {', '.join(found)}.", "warning")] if found else []
