"""How every command speaks: a table for people, one JSON object for programs, nothing else on stdout."""

import json as json_module
import math
import sys
from collections.abc import Mapping, Sequence
from typing import Any


def print_json(payload: Mapping[str, Any]) -> None:
    """Print one JSON object."""
    sys.stdout.write(dump_json(payload))


def dump_json(payload: Mapping[str, Any]) -> str:
    """Return the text of one JSON object; NaN and infinity become null, numpy values plain numbers."""
    return json_module.dumps(_plain(payload), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]], note: str = "") -> None:
    """Print a table with numbers aligned to the right; floats must already be formatted text."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(
        title=Text(title),
        title_justify="left",
        caption=Text(note) if note else None,
        caption_justify="left",
        header_style="bold",
    )
    for k, column in enumerate(columns):
        numeric = bool(rows) and all(_looks_numeric(row[k]) for row in rows)
        table.add_column(Text(column), justify="right" if numeric else "left")
    for row in rows:
        table.add_row(*[Text("" if cell is None else str(cell)) for cell in row])
    console = Console(width=None if sys.stdout.isatty() else 160)
    console.print(table)


def say(message: str) -> None:
    """Tell people something beside the result (standard error)."""
    print(message, file=sys.stderr)


def _looks_numeric(cell: object) -> bool:
    if cell is None or isinstance(cell, int | float):
        return True
    return str(cell)[:1] in "-−+.0123456789±—" if str(cell) else True


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
