"""Chain of equations, rows (number, title, left sides, right sides), as text for a terminal, as LaTeX and on one line each."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import repeat
from textwrap import fill, indent
from typing import Any

import sympy as sp

WIDTH = 120
GREEK = {
    "epsilon": "ε", "kappa": "κ", "gamma": "γ", "sigma": "σ", "theta": "θ", "phi": "φ", "upsilon": "υ",
    "phitheta": "φθ", "phiz": "φz", "thetaz": "θz",
}  # fmt: skip
LATEX = {
    "epsilon": r"\epsilon", "kappa": r"\kappa", "gamma": r"\gamma", "sigma": r"\sigma", "rho": r"\rho", "zeta": r"\zeta",
    "Omega": r"\Omega", "defect": r"\mathrm{defect}", "theta": r"\theta ", "phi": r"\phi ", "upsilon": r"\upsilon ",
    "phitheta": r"\phi\theta ", "phiz": r"\phi z", "thetaz": r"\theta z",
}  # fmt: skip
WORD = re.compile("phi|theta|upsilon|[a-z]")
DIRECTIONS = ("phi", "theta", "upsilon", "z", "phitheta", "phiz", "thetaz", "1", "2", "r")
# Unicode has no subscript for these; in code they are Delta_tau, psi_tau …
PLAIN = {"Delta_tau": "Δ(1/τ)", "psi_tau": "ψτ", "Delta_omega": "Δω", "psi_omega": "ψω"}
TYPESET = {
    "Δτ": r"\Delta\tau", "τ_shift": r"\tau_{\mathrm{shift}}",
    "(lnP)′": r"(\ln P)'", "(lnM)′": r"(\ln M)'", "lnP": r"\ln P", "lnM": r"\ln M",
    **{f"∂lnf/∂{x}": rf"\frac{{\partial \ln f}}{{\partial {by}}}" for x, by in (
        ("lnE", r"\ln E"), ("ν", r"\nu"), ("lnρ", r"\ln \rho"), ("lnh", r"\ln h"), ("lnr", r"\ln r"), ("φ₂", r"\phi_2"),
    )},
    "TCF": r"\mathrm{TCF}",
    **{f"TCF_{x}": rf"\mathrm{{TCF}}_{by}" for x, by in (("E", "E"), ("ν", r"\nu"), ("ρ", r"\rho"), ("h", "h"), ("r", "r"))},
    "ε_φφ": r"\varepsilon_{\phi\phi}", "ε_θθ": r"\varepsilon_{\theta\theta}", "2ε_φθ": r"2\varepsilon_{\phi\theta}",
    "Delta_tau": r"\Delta(1/\tau)", "Delta_omega": r"\Delta\omega",
    "x''+ω²x": r"\ddot x + \omega^2 x", "y''+ω²y": r"\ddot y + \omega^2 y",
    "W_2(jλ)": r"W_2(j\lambda)", "A(λ)": r"A(\lambda)", "φ(λ)": r"\varphi(\lambda)",
    **{f"{name}'": rf"\dot {name}" for name in ("X", "Y", "a", "q", "A_1", "A_2")},
    "ψ'": r"\dot\psi", "φ'": r"\dot\phi", "ΔA_1'": r"\Delta\dot A_1", "ΔA_2'": r"\Delta\dot A_2",
}  # fmt: skip
IN_WORDS = {
    "φ": r"$\phi$", "θ": r"$\theta$", "∂": r"$\partial$", "ρ": r"$\rho$", "Ω": r"$\Omega$", "υ": r"$\upsilon$",
    "σ": r"$\sigma$", "ν": r"$\nu$", "α": r"$\alpha$", "π": r"$\pi$", "ω": r"$\omega$", "ψ": r"$\psi$", "τ": r"$\tau$",
    "ζ": r"$\zeta$", "γ": r"$\gamma$", "²": "$^2$", "−": "$-$", "₀": "$_0$", "₁": "$_1$", "_": r"\_", "–": "--",
    "{": r"\{", "}": r"\}",
}  # fmt: skip


@dataclass(frozen=True)
class Step:
    """One step of a derivation: its number in the paper (empty where the paper has none) and its equations."""

    number: str
    title: str
    equations: tuple[sp.Eq, ...]

    @property
    def heading(self) -> str:
        """Number, where the paper has one, and title."""
        return f"({self.number}) {self.title}" if self.number else self.title


def read_chain(
    rows: Iterable[tuple[str, str, Any, Any]], edit: Callable[[sp.Expr], sp.Expr] = lambda side: side
) -> list[Step]:
    """Return the steps of a chain; `edit` changes each side of its equations."""
    steps = []
    for number, title, left, right in rows:
        if left is None:
            pairs = [(equation.lhs, equation.rhs) for equation in right]
        else:
            lefts = [sp.Symbol(name) for name in left.split()] if isinstance(left, str) else _several(left)
            rights = list(repeat(sp.S.Zero, len(lefts))) if right == 0 else _several(right)
            pairs = list(zip(lefts, rights, strict=True))
        equations = tuple(sp.Eq(edit(one), edit(other), evaluate=False) for one, other in pairs)
        steps.append(Step(number, title, equations))
    return steps


def emit_text(steps: Sequence[Step]) -> str:
    """Return a chain for a terminal: each equation in two dimensions under its number and title."""
    blocks = [f"{fill(step.heading, WIDTH)}\n\n{indent(draw(step), '    ')}" for step in steps]
    return "\n\n".join(blocks) + "\n"


def draw(step: Step) -> str:
    """Return the equations of a step in two dimensions."""
    return "\n\n".join(sp.pretty(_spelt(one), use_unicode=True, num_columns=WIDTH - 4) for one in step.equations)


def emit_latex(steps: Sequence[Step], title: str) -> str:
    """Return a chain as a LaTeX fragment for a document that loads amsmath, tagged with the paper's numbers."""
    blocks = [f"% {title}; \\input this where amsmath is loaded."]
    for step in steps:
        words = "".join(IN_WORDS.get(letter, letter) for letter in step.title)
        tags = [rf" \tag{{{step.number}}}" if step.number else r" \notag", *repeat(r" \notag", len(step.equations) - 1)]
        body = " \\\\\n".join(typeset(one) + tag for one, tag in zip(step.equations, tags, strict=True))
        blocks.append(f"\\paragraph{{{words}}}\n\\begin{{gather}}\n{body}\n\\end{{gather}}\n")
    return "\n".join(blocks)


