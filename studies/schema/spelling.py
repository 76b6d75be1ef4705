"""Values as TOML text, for files whose lines carry comments; what needs none is written by tomli-w."""

from typing import Any


def spell_value(value: Any) -> str:
    """Return a text, a truth, a number, a list or a table as TOML on one line, with every digit."""
    import tomli_w

    if isinstance(value, list | tuple):
        return f"[{', '.join(map(spell_value, value))}]"
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {spell_value(one)}' for key, one in value.items())} }}"
    if isinstance(value, float):
        return repr(float(value))
    return tomli_w.dumps({"x": value}).removeprefix("x = ").rstrip("\n")
