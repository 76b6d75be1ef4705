"""The derivation of the averaged dynamics as one chain of equations, as text for a terminal and in LaTeX."""

from collections.abc import Iterable
from dataclasses import dataclass
from textwrap import fill

import sympy as sp

from compensation.derivation import averaging, demodulated, filters, oscillator, transfer_functions

WIDTH = 120
# Unicode has no subscript for these; in code they are Delta_tau, psi_tau …
PLAIN = {
    oscillator.delta_tau: "Δ(1/τ)",
    oscillator.psi_tau: "ψτ",
    oscillator.delta_omega: "Δω",
    oscillator.psi_omega: "ψω",
}
TYPESET = {oscillator.delta_tau: r"\Delta(1/\tau)", oscillator.delta_omega: r"\Delta\omega"} | {
    sp.Symbol(name): latex
    for name, latex in (
        ("x''+ω²x", r"\ddot x + \omega^2 x"),
        ("y''+ω²y", r"\ddot y + \omega^2 y"),
        ("W_2(jλ)", r"W_2(j\lambda)"),
        ("A(λ)", r"A(\lambda)"),
        ("φ(λ)", r"\varphi(\lambda)"),
        *((f"{name}'", rf"\dot {name}") for name in ("X", "Y", "a", "q", "A_1", "A_2")),
        ("ψ'", r"\dot\psi"),
        ("φ'", r"\dot\phi"),
        ("ΔA_1'", r"\Delta\dot A_1"),
        ("ΔA_2'", r"\Delta\dot A_2"),
    )
}
WORDS = {
    letter: f"${name}$"
    for letter, name in zip(
        "ωψφτζγ²−", (r"\omega", r"\psi", r"\phi", r"\tau", r"\zeta", r"\gamma", "^2", "-"), strict=True
    )
} | {
    "{": r"\{",
    "}": r"\}",
}


@dataclass(frozen=True)
class Step:
    """One step: its number in the paper on demodulated dynamics (empty where it has none), title and equations."""

    number: str
    title: str
    equations: tuple[sp.Eq, ...]


def steps() -> list[Step]:
    """Return the whole chain, from the oscillator of two patterns to what a rate does to the measured one."""
    position, velocity = (sp.ImmutableMatrix(sp.symbols(names, real=True)) for names in ("x y", "x' y'"))
    motion = oscillator.small_forces(position, velocity, sp.ImmutableMatrix([sp.Symbol("f_x"), sp.Symbol("f_y")]))
    return [
        Step(
            "",
            "Two patterns of a turning shell: oscillator in a plane, constant rate",
            _name("x''+ω²x y''+ω²y", motion),
        ),
        Step("", "Amplitudes x = Re{X exp(iωt)}, averaged over a cycle", _name("X' Y'", averaging.amplitude_rates())),
        Step(
            "",
            "Orbit (X, Y) = R(ψ)(a, −iq) exp(iφ): amplitude, quadrature, precession, phase (Lynch's form)",
            _name("a' q' ψ' φ'", averaging.ellipse_rates()),
        ),
        Step(
            "7",
            "The paper's amplitude equations, from (4) by x = Im{A exp(jωt)}",
            _zero(demodulated.amplitude_equations()),
        ),
        Step("", "Their leading order where A_1, A_2 are slow", _name("A_1' A_2'", demodulated.slow_rates())),
        Step(
            "3",
            "Averaged less the paper's: only the neglected reaction of the secondary",
            _name("ΔA_1' ΔA_2'", demodulated.neglected()),
        ),
        *_demodulated(),
        Step("25", "Measured over actual rate, 1/τ = kζ", _name("W", [demodulated.measured_rate()])),
        Step(
            "35",
            "Optimal filter after it: white noise of γ² times the signal's power, renormalised",
            _name("G", [filters.derive_wiener_filter("white").renormalised]),
        ),
        Step(
            "36",
            "The same for noise that rises with the frequency",
            _name("G", [filters.derive_wiener_filter("high-pass").renormalised]),
        ),
        Step(
            "",
            "False rate over a cross-damping ζ_12 that varies, equal modes (paper on cross-damping, (9) from (8))",
            _name("W_12", [filters.tuned_cross_damping()]),
        ),
    ]


