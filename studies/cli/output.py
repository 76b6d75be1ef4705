"""How every command speaks: a table for people, one JSON object for programs, nothing else on stdout."""

import functools
import inspect
import json as json_module
import math
import os
import sys
import textwrap
from collections.abc import Callable, Generator, Mapping, Sequence
from typing import Annotated, Any

from cyclopts import Parameter

Payload = Mapping[str, Any]
Answer = Generator[Payload | tuple[Payload, int], None, Any]
"""What a command is: see `answers`."""

OUTPUTS = ("out", "save", "report", "emit", "draft", "preview")
"""Arguments of commands that name a file to be written."""
SHORT_WORD = 10  # characters; longer words, such as file names, may be folded inside


def answers(schema: str) -> Callable[[Callable[..., Answer]], Callable[..., int]]:
    """Give a command the flag --json, with the schema of its object.

    A command works, yields once the object for programs, with an exit status beside it where that is not 0, and then
    prints the same for people; with --json the object is printed and the rest does not run. A command that prints in another
    form, such as code, returns before it yields.
    """

    def give(command: Callable[..., Answer]) -> Callable[..., int]:
        own = inspect.signature(command)

        @functools.wraps(command)
        def run(*arguments: Any, json: bool = False, **options: Any) -> int:
            _spare_inputs(own.bind(*arguments, **options).arguments)
            steps = command(*arguments, **options)
            try:
                answer = next(steps)
            except StopIteration as ended:
                return int(ended.value or 0)
            payload, status = answer if isinstance(answer, tuple) else (answer, 0)
            if json:
                steps.close()
                print_json(payload)
            else:
                next(steps, None)
            return status

        flag = Annotated[bool, Parameter(help=f"Print one JSON object (schema {schema}) instead of text.")]
        last = inspect.Parameter("json", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=flag)
        signature = own.replace(parameters=[*own.parameters.values(), last], return_annotation=int)
        run.__signature__ = signature  # type: ignore[attr-defined]
        run.__annotations__ = {**command.__annotations__, "json": flag, "return": int}
        return run

    return give


def _spare_inputs(arguments: Mapping[str, Any]) -> None:
    """Refuse to write over a file that the same command reads.

    Raises
    ------
    InputError
        One of `OUTPUTS` is a file that another argument names too.
    """
    written = {name: arguments[name] for name in OUTPUTS if isinstance(arguments.get(name), str)}
    read = [
        word
        for name, value in arguments.items()
        if name not in OUTPUTS
        for word in (value if isinstance(value, tuple | list) else [value])
        if isinstance(word, str)
    ]
    for name, path in written.items():
        if any(os.path.isfile(path) and os.path.isfile(word) and os.path.samefile(path, word) for word in read):
            from studies.errors import InputError

            raise InputError(
                f"--{name} {path}: this file is read by the same command and would be lost; name another one."
            )


def print_json(payload: Mapping[str, Any]) -> None:
    """Print one JSON object."""
    sys.stdout.write(dump_json(payload))


def dump_json(payload: Mapping[str, Any]) -> str:
    """Return the text of one JSON object; NaN and infinity become null, numpy values plain numbers."""
    return json_module.dumps(_plain(payload), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]], note: str = "") -> None:
    """Print a table with numbers aligned to the right; floats must already be formatted text.

    On a narrow terminal columns of text and headings fold, numbers never: where they alone are too wide, lines run over.
    """
    from rich.cells import cell_len
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from studies.files.given import printable

    table = Table(
        title=Text(printable(title)),
        title_justify="left",
        caption=Text(printable(note)) if note else None,
        caption_justify="left",
        header_style="bold",
    )
    console = Console(width=None if sys.stdout.isatty() else 160)
    cells = [["" if cell is None else printable(str(cell)) for cell in row] for row in rows]
    columns = [printable(column) for column in columns]
    headings, numeric, widths, least = [], [], [], []
    for k, column in enumerate(columns):
        inside = [row[k] for row in cells]
        numeric.append(bool(rows) and all(_looks_numeric(row[k]) for row in rows))
        if numeric[-1]:
            least.append(max(map(len, (*inside, *column.split(" ")))))
            headings.append("\n".join(textwrap.wrap(column, least[-1], break_long_words=False, break_on_hyphens=False)))
            widths.append(least[-1])
        else:
            words = [word for cell in (*inside, column) for word in cell.split()]
            least.append(max((len(w) for w in words if _looks_numeric(w) or len(w) <= SHORT_WORD), default=1))
            headings.append(column)
            widths.append(max((cell_len(line) for cell in (*inside, column) for line in cell.splitlines()), default=1))
    frame = 3 * len(columns) + 1
    while sum(widths) + frame > console.width and any(w > low for w, low in zip(widths, least, strict=True)):
        widest = max((k for k in range(len(widths)) if widths[k] > least[k]), key=lambda k: widths[k])
        widths[widest] -= 1
    for heading, number, width in zip(headings, numeric, widths, strict=True):
        table.add_column(Text(heading), justify="right" if number else "left", width=width, overflow="fold")
    for row in cells:
        table.add_row(*map(Text, row))
    console.width = max(console.width, sum(widths) + frame)
    console.print(table)


def say(message: str) -> None:
    """Tell people something beside the result (standard error)."""
    from studies.files.given import printable

    print(printable(message), file=sys.stderr)


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
