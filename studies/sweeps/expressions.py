"""Parameters that follow from others: `end_mm = "radius_mm + 4"`, arithmetic of parameters and dotted keys, never run as code."""

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import Annotated, Any

from studies.errors import InputError, nearest
from studies.schema.keys import Keys, says

LookUp = Callable[[str], Any]
BINARY: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}  # fmt: skip
UNARY: dict[type[ast.unaryop], Callable[[float], float]] = {ast.UAdd: operator.pos, ast.USub: operator.neg}
ALLOWED = (ast.BinOp, ast.UnaryOp, ast.Load, *BINARY, *UNARY)
NAME = re.compile(r"(?<![\w.])[^\W\d][\w.]*")  # also a dotted one
LONGEST = 500  # characters
MOST_POWER = 100.0


class Derived(Keys, frozen=True, kw_only=True):
    """A key of the card that follows from others."""

    name: Annotated[str, says("a key of the card", example="resonator.stem.end_mm")]
    expression: Annotated[str, says("numbers, parameters, keys, + - * / ** and brackets", example="4 - radius_mm")]

    def __post_init__(self) -> None:
        parse(self.expression)

    @property
    def names(self) -> tuple[str, ...]:
        """The names that the formula uses, in their order."""
        return tuple(dict.fromkeys(NAME.findall(re.sub(r"\s*\.\s*", ".", self.expression))))

    def value(self, known: Mapping[str, Any]) -> float:
        """Return the value for known names."""
        where = f"{self.name} = '{self.expression}'"
        try:
            found = _evaluate(parse(self.expression), known)
        except (ArithmeticError, ValueError) as error:
            raise InputError(f"{where} cannot be computed ({error}).") from error
        if isinstance(found, complex) or not math.isfinite(found):
            raise InputError(f"{where} is not a finite number.")
        return found


def parse(text: str) -> ast.expr:
    """Return the tree of a formula of numbers, names, + - * / ** and brackets; ValueError says what else is there."""
    if len(text) > LONGEST:
        raise ValueError(f"the expression is longer than {LONGEST} characters.")
    try:
        tree = ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ValueError(f"'{text}' is not a formula; write one such as \"radius_mm + 4\".") from None
    if not all(map(_is_allowed, ast.walk(tree))):
        raise ValueError(f"'{text}' may contain only numbers, names of parameters, + - * / ** and brackets.")
    return tree


def fill_in(derived: Sequence[Derived], values: Mapping[str, Any], in_card: LookUp) -> dict[str, Any]:
    """Return the parameters with the derived ones added, in their order; `in_card` gives a key of the card by its name."""
    filled = dict(values)
    for one in derived:
        filled[one.name] = one.value({name: _look_up(one, name, filled, in_card) for name in one.names})
    return filled


def _look_up(one: Derived, name: str, values: Mapping[str, Any], in_card: LookUp) -> float:
    beside = f"{one.name.rpartition('.')[0]}.{name}"
    table = f"{one.name.split('.')[0]}.{name}"
    ending = [known for known in values if known.endswith(f".{name}")]
    candidates = (name, beside, table, *(ending if len(ending) == 1 else []))
    for look, candidate in product((values.__getitem__, in_card), candidates):
        try:
            found = look(candidate)
            break
        except (KeyError, InputError):
            continue
    else:
        raise InputError(f"{one.name} = '{one.expression}': '{name}' is neither a parameter nor a key of the card{nearest(name, values)}")  # fmt: skip
    if isinstance(found, str) or found is None:
        raise InputError(f"{one.name} = '{one.expression}': '{name}' has no usable number.")
    return float(found)


def _is_allowed(node: ast.AST) -> bool:
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float) and not isinstance(node.value, bool)
    return isinstance(node, ALLOWED) or _is_name(node)


def _is_name(node: ast.AST) -> bool:
    return isinstance(node, ast.Name) or (isinstance(node, ast.Attribute) and _is_name(node.value))


def _evaluate(node: ast.expr, known: Mapping[str, Any]) -> float:
    if isinstance(node, ast.BinOp):
        left, right = _evaluate(node.left, known), _evaluate(node.right, known)
        if isinstance(node.op, ast.Pow) and abs(right) > MOST_POWER:
            raise ValueError(f"the exponent {right:g} is too large")
        return BINARY[type(node.op)](left, right)
    if isinstance(node, ast.UnaryOp):
        return UNARY[type(node.op)](_evaluate(node.operand, known))
    return float(node.value if isinstance(node, ast.Constant) else known[ast.unparse(node)])  # type: ignore[arg-type]