def _demodulated() -> list[Step]:
    """Return eqs. (8)–(24): the settled primary, and what a rate does to the secondary."""
    found = transfer_functions
    secondary, slow, parts = found.rate_to_secondary(), found.rate_to_secondary(slow=True), found.real_parts()
    response, amplitude, phase = found.responses()
    real, imaginary = found.primary_parts()
    return [
        Step("8", "Settled primary", _name("A_1", [found.settled_primary()])),
        Step("9", "The second of (7) while the primary is settled", _zero([found.settled_equation()])),
        Step("10-12", "Laplace transform of (9): secondary over rate", _name("W_2", [found.A_1 * secondary])),
        Step("13", "Its frequency response, for a rate that oscillates at lambda", _name("W_2(jλ)", [response])),
        Step("14", "Amplitude and phase of (13)", _name("A(λ) φ(λ)", (amplitude, phase))),
        Step("15", "Poles of (12)", _name("s_1 s_2", found.poles())),
        Step("16", "Slow motion, without the second derivative", _name("W_2", [found.A_1 * slow])),
        Step("17", "Its pole", _name("s_1", [found.slow_pole()])),
        Step(
            "18, 19", "Real and imaginary part of (8); the copy prints a stray j", _name("A_1R A_1I", (real, imaginary))
        ),
        Step(
            "20-22",
            "Secondary with real coefficients: A_2R = (A_1R M_RR + A_1I M_RI) W/P, A_2I = (A_1R M_IR + A_1I M_II) W/P, W the rate",
            _name("M_RR M_RI M_IR M_II P", parts),
        ),
        Step("23, 24", "Equal modes, primary at resonance, slow", _name("W_20", [found.tuned_gain()])),
    ]


def emit_text() -> str:
    """Return the chain for a terminal: each equation in two dimensions under its number and title."""
    blocks = []
    for step in steps():
        head = fill(f"({step.number}) {step.title}" if step.number else step.title, WIDTH)
        shown = (equation.xreplace({old: sp.Symbol(new) for old, new in PLAIN.items()}) for equation in step.equations)
        drawn = (sp.pretty(equation, use_unicode=True, num_columns=WIDTH - 4) for equation in shown)
        blocks.append("\n\n".join([head, *("\n".join(f"    {line}" for line in text.splitlines()) for text in drawn)]))
    return "\n\n".join(blocks) + "\n"


def emit_latex() -> str:
    """Return the chain as a LaTeX fragment for a document that loads amsmath."""
    lines = ["% Averaged dynamics of a Coriolis vibratory gyro; \\input this where amsmath is loaded."]
    for step in steps():
        tag = rf" \tag{{{step.number}}}" if step.number else r" \notag"
        first, *others = [typeset(equation) for equation in step.equations]
        body = " \\\\\n".join([first + tag, *(line + r" \notag" for line in others)])
        title = step.title.translate({ord(letter): written for letter, written in WORDS.items()})
        lines.append(f"\\paragraph{{{title}}}\n\\begin{{gather}}\n{body}\n\\end{{gather}}")
    return "\n".join(lines) + "\n"


def write_plainly(equation: sp.Eq) -> str:
    """Return one equation on one line, in Python's notation."""
    return f"{equation.lhs} = {equation.rhs}"


def typeset(equation: sp.Eq) -> str:
    """Return one equation in LaTeX."""
    return str(sp.latex(equation, symbol_names=TYPESET))


def _zero(expressions: Iterable[sp.Expr]) -> tuple[sp.Eq, ...]:
    return tuple(sp.Eq(left, sp.S.Zero, evaluate=False) for left in expressions)


def _name(names: str, expressions: object) -> tuple[sp.Eq, ...]:
    pairs = zip((sp.Symbol(name) for name in names.split()), expressions, strict=True)  # type: ignore[call-overload]
    return tuple(sp.Eq(left, right, evaluate=False) for left, right in pairs)
