"""The averaged equations as self-contained Python or C code for controllers and simulators."""

from importlib.resources import files
from string import Template
from typing import Literal

import sympy as sp

from compensation.derivation.averaging import ellipse_rates


def emit_code(language: Literal["python", "c"]) -> str:
    """Return a module of Python or of C with ȧ, q̇, ψ̇, φ̇, common terms worked out once."""
    file, write, line = ("dynamics.c", sp.ccode, "    const double {name} = {value};")
    if language == "python":
        file, write, line = ("dynamics.py.txt", _python, "    {name} = {value}")
    template = Template((files("compensation.derivation") / "sources" / file).read_text(encoding="utf-8"))
    common, rates = sp.cse(list(ellipse_rates()), symbols=sp.numbered_symbols("common_"))
    lines = "\n".join(line.format(name=name, value=write(value)) for name, value in common)
    return template.substitute(common=lines, **dict(zip(("a", "q", "psi", "phi"), map(write, rates), strict=True)))


def _python(expression: sp.Expr) -> str:
    return str(sp.pycode(expression)).replace("math.", "")
