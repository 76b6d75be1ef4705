"""Values as TOML text, for files whose lines carry comments; what needs none is written by tomli-w."""

from typing import Any


def spell_value(value: Any) -> str:
    """Return a text, a truth, a number or a list as TOML, with every digit."""
    import tomli_w

    if isinstance(value, list | tuple):
        return f"[{', '.join(map(spell_value, value))}]"
    if isinstance(value, float):
        return repr(float(value))
    return tomli_w.dumps({"x": value}).removeprefix("x = ").rstrip("\n")
