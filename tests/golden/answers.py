"""Golden answers: the JSON object of every command, and its page as text, on the small inputs beside this file.

They are our own output, kept to notice a change. After a change that was meant, write them anew and read the difference:

    python -m tests.golden.answers [NAME ...]
"""

import contextlib
import html.parser
import io
import json
import re
import shlex
import shutil
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from decimal import Decimal
from pathlib import Path
from typing import Any

import pytest

from tests.sketches import sketch_pages

HERE = Path(__file__).parent
CASES: dict[str, dict[str, Any]] = tomllib.loads((HERE / "commands.toml").read_text(encoding="utf-8"))
DIGITS = 6
LOOSE = ("relative_error", "relative_error_estimate", "energy_balance_error", "solver_relative_error",
         "interpolation_relative_error", "bytes")  # fmt: skip
NOTHING = 1e-13
ENDS, OF_WIDTH = ("value", "low", "high"), 0.02
NUMBER = re.compile(r"[-−+]?\d+(?:\.\d+)?(?:e[-−+]?\d+)?")


@contextlib.contextmanager
def workplace() -> Iterator[Path]:
    """A folder with a copy of the inputs, as the current one."""
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        shutil.copytree(HERE / "inputs", folder, dirs_exist_ok=True)
        yield Path(folder)


def answer(name: str) -> tuple[dict[str, Any], str]:
    """The JSON object of one command, rounded, and the text of its page, a line for each piece."""
    from studies.cli import main

    case, out = CASES[name], io.StringIO()
    words = [*shlex.split(case["words"]), "--json", *(["--report", "page.html"] if case.get("page") else [])]
    with workplace() as folder, contextlib.redirect_stderr(io.StringIO()) as told:
        for before in case.get("before", ()):
            with contextlib.redirect_stdout(io.StringIO()):
                assert main(shlex.split(before)) == 0, (before, told.getvalue())
        with contextlib.redirect_stdout(out):
            assert main(words) == 0, (words, told.getvalue())
        reader = _Text()
        if case.get("page"):
            reader.feed(
                Path("page.html").read_text(encoding="utf-8").replace("<wbr>", "").replace(str(folder), "FOLDER")
            )
    home = str(HERE.parents[1])
    found = json.loads(out.getvalue().replace(str(folder), "FOLDER").replace(home, "HOME"))
    return rounded(found, (*LOOSE, *case.get("loose", ()))), "\n".join(reader.lines) + "\n"


def differences(was: Any, now: Any, within: float = 2e-5, place: str = "") -> list[str]:
    """Where two answers differ; numbers may by `within` (two units of the last of `DIGITS` digits), and by `NOTHING` from 0.

    An estimate may by `OF_WIDTH` of its own interval: where a fit stops differs from processor to processor and from version to version.
    """
    if isinstance(was, dict) and isinstance(now, dict):
        if _is_estimate(was) and _is_estimate(now):
            width = was["high"] - was["low"]
            near = {key for key in ENDS if abs(was[key] - now[key]) <= OF_WIDTH * width}
            was, now = ({k: v for k, v in one.items() if k not in near} for one in (was, now))
        gone = [
            f"{place}.{key}: only in {'the file' if key in was else 'the answer'}" for key in was.keys() ^ now.keys()
        ]
        return gone + [
            one for key in was.keys() & now.keys() for one in differences(was[key], now[key], within, f"{place}.{key}")
        ]
    if isinstance(was, list) and isinstance(now, list) and len(was) == len(now):
        return [
            one
            for k, (a, b) in enumerate(zip(was, now, strict=True))
            for one in differences(a, b, within, f"{place}[{k}]")
        ]
    if isinstance(was, float | int) and isinstance(now, float | int) and not isinstance(was, bool):
        return [] if abs(was - now) <= within * max(abs(was), abs(now)) + NOTHING else [f"{place}: {was} -> {now}"]
    return [] if was == now else [f"{place}: {was!r} -> {now!r}"]


def _is_estimate(one: dict[str, Any]) -> bool:
    return all(isinstance(one.get(key), float | int) for key in ENDS)


def changed_lines(was: str, now: str, within: float = 5e-3) -> list[str]:
    """Lines of two pages that differ in a word, or in a number by more than `within` and a unit of its last digit."""

    def number(text: str) -> float:
        return float(text.replace("−", "-"))

    def near(x: str, y: str) -> bool:
        unit = 10.0 ** int(Decimal(x.replace("−", "-")).as_tuple().exponent)
        return abs(number(x) - number(y)) <= within * max(abs(number(x)), abs(number(y))) + 1.01 * unit * (
            "." in x or "e" in x
        )

    old, new = was.splitlines(), now.splitlines()
    found = [f"{len(old)} -> {len(new)} lines"] if len(old) != len(new) else []
    for a, b in zip(old, new, strict=False):
        if a == b:
            continue
        numbers = zip(NUMBER.findall(a), NUMBER.findall(b), strict=False)
        if not all(near(x, y) for x, y in numbers) or NUMBER.sub("#", a) != NUMBER.sub("#", b):
            found.append(f"{a!r} -> {b!r}")
    return found


def rounded(value: Any, loose: tuple[str, ...]) -> Any:
    """The same with `DIGITS` significant digits; of what stands under a loose key only the kind."""
    if isinstance(value, dict):
        return {k: type(v).__name__ if k in loose else rounded(v, loose) for k, v in value.items()}
    if isinstance(value, list):
        return [rounded(item, loose) for item in value]
    return float(f"{value:.{DIGITS - 1}e}") if isinstance(value, float) else value


class _Text(html.parser.HTMLParser):
    """Collects what is read on a page, without its figures, scripts and footer."""

    hidden = ("style", "script", "footer", "svg")

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []
        self.inside: list[str] = []

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        if tag in self.hidden:
            self.inside.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if self.inside and self.inside[-1] == tag:
            self.inside.pop()

    def handle_data(self, data: str) -> None:
        if data.strip() and not self.inside:
            self.lines.append(" ".join(data.split()))


def write(names: list[str]) -> None:
    """Write the golden files of the named commands, or of all."""
    sketch_pages(pytest.MonkeyPatch())
    for name in names or CASES:
        found, page = answer(name)
        text = json.dumps(found, indent=1, ensure_ascii=False) + "\n"
        (HERE / "answers" / f"{name}.json").write_text(text, encoding="utf-8")
        if CASES[name].get("page"):
            (HERE / "pages" / f"{name}.txt").write_text(page, encoding="utf-8")
        print(name)


if __name__ == "__main__":
    write(sys.argv[1:])
