"""Chapters on the BVG paper's theory, equations (1)–(22), and on its reading of the rate, (23)–(30), for `hrg reproduce`."""

from studies.papers.bvg_theory import BellTheory, LoopReading
from studies.reports.page import Chapter, Table, Text

EQUATIONS = (
    ("(1)–(3)", "meridian, domain, principal radii", "hold; in (3) roots and a minus sign are lost: ρ₁ of the hyperbola is negative"),
    ("(5), (6)", "Hooke's law, strains of the body", "hold"),
    ("(7)", "equilibrium in shell coordinates", "around, it holds; along the meridian it has σ_φθ sin φ for σ_φυ sin φ, and along meridian and normal terms in ∂ρ₁/∂φ that the divergence of the stress has not (zero on hemisphere and cylinder, not on the hyperbola)"),
    ("(8)–(12)", "displacement, rate, acceleration", "hold; minus signs and dots are lost"),
    ("(13)–(15)", "slow, steady rate; inertial force; equations of motion", "the third of (13) lacks −2Ω u̇_φ cos φ and has cos φ for sin φ at u̇_υ; (14) repeats u̇_υ for u̇_φ; with our (7) and (13), (15) follows"),
    ("(16)", "two patterns", "parity of two components is exchanged: read so, a perfect bell would couple its two patterns (c₁ ≠ 0)"),
    ("(17)–(19)", "no stretching, and the pattern", "(19) is not without stretching: see the table"),
    ("(20)", "two-degree-of-freedom equations", "the form holds; the printed m₀, b, c₀ have no integral and are of the first power of the pattern, c₁ has only terms in U, which come from (16): ours are Galerkin integrals, and c₁ = 0"),
    ("(21), (22)", "k = b/(2m₀), ω² = c₀/m₀", "hold for n = 2"),
    ("(23)", "the same with forces", "holds"),
    ("(24)–(26)", "rate from p, q and f_q", "printed with ω² q̇ for ω² q and f_q for f_q/m₀, and singular twice in every period; taken for amplitudes they hold"),
    ("(27)–(29)", "charge of the piezo elements, displacement, rate from charges", "(27) has σ_νν for σ_θθ: across a free wall it is zero, and σ_φφ alone is a fraction of the charge (below); (28), (29) hold with the mends of (26). Section 2.2 senses with elements 2, 6 and drives with 4, 8; section 3.2, (27) and (28) sense with 4, 8 and drive with 2, 6: taken here. The rate is the same"),
    ("(30), (31)", "Ω = K A_q; scale, null and noise", "hold where the loop rests: K = 1/(4 k m₀ ω P)"),
)  # fmt: skip

# (20): the printed coefficient as far as its copy shows it, ours, and what stands between them. In the copy the fraction bars, most minus
# signs and the marks of derivatives are lost: a blank between two terms is a sign that is lost, ′ a derivative where the text says so.
COEFFICIENTS = (
    (
        "m₀",
        "ρ h π W(φ)",
        "π ρ ∫ h (U² + V² + W²) r ds",
        "first power of one component, no integral: kg/m² times a displacement",
    ),
    (
        "b",
        "ρ h π V(φ) (cos φ + sin φ)",
        "2 π ρ ∫ h V (−U cos φ − W sin φ) r ds",
        "first power; of the products V U and V W that Coriolis' force makes, V alone is left",
    ),
    (
        "c₀",
        "π { G (W′ sin φ + 2V) / ((ρ₂ + υ)² sin φ) + 1/((ρ₂ + υ) sin φ) [ 2G (W′ sin φ + 2V)/(ρ₂ + υ) + 2G (2V sin φ 4W)/((ρ₂ + υ) sin φ)"
        " + 6G (½ W cos φ/((ρ₂ + υ) sin φ) + ½ W/(ρ₁ + υ)) cos φ + (2V/(ρ₁ + υ) + (2 sin φ V 4W)/((ρ₂ + υ) sin φ)) λ ]"
        " + 1/(ρ₁ + υ) [ G (2V′ W sin φ 4U + …) … ], G (W cos φ/((ρ₂ + υ) sin φ) + W/(ρ₁ + υ)) (dρ₁/dφ)/(ρ₁ + υ)² }",
        "π ∫ { E h/(1−ν²) [ε_s² + ε_θ² + 2ν ε_s ε_θ + (1−ν)/2 γ²] + E h³/(12(1−ν²)) [κ_s² + κ_θ² + 2ν κ_s κ_θ + …] } r ds",
        "stresses of one point of the wall (Pa/m per metre of amplitude), neither multiplied with the pattern nor integrated over the"
        " wall; no power of h, so that no bending is in it",
    ),
    (
        "c₁",
        "π [ 10 G U cos φ/((ρ₂ + υ) sin φ) + 2λ (U/(ρ₁ + υ) U cos φ/((ρ₂ + υ) sin φ))/((ρ₂ + υ) sin φ)"
        " + 2G U (dρ₁/dφ)/((ρ₂ + υ)(ρ₁ + υ)² sin φ) + 2G (W cos φ/((ρ₂ + υ) sin φ) W/(ρ₁ + υ)) + … ]",
        "zero",
        "between two patterns a quarter of a wave apart every integral around vanishes on a body of revolution; the terms come from the"
        " parity exchanged in (16)",
    ),
)  # fmt: skip


