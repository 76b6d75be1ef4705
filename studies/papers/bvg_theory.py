"""The BVG paper's theory of the bell, (16)–(22), in numbers beside the shell solver, and its reading of the rate, (23)–(30)."""

from dataclasses import dataclass, replace

import numpy as np

from compensation.loop import BellResonator, read_rate_from_drive, read_rate_from_loop, scale_of_rebalance
from compensation.motion import demodulate
from compensation.piezo import COUNT, DRIVE_Q, PiezoRing
from shell import bell_theory
from shell.curves import Arc
from shell.damping.faces import shell_faces
from shell.modes import solve_modes
from shell.resonator import Resonator
from studies.instrument.card import load_card
from studies.results import Chapter, Column, Table

CARD = "bvg-bell"
D31_PZT5A = -1.71e-10  # C/N, of PZT-5A (data sheets of makers); the paper names the ceramic and no constant
ELEMENT_mm, AMPLIFIER_F = (6.0, 3.0), 1e-9
"""Length along the wall, beginning at the dome, and width of an element; feedback of its amplifier: assumed, none is printed."""


@dataclass(frozen=True)
class PatternRow:
    """One assumed pattern: frequency (Hz), precession factor, and the share of its energy that stretches the wall."""

    name: str
    frequency: float
    precession_factor: float
    membrane_share: float


@dataclass(frozen=True)
class BellTheory:
    """The two-pattern model with three patterns on one bell, and the solver: `solid` on the card's stem, `free` without."""

    card: str
    rows: tuple[PatternRow, ...]
    solid: PatternRow
    free: PatternRow


def compare_bell_theory() -> BellTheory:
    """Hold the pattern (19), the same without its factor cos(5πφ/φ_b), and one that does not stretch against the solver."""
    instrument = load_card(CARD)
    resonator = instrument.resonator
    elastic = instrument.material.elastic(instrument.reference_temperature)
    patterns = (
        ("(19) as printed", bell_theory.rayleigh_functions),
        ("(19) without cos(5πφ/φ_b)", bell_theory.rayleigh_functions_without_factor),
        ("solved from (17), (18)", bell_theory.inextensional_functions),
    )
    rows = []
    for name, pattern in patterns:
        model = bell_theory.two_pattern_model(resonator, elastic, pattern)
        rows.append(PatternRow(name, model.frequency, model.bryan_factor, model.membrane_share))

    def solve(name: str, body: Resonator) -> PatternRow:
        (mode,) = solve_modes(body, elastic)
        return PatternRow(name, mode.frequency, mode.bryan_factor, mode.energy_fractions.membrane)

    free = replace(resonator, support="free", stem=None)
    return BellTheory(instrument.name, tuple(rows), solve("solid, on its stem", resonator), solve("solid, free", free))


@dataclass(frozen=True)
class LoopReading:
    """A planted rate read from the integrated equations (23): open loop (25) and force rebalance (26), rad/s."""

    planted: float  # the rate, and its mean as read
    open_loop: float
    rebalance: float
    scale_error: float  # relative error of Ω = K A_q (30) with K of the resonator's constants
    singular_share: float  # part of the time in which ṗ of (24) is below a tenth of its amplitude
    second_form: float  # the mean read from the driven axis in open loop, second form of (24), rad/s
    from_charges: float  # the mean read in force rebalance from the charges of the piezo elements, (27)–(29), rad/s
    volts_per_um: float  # sum of the amplifiers of elements 3 and 7 per micrometre of the mouth
    printed_share: float  # part of the charge that (27) as printed leaves, σ_φφ over σ_θθ + σ_φφ


