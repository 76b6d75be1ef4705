"""The chain of equations as text for a terminal and as a LaTeX fragment."""

import re
from collections.abc import Mapping, Sequence
from textwrap import fill

import sympy as sp

from shell.derivation.chain import Step

WIDTH = 120
GREEK = {
    "epsilon": "ε",
    "kappa": "κ",
    "gamma": "γ",
    "sigma": "σ",
    "theta": "θ",
    "phi": "φ",
    "upsilon": "υ",
    "phitheta": "φθ",
    "phiz": "φz",
    "thetaz": "θz",
}
LATEX = {
    "epsilon": r"\epsilon", "kappa": r"\kappa", "gamma": r"\gamma", "sigma": r"\sigma", "rho": r"\rho", "Omega": r"\Omega", "defect": r"\mathrm{defect}", "theta": r"\theta ",
    "phi": r"\phi ", "upsilon": r"\upsilon ", "phitheta": r"\phi\theta ", "phiz": r"\phi z", "thetaz": r"\theta z",
}  # fmt: skip
WORD = re.compile("phi|theta|upsilon|[a-z]")
DIRECTIONS = ("phi", "theta", "upsilon", "z", "phitheta", "phiz", "thetaz", "1", "2", "r")
TYPESET = {
    "Δτ": r"\Delta\tau",
    "τ_shift": r"\tau_{\mathrm{shift}}",
    "(lnP)′": r"(\ln P)'",
    "(lnM)′": r"(\ln M)'",
    "lnP": r"\ln P",
    "lnM": r"\ln M",
    "∂lnf/∂lnE": r"\frac{\partial \ln f}{\partial \ln E}",
    "∂lnf/∂ν": r"\frac{\partial \ln f}{\partial \nu}",
    "∂lnf/∂lnρ": r"\frac{\partial \ln f}{\partial \ln \rho}",
    "∂lnf/∂lnh": r"\frac{\partial \ln f}{\partial \ln h}",
    "∂lnf/∂lnr": r"\frac{\partial \ln f}{\partial \ln r}",
    "∂lnf/∂φ₂": r"\frac{\partial \ln f}{\partial \phi_2}",
    "TCF_E": r"\mathrm{TCF}_E",
    "TCF_ν": r"\mathrm{TCF}_\nu",
    "TCF_ρ": r"\mathrm{TCF}_\rho",
    "TCF_h": r"\mathrm{TCF}_h",
    "TCF_r": r"\mathrm{TCF}_r",
    "TCF": r"\mathrm{TCF}",
    "ε_φφ": r"\varepsilon_{\phi\phi}",
    "ε_θθ": r"\varepsilon_{\theta\theta}",
    "2ε_φθ": r"2\varepsilon_{\phi\theta}",
}
IN_WORDS = {
    "φ": r"$\phi$", "θ": r"$\theta$", "∂": r"$\partial$", "ρ": r"$\rho$", "Ω": r"$\Omega$", "υ": r"$\upsilon$",
    "σ": r"$\sigma$", "ν": r"$\nu$", "α": r"$\alpha$", "π": r"$\pi$", "₀": "$_0$", "₁": "$_1$", "_": r"\_", "–": "--",
}  # fmt: skip


HRG_TITLE = "Rayleigh's inextensional shell, HRG paper equations (1)-(15)"
BELL_TITLE = "The bell's theory, BVG paper equations (1)-(22)"


def emit_text(steps: Sequence[Step]) -> str:
    """Return a chain for a terminal: each equation in two dimensions under its number and title."""
    return "\n\n".join(_text_of(step) for step in steps) + "\n"


def emit_latex(steps: Sequence[Step], title: str) -> str:
    """Return a chain as a LaTeX fragment for a document that loads amsmath, tagged with the paper's numbers."""
    head = f"% {title}; \\input this where amsmath is loaded.\n"
    return head + "\n".join(_latex_of(step) for step in steps)


def typeset(equation: sp.Eq) -> str:
    """Return one equation in LaTeX."""
    names = {symbol: TYPESET[symbol.name] for symbol in equation.atoms(sp.Symbol) if symbol.name in TYPESET}
    for symbol in equation.atoms(sp.Symbol):
        base, _, indices = _spell(symbol.name, LATEX).partition("_")
        if base and symbol not in names:
            names[symbol] = f"{base}_{{{indices}}}"
    return str(sp.latex(equation, symbol_names=names, ln_notation=True))


def write_plainly(equation: sp.Eq) -> str:
    """Return one equation on one line, in Python's notation."""
    return f"{equation.lhs} = {equation.rhs}"


def _text_of(step: Step) -> str:
    head = f"({step.number}) {step.title}" if step.number else step.title
    drawn = (
        sp.pretty(_with_greek_letters(equation), use_unicode=True, num_columns=WIDTH - 4) for equation in step.equations
    )
    return "\n\n".join([fill(head, WIDTH), *("\n".join(f"    {line}" for line in text.splitlines()) for text in drawn)])


def _latex_of(step: Step) -> str:
    words = "".join(IN_WORDS.get(letter, letter) for letter in step.title)
    lines = [typeset(equation) for equation in step.equations]
    tag = rf" \tag{{{step.number}}}" if step.number else r" \notag"
    body = " \\\\\n".join([lines[0] + tag, *(line + r" \notag" for line in lines[1:])])
    return f"\\paragraph{{{words}}}\n\\begin{{gather}}\n{body}\n\\end{{gather}}\n"


def _with_greek_letters(equation: sp.Eq) -> sp.Eq:
    """Return the equation with e_φ, κ_θ, σ_φυ,z … spelt in letters: Unicode has no subscript θ for the printer to use."""
    spelt = {symbol: _spell(symbol.name, GREEK) for symbol in equation.atoms(sp.Symbol)}
    return equation.xreplace({symbol: sp.Symbol(name) for symbol, name in spelt.items() if name})


def _spell(name: str, letters: Mapping[str, str]) -> str:
    """Return a name whose indices are directions, or that has a derivative behind a comma, in given letters; else nothing."""
    plain, comma, derivative = name.partition(",")
    base, *indices = plain.split("_")
    if not (indices or comma) or not all(index in DIRECTIONS for index in indices):
        return ""
    by = "".join(letters.get(word, word) for word in WORD.findall(derivative))
    return (
        f"{letters.get(base, base)}_" + "".join(letters.get(index, index) for index in indices) + (comma and f",{by}")
    )