def theory_chapters(theory: BellTheory, reading: LoopReading) -> list[Chapter]:
    """Return the two chapters."""
    printed, solid = theory.rows[0], theory.solid
    excess = 100 * (theory.rows[-1].frequency / solid.frequency - 1)
    rows = [
        [row.name, _hertz(row.frequency), f"{row.precession_factor:.4f}", _share(row.membrane_share)]
        for row in (*theory.rows, theory.free, theory.solid)
    ]
    patterns = Table(
        f"Card '{theory.card}', n = 2",
        ["Pattern", "Frequency", "Precession factor", "Energy that stretches the wall"],
        rows,
        "First three: (21), (22) with our m₀, b and c₀ of the assumed pattern. A pattern that stretches the wall is as stiff as a"
        " membrane, (R/h)² stiffer than one that bends it.",
    )
    loop = Table(
        "A planted rate, read back from integrated equations (23) with a coupling c₁",
        ["Quantity", "Value"],
        [
            ["planted", f"{reading.planted:.6g} rad/s"],
            ["error of the mean read in open loop, (25)", _error(reading.open_loop, reading.planted)],
            ["error of the mean read in force rebalance, (26)", _error(reading.rebalance, reading.planted)],
            [
                "error of the mean read from the driven axis in open loop, second form of (24)",
                _error(reading.second_form, reading.planted),
            ],
            [
                "error of the mean read from the charges of the elements, (27)–(29)",
                _error(reading.from_charges, reading.planted),
            ],
            [
                "amplifiers of elements 3 and 7 per µm of the mouth (PZT-5A, 6 × 3 mm, 1 nF: assumed)",
                f"{reading.volts_per_um:.3g} V",
            ],
            ["part of the charge that (27) as printed leaves", f"{100 * reading.printed_share:.0f} %"],
            ["error of Ω = K A_q with K = 1/(4 k m₀ ω P), (30)", f"{1e6 * reading.scale_error:+.2g} ppm"],
            [
                "part of the time with ṗ below a tenth of its amplitude, where (24) fails",
                f"{100 * reading.singular_share:.0f} %",
            ],
        ],
    )
    return [
        Chapter(
            "BVG equations (1)–(22): the theory of the bell",
            [
                Text(
                    f"The pattern (19) is said not to stretch the wall. It does: with it, (22) gives {_hertz(printed.frequency)} where"
                    f" the solver finds {_hertz(solid.frequency)}, {printed.frequency / solid.frequency:.0f} times as much. The pattern"
                    f" that really solves (17), (18) along the meridian lies {excess:.0f} % above the solid, as Rayleigh's does on a dome: it ignores the free"
                    " edge. The command hrg derive --bell shows every equation derived."
                ),
                patterns,
                Table(
                    "The coefficients of (20), printed and ours",
                    [
                        "",
                        "Printed, as far as the copy shows it",
                        "Ours (U, V, W as (19) reads)",
                        "How they differ",
                    ],
                    [list(row) for row in COEFFICIENTS],
                    "U along the meridian, V around, W along the normal, the parity of (16) mended; ε, κ, γ the strains (5), (6) of the pattern."
                    " In the copy fraction bars, most minus signs and marks of derivatives are lost: two terms with a blank between them lack"
                    " their sign; … stands for what cannot be put together.",
                ),
                Table(
                    "Equation by equation", ["BVG", "What it says", "What we find"], [list(row) for row in EQUATIONS]
                ),
            ],
        ),
        Chapter("BVG equations (23)–(30): the rate from the loop", [loop]),
    ]


def _hertz(value: float) -> str:
    return f"{value / 1e3:.4g} kHz"


def _share(value: float) -> str:
    return "0" if value < 1e-9 else f"{100 * value:.3g} %"


def _error(read: float, planted: float) -> str:
    return f"{1e6 * (read / planted - 1):+.2g} ppm"