def read_planted_rate(planted: float = 2.0) -> LoopReading:
    """Integrate (23) with a coupling c₁ and read a rate (rad/s) back by (24)–(26) for amplitudes, by (27)–(29) and by (30)."""
    from scipy.integrate import solve_ivp

    bell, ring, share = _bell_with_elements()
    omega = bell.omega
    found = {}
    time = 2 * np.pi / omega / 24 * np.arange(int(0.03 * omega / (2 * np.pi) * 24))
    for name, rebalance in (("open", 0.0), ("rebalance", 40.0)):

        def slope(t: float, y: np.ndarray, gain: float = rebalance) -> list[float]:
            p, q, dp, dq = y
            coupling = 2 * planted * bell.b
            ddp = (coupling * dq - bell.c0 * p - bell.c1 * q) / bell.m0
            ddq = (-gain * dq - coupling * dp - bell.c0 * q - bell.c1 * p) / bell.m0
            return [dp, dq, ddp, ddq]

        start = [0.0, 0.0, omega * 1e-6, 0.0]
        y = solve_ivp(slope, (0, time[-1]), start, "DOP853", time, rtol=1e-10, atol=1e-16).y
        at, P = demodulate(time, y[0], omega)
        _, Q = demodulate(time, y[1], omega)
        _, F = demodulate(time, -rebalance * y[3], omega)
        read = read_rate_from_loop(bell, omega, at, P, Q, F if rebalance else None)
        late = (at > 0.01) & (at < at[-1] - 0.001)
        found[name] = float(np.mean(read[late]))
        if not rebalance:
            second = read_rate_from_drive(bell, omega, at, P, Q, np.zeros_like(P))
            found["second"] = float(np.mean(second[late]))
        else:
            # the amplifiers' voltages, and those that give the force on elements 2 and 6
            sensed = ring.displacements(ring.voltages(ring.charges(y[0], y[1])))
            drives = np.zeros((COUNT, len(time)))
            drives[[i - 1 for i in DRIVE_Q]] = -rebalance * y[3] / sum(ring.coupling[i - 1, 1] for i in DRIVE_Q)
            columns = (demodulate(time, x, omega)[1] for x in (*sensed, ring.forces(drives)[1]))
            found["charges"] = float(np.mean(read_rate_from_loop(bell, omega, at, *columns)[late]))
            K = scale_of_rebalance(bell, omega, float(abs(P[-1])))
            by_scale = K * float(np.real(F[-1] / (1j * P[-1] / abs(P[-1]))))
    return LoopReading(
        planted, found["open"], found["rebalance"], by_scale / planted - 1, 2 * np.arcsin(0.1) / np.pi,
        found["second"], found["charges"], abs(1e-6 / ring.scales[0]), share,
    )  # fmt: skip


def _bell_with_elements() -> tuple[BellResonator, PiezoRing, float]:
    """The card's bell as (23) with a coupling c₁, the elements on its cylinder, and σ_φφ over the sum of the stresses there."""
    instrument = load_card(CARD)
    body = instrument.resonator
    (mode,) = solve_modes(body, instrument.material.elastic(instrument.reference_temperature))
    lengths = [segment.length for segment in body.segments]
    top, height = lengths[0] / sum(lengths), ELEMENT_mm[0] * 1e-3 / sum(lengths)
    stresses = shell_faces(mode.solution, body)[1].mean_stress(top, top + height)
    along, around = (one / mode.largest_displacement for one in stresses)
    width, dome = ELEMENT_mm[1] * 1e-3, body.segments[0]
    assert isinstance(dome, Arc)
    ring = PiezoRing(along + around, D31_PZT5A, ELEMENT_mm[0] * width * 1e-3, width / dome.radius, AMPLIFIER_F)
    m0 = mode.modal_mass
    bell = BellResonator(m0=m0, b=2 * m0 * mode.bryan_factor, c0=m0 * (2 * np.pi * mode.frequency) ** 2, c1=3.0)
    return bell, ring, along / (along + around)


