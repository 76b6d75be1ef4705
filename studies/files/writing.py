"""Output files appear whole or not at all: written beside their place, then renamed into it."""

import errno
import importlib
import importlib.util
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING

from studies.errors import InputError
from studies.files.paths import claim

if TYPE_CHECKING:
    from studies.files.parquet import Table

MANY = 200_000  # rows of a portion


@contextmanager
def written_whole(path: str | Path) -> Iterator[IO[bytes]]:
    """Open a binary file that takes its name only when everything has been written; a link is followed, a pipe stays what it is."""
    temporary: Path | None = None
    try:
        target = _follow(Path(path))
        if target.is_dir():
            raise InputError(f"{path}: is a folder; give the name of a file.")
        claim(target)
        special = target.exists() and not target.is_file()
        if not target.parent.is_dir():
            raise InputError(f"{path}: cannot be written: there is no folder '{target.parent}'; create it.")
        folder = Path(tempfile.gettempdir()) if special else target.parent
        with (folder / f".hrg-{os.urandom(8).hex()}").open("xb") as file:
            temporary = Path(file.name)
            yield file
            file.flush()
            os.fsync(file.fileno())
        if special:
            with temporary.open("rb") as whole, target.open("wb") as outlet:
                shutil.copyfileobj(whole, outlet)
            return
        os.replace(temporary, target)
    except InputError:
        raise
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"{path}: cannot be written ({reason}); choose another place.") from error
    except ValueError as error:
        if "null" not in str(error):
            raise
        raise InputError(f"{str(path)!r}: a file's name cannot hold a zero byte; choose another name.") from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def _follow(path: Path) -> Path:
    """Return where a link leads to; any other path as it is."""
    if not path.is_symlink():
        return path
    target = Path(os.path.realpath(path))
    if target.is_symlink():
        raise OSError(errno.ELOOP, "its link leads back to itself")
    return target


def check_folder(path: str | Path) -> Path:
    """Make a folder for output files, in one that exists, and make sure that it can be written."""
    folder = Path(path)
    if not folder.parent.is_dir():
        raise InputError(f"{path}: cannot be written: there is no folder '{folder.parent}'; create it.")
    try:
        folder.mkdir(exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror}); choose another place.") from error


def write_text(path: str | Path, text: str) -> None:
    """Write UTF-8 text, whole or not at all."""
    with written_whole(path) as file:
        file.write(text.encode("utf-8"))


def write_csv(path: str | Path, head: Iterable[str], rows: Iterable[Iterable[str]]) -> None:
    """Write a table whose cells are text, whole or not at all."""
    write_text(path, "".join(f"{','.join(row)}\n" for row in (head, *rows)))


def write_numbers(path: str | Path, columns: "Table", form: str, notes: Iterable[str] = ()) -> None:
    """Write a short table of numbers in one format below lines of comments, whole or not at all."""
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    lines = [
        *(f"# {note}" for note in notes),
        ",".join(columns),
        *(",".join(format(x, form) for x in row) for row in rows),
    ]
    write_text(path, "\n".join([*lines, ""]))


def write_rows(file: IO[bytes], columns: "Table") -> Iterator[float]:
    """Write numbers as lines of cells that read back to the last digit, missing ones empty; yield the part that is done.

    Many rows go by pyarrow where it is installed, which writes 5.0 as 5 and is five times as fast.
    """
    rows = max(map(len, columns.values()), default=0)
    spell = _spell_fast if rows > MANY and importlib.util.find_spec("pyarrow") else _spell
    for begin in range(0, rows, MANY):
        spell(file, {name: values[begin : begin + MANY] for name, values in columns.items()})
        yield min(begin + MANY, rows) / rows


def _spell(file: IO[bytes], columns: "Table") -> None:
    cells = [map(repr, values.tolist()) for values in columns.values()]
    file.write(("\n".join(map(",".join, zip(*cells, strict=True))).replace("nan", "") + "\n").encode())


def _spell_fast(file: IO[bytes], columns: "Table") -> None:
    arrow, csv = importlib.import_module("pyarrow"), importlib.import_module("pyarrow.csv")
    table = arrow.table({name: arrow.array(values, from_pandas=True) for name, values in columns.items()})
    csv.write_csv(table, file, csv.WriteOptions(include_header=False))
