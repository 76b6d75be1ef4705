"""Line of a TOML file where a key stands, or the name of a built-in card, for errors that name it."""

import re
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

from studies.errors import InputError
from studies.files.reading import read_bytes

NAMED = re.compile(
    r"(?P<file>\S.*?\.toml)(?: \[+(?P<table>[\w.-]+)\]+)?(?: number (?P<number>\d+))?(?: \[(?P<inner>[\w.-]+)\])?:"
    r" (?:unknown key '(?P<unknown>[^']+)'|(?P<key>[\w.-]+))"
)
"""What messages about a key begin with: "mine.toml [[effect]] number 2: weight must …"."""
HEADING = re.compile(r"\s*(\[\[?)\s*([A-Za-z_][\w.-]*)\s*\]\]?\s*(?:#.*)?$")
KEY = re.compile(r"\s*\"?([\w.-]+)\"?\s*=")


def point_out(message: str) -> str:
    """Return a message with "(file:line)" of the key or table that it names; a built-in card is named, with how to copy it."""
    named = NAMED.match(message)
    if named is not None and (file := Path(named["file"])).parent == Path(str(files("studies"))) / "cards":
        copied = f"To change it, copy it: hrg card new MY.toml --like {file.stem}."
        return f"the built-in card {file.stem}{message[named.end('file') :]} {copied}"
    if named is None or re.search(r"\bline \d", message):
        return message
    parts = (named["table"], named["inner"], named["unknown"] or named["key"])
    wanted = [word for part in parts if part for word in part.split(".")]
    try:
        text = read_bytes(Path(named["file"])).decode("utf-8-sig")
    except (InputError, UnicodeDecodeError):
        return message
    depth, line = 0, 0
    for number, path in _places(text.splitlines(), int(named["number"] or 1)):
        if len(path) > depth and path == wanted[: len(path)]:
            depth, line = len(path), number
    return f"{message} ({named['file']}:{line})" if line else message


def _places(lines: list[str], member: int) -> Iterator[tuple[int, list[str]]]:
    """Yield every line of a heading or a key, from 1, with its dotted path; of arrays of tables only one member."""
    table: list[str] = []
    count: dict[str, int] = {}
    skipped = False
    for number, line in enumerate(lines, 1):
        if heading := HEADING.match(line):
            if heading[1] == "[[":
                count[heading[2]] = count.get(heading[2], 0) + 1
                skipped = count[heading[2]] != member
            elif not any(heading[2].startswith(f"{array}.") for array in count):
                skipped = False
            table = heading[2].split(".")
        key = KEY.match(line)
        if not skipped and (heading or key):
            yield number, table + (key[1].split(".") if key else [])