EQUATIONS = (
    ("(1)–(3)", "meridian, domain, principal radii", "correct; in (3) roots and a minus sign are missing: ρ₁ of the hyperbola is negative"),
    ("(5), (6)", "Hooke's law, strains of the body", "correct"),
    ("(7)", "equilibrium in shell coordinates", "correct along the circumference; along the meridian it has σ_φθ sin φ instead of σ_φυ sin φ; along meridian and normal it has terms in ∂ρ₁/∂φ that do not occur in the divergence of the stress (zero on hemisphere and cylinder, but not on the hyperbola)"),
    ("(8)–(12)", "displacement, rate, acceleration", "correct; minus signs and dots are missing"),
    ("(13)–(15)", "slow, steady rate; inertial force; equations of motion", "the third equation of (13) lacks −2Ω u̇_φ cos φ and has cos φ instead of sin φ with u̇_υ; (14) repeats u̇_υ instead of u̇_φ; (15) follows from the corrected (7) and (13)"),
    ("(16)", "two patterns", "the parity of two components is exchanged; as printed, the two patterns of a perfect bell would be coupled (c₁ ≠ 0)"),
    ("(17)–(19)", "inextensional condition, and the pattern", "the pattern (19) is not inextensional: see the table"),
    ("(20)", "two-degree-of-freedom equations", "correct in form; the printed m₀, b and c₀ contain no integral and are linear in the pattern; c₁ has only terms in U, which come from (16). The Galerkin integrals used here give c₁ = 0"),
    ("(21), (22)", "k = b/(2m₀), ω² = c₀/m₀", "correct for n = 2"),
    ("(23)", "the same with forces", "correct"),
    ("(24)–(26)", "rate from p, q and f_q", "printed with ω² q̇ instead of ω² q and f_q instead of f_q/m₀, and singular twice per period; correct for amplitudes"),
    ("(27)–(29)", "charge of the piezo elements, displacement, rate from charges", "(27) has σ_νν instead of σ_θθ; σ_νν is zero across a free wall, and σ_φφ alone gives only a fraction of the charge (below). (28), (29) are correct with the corrections to (26). Section 2.2 senses with elements 2, 6 and drives with 4, 8; section 3.2, (27) and (28) sense with 4, 8 and drive with 2, 6, as is assumed here. The rate is the same"),
    ("(30), (31)", "Ω = K A_q; scale, null and noise", "correct for the settled loop: K = 1/(4 k m₀ ω P)"),
)  # fmt: skip

# (20): the printed coefficient as far as its copy shows it, ours, and what stands between them. In the copy the fraction bars, most minus
# signs and the marks of derivatives are lost: a blank between two terms is a sign that is lost, ′ a derivative where the text says so.
COEFFICIENTS = (
    ("m₀", "ρ h π W(φ)", "π ρ ∫ h (U² + V² + W²) r ds", "linear in one component, no integral: kg/m² times a displacement"),
    ("b", "ρ h π V(φ) (cos φ + sin φ)", "2 π ρ ∫ h V (−U cos φ − W sin φ) r ds",
     "linear; of the products V U and V W of the Coriolis force only V remains"),
    (
        "c₀",
        "π { G (W′ sin φ + 2V) / ((ρ₂ + υ)² sin φ) + 1/((ρ₂ + υ) sin φ) [ 2G (W′ sin φ + 2V)/(ρ₂ + υ) + 2G (2V sin φ 4W)/((ρ₂ + υ) sin φ)"
        " + 6G (½ W cos φ/((ρ₂ + υ) sin φ) + ½ W/(ρ₁ + υ)) cos φ + (2V/(ρ₁ + υ) + (2 sin φ V 4W)/((ρ₂ + υ) sin φ)) λ ]"
        " + 1/(ρ₁ + υ) [ G (2V′ W sin φ 4U + …) … ], G (W cos φ/((ρ₂ + υ) sin φ) + W/(ρ₁ + υ)) (dρ₁/dφ)/(ρ₁ + υ)² }",
        "π ∫ { E h/(1−ν²) [ε_s² + ε_θ² + 2ν ε_s ε_θ + (1−ν)/2 γ²] + E h³/(12(1−ν²)) [κ_s² + κ_θ² + 2ν κ_s κ_θ + …] } r ds",
        "stress at one point of the wall (Pa/m per metre of amplitude), neither multiplied by the pattern nor integrated over the wall; no power of h, hence no bending",
    ),
    (
        "c₁",
        "π [ 10 G U cos φ/((ρ₂ + υ) sin φ) + 2λ (U/(ρ₁ + υ) U cos φ/((ρ₂ + υ) sin φ))/((ρ₂ + υ) sin φ)"
        " + 2G U (dρ₁/dφ)/((ρ₂ + υ)(ρ₁ + υ)² sin φ) + 2G (W cos φ/((ρ₂ + υ) sin φ) W/(ρ₁ + υ)) + … ]",
        "zero",
        "on a body of revolution every circumferential integral between two patterns a quarter wave apart vanishes; the terms come from the exchanged parity in (16)",
    ),
)  # fmt: skip


