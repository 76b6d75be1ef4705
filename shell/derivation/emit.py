"""The chain of equations as text for a terminal and as a LaTeX fragment."""

from textwrap import fill

import sympy as sp

from shell.derivation.chain import Case, Step, steps

WIDTH = 120
GREEK = {"epsilon": "ε", "kappa": "κ", "gamma": "γ", "sigma": "σ", "theta": "θ", "phi": "φ"}
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
}
IN_WORDS = {"φ": r"$\phi$", "θ": r"$\theta$", "∂": r"$\partial$", "ρ": r"$\rho$", "Ω": r"$\Omega$"}


def emit_text(case: Case) -> str:
    """Return the chain for a terminal: each equation in two dimensions under its number and title."""
    return "\n\n".join(_text_of(step) for step in steps(case)) + "\n"


def emit_latex(case: Case) -> str:
    """Return the chain as a LaTeX fragment for a document that loads amsmath, tagged with the paper's numbers."""
    head = "% Rayleigh's inextensional shell, HRG paper equations (1)-(14); \\input this where amsmath is loaded.\n"
    return head + "\n".join(_latex_of(step) for step in steps(case))


def typeset(equation: sp.Eq) -> str:
    """Return one equation in LaTeX."""
    names = {symbol: TYPESET[symbol.name] for symbol in equation.atoms(sp.Symbol) if symbol.name in TYPESET}
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
    words = step.title
    for letter, command in IN_WORDS.items():
        words = words.replace(letter, command)
    lines = [typeset(equation) for equation in step.equations]
    tag = rf" \tag{{{step.number}}}" if step.number else r" \notag"
    body = " \\\\\n".join([lines[0] + tag, *(line + r" \notag" for line in lines[1:])])
    return f"\\paragraph{{{words}}}\n\\begin{{gather}}\n{body}\n\\end{{gather}}\n"


def _with_greek_letters(equation: sp.Eq) -> sp.Eq:
    """Return the equation with e_φ, κ_θ … spelt in letters: Unicode has no subscript θ for the printer to use."""
    letters = {}
    for symbol in equation.atoms(sp.Symbol):
        base, *indices = symbol.name.split("_")
        if indices and all(index in ("phi", "theta", "z") for index in indices):
            spelt = GREEK.get(base, base) + "_" + "".join(GREEK.get(index, index) for index in indices)
            letters[symbol] = sp.Symbol(spelt)
    return equation.xreplace(letters)
