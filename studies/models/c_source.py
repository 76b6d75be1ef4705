"""C99 source of emitted models from the files of `sources`: the head comment, polynomials with all digits, the test."""

from collections.abc import Sequence
from importlib.resources import files
from string import Template

from studies.models.file import Model


def head(model: Model) -> str:
    """Return the comment that says where the code comes from and where it holds, and the includes."""
    lines = [
        f"Compensation model '{model.kind}' for {model.compensates}, made by {model.made_by or 'an unknown program'}.",
        *(f"Fitted to {s.path}, {s.rows} rows, sha256 {s.sha256 or 'unknown'}." for s in model.sources),
        *(f"Valid for {name} from {low:.9g} to {high:.9g}." for name, (low, high) in model.validity.items()),
    ]
    return "\n".join(f"/* {one_line(line)} */" for line in lines) + "\n#include <math.h>\n"


def write_c(name: str, **values: object) -> str:
    """Return one of the `sources` with its $words filled in."""
    source = (files("studies.models") / "sources" / f"{name}.c").read_text(encoding="utf-8")
    return Template(source).substitute(values)


def polynomial(name: str, variable: str, coefficients: Sequence[float]) -> str:
    """Return a static C function that evaluates Σ cₖ xᵏ by Horner's rule."""
    expression = f"{float(coefficients[-1])!r}"
    for c in reversed(coefficients[:-1]):
        expression = f"({expression}) * {variable} + ({float(c)!r})"
    return f"static double {name}(double {variable}) {{\n    return {expression};\n}}"


def one_line(words: str) -> str:
    """Return somebody's words fit for a comment of C and for XML: one line, no characters that are not shown."""
    words = "".join(c if c.isprintable() else " " for c in words)
    return " ".join(words.split()).replace("*/", "* /").replace("/*", "/ *")


def self_test(rows: Sequence[Sequence[float]], meaning: str, step: str) -> str:
    """Return a `main` under HRG_SELF_TEST that compares the code with rows of what Python computes, by C statements on `row`."""
    width = len(rows[0])
    table = ",\n".join("    {" + ", ".join("NAN" if x != x else repr(float(x)) for x in row) + "}" for row in rows)
    return write_c("self_test", meaning=meaning, width=width, table=table, step=step)