PATTERNS = (
    "name: Pattern",
    Column(lambda row: _hertz(row.frequency), "Frequency"),
    "precession_factor: Precession factor .4f",
    Column(lambda row: 0 if row.membrane_share < 1e-9 else row.membrane_share, "Membrane energy", "%", ".3g", scale=100.0),
)  # fmt: skip
PATTERNS_NOTE = "First three rows: (21), (22) with m₀, b and c₀ computed for the assumed pattern. Stretching the wall is of order (R/h)² stiffer than bending it."
SYMBOLS_NOTE = (
    "U: along the meridian, V: circumferential, W: normal, with the parity of (16) corrected; ε, κ, γ: the strains (5), (6) of the"
    " pattern. Our copy of the paper lacks fraction bars, most minus signs and derivative marks: a blank between two terms is a missing sign, and … marks illegible parts."
)
CHECKED = "0: Equation | 1: Content | 2: Result of the check"
CORRECTED = "0:  | 1: Printed, as far as legible | 2: Corrected (U, V, W as in (19)) | 3: Difference"


def theory_chapters(theory: BellTheory, reading: LoopReading) -> list[Chapter]:
    """Return the two chapters."""
    printed, solid = theory.rows[0], theory.solid
    excess = 100 * (theory.rows[-1].frequency / solid.frequency - 1)
    told = (
        f"The paper states that the pattern (19) does not stretch the wall. It does: with this pattern (22) gives {_hertz(printed.frequency)},"
        f" {printed.frequency / solid.frequency:.0f} times the {_hertz(solid.frequency)} of the solid model. The pattern"
        f" that satisfies (17), (18) along the meridian is {excess:.0f} % above the solid model, because it ignores the free"
        " edge, as Rayleigh's form does on a dome. The command hrg derive --bell derives every equation."
    )
    mean = "error of the mean rate"
    loop = {
        "applied rate": f"{reading.planted:.6g} rad/s",
        f"{mean} in open loop, (25)": _error(reading.open_loop, reading.planted),
        f"{mean} in force rebalance, (26)": _error(reading.rebalance, reading.planted),
        f"{mean} from the driven axis in open loop, second form of (24)": _error(reading.second_form, reading.planted),
        f"{mean} from the charges of the elements, (27)–(29)": _error(reading.from_charges, reading.planted),
        "amplifier voltage of elements 3 and 7 per µm of rim displacement (assumed: PZT-5A, 6 × 3 mm, 1 nF)": f"{reading.volts_per_um:.3g} V",
        "part of the charge in (27) as printed": f"{100 * reading.printed_share:.0f} %",
        "error of Ω = K A_q with K = 1/(4 k m₀ ω P), (30)": f"{1e6 * reading.scale_error:+.2g} ppm",
        "part of the time in which ṗ is below a tenth of its amplitude and (24) fails": f"{100 * reading.singular_share:.0f} %",
    }
    rows = [*theory.rows, theory.free, theory.solid]
    return [
        Chapter("BVG equations (1)–(22): theory of the bell-shaped resonator", [
            told,
            Table(f"Card '{theory.card}', n = 2", rows, PATTERNS, PATTERNS_NOTE),
            Table("Coefficients of (20), printed and corrected", COEFFICIENTS, CORRECTED, SYMBOLS_NOTE),
            Table("Equation by equation", EQUATIONS, CHECKED),
        ]),
        Chapter("BVG equations (23)–(30): rate from the control loop", [
            Table("Rate recovered from a simulation of (23) with a coupling c₁", list(loop.items()),
                "0: Quantity | 1: Value"),
        ]),
    ]  # fmt: skip


def _hertz(value: float) -> str:
    return f"{value / 1e3:.4g} kHz"


def _error(read: float, planted: float) -> str:
    return f"{1e6 * (read / planted - 1):+.2g} ppm"