def typeset(equation: sp.Eq) -> str:
    """Return one equation in LaTeX."""
    symbols = equation.atoms(sp.Symbol)
    names = {one: TYPESET[one.name] for one in symbols if one.name in TYPESET}
    for one in symbols - names.keys():
        base, _, indices = _spell(one.name, LATEX).partition("_")
        if base:
            names[one] = f"{base}_{{{indices}}}"
    return str(sp.latex(equation, symbol_names=names, ln_notation=True))


def write_plainly(equation: sp.Eq) -> str:
    """Return one equation on one line, in Python's notation."""
    return f"{equation.lhs} = {equation.rhs}"


def _several(sides: Any) -> list[sp.Expr]:
    """The sides of a row, of which there may be only one."""
    return [sides] if isinstance(sides, sp.Expr) and not isinstance(sides, sp.MatrixBase) else list(sides)


def _spelt(equation: sp.Eq) -> sp.Eq:
    """Return the equation with e_φ, κ_θ, σ_φυ,z … spelt in letters: Unicode has no subscript θ for the printer to use."""
    spelt = {one: PLAIN.get(one.name) or _spell(one.name, GREEK) for one in equation.atoms(sp.Symbol)}
    return equation.xreplace({one: sp.Symbol(name) for one, name in spelt.items() if name and name != one.name})


def _spell(name: str, letters: Mapping[str, str]) -> str:
    """Return a name whose indices are directions, or that has a derivative behind a comma, in given letters; else nothing."""
    plain, comma, derivative = name.partition(",")
    base, *indices = plain.split("_")
    if not (indices or comma) or not all(index in DIRECTIONS for index in indices):
        return ""
    by = "".join(letters.get(word, word) for word in WORD.findall(derivative))
    own = "".join(letters.get(index, index) for index in indices)
    return f"{letters.get(base, base)}_{own}" + (comma and f",{by}")
