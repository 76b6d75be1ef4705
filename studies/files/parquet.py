"""Tables of numbers as Parquet files (the extra `formats`): columns by name, comment lines in the metadata of the schema."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from studies.errors import InputError
from studies.files.reading import digest, load_library, opened
from studies.progress import tell

Table = Mapping[str, NDArray[np.float64]]

COMMENTS = b"hrg.comments"
ROWS = 1 << 20  # of a row group


def is_parquet(path: str | Path) -> bool:
    """Tell whether a file is a Parquet file, by the end of its name."""
    return Path(path).suffix.lower() == ".parquet"


def read_comments_and_names(path: str | Path) -> tuple[tuple[str, ...], list[str]]:
    """Return the comment lines and the names of the columns."""
    with opened(path):
        schema = _open(path).schema_arrow
    try:
        comments = json.loads((schema.metadata or {}).get(COMMENTS, b"[]"))
        return tuple(" ".join(str(line).split()) for line in comments), list(schema.names)
    except (ValueError, TypeError):
        raise InputError(f"{path}: its comments are not a list of texts; write the file again.") from None


def read_table(path: str | Path) -> tuple[dict[str, NDArray[np.float64]], str]:
    """Return the columns as numbers, missing ones NaN, and the hash of the file."""
    parquet, values = _open(path), {}
    for field in parquet.schema_arrow:
        if not str(field.type).startswith(("double", "float", "halffloat", "int", "uint")):
            raise InputError(f"{path}: '{field.name}' holds {field.type}, not numbers; 'hrg import' reads such files.")
        try:
            values[field.name] = np.array(parquet.read(columns=[field.name]).column(0).to_numpy(), dtype=float)
        except Exception as error:
            raise _damaged(path, error) from None
    if not values or not len(next(iter(values.values()))):
        raise InputError(f"{path}: the table has no rows.")
    return values, digest(path)


def write_table(file: IO[bytes], columns: Table, comments: Sequence[str], path: str | Path) -> None:
    """Write columns of numbers and comment lines."""
    arrow, parquet = load_library("pyarrow", path, "Parquet"), load_library("pyarrow.parquet", path, "Parquet")
    fields = [(name, arrow.float64()) for name in columns]
    schema = arrow.schema(fields, {COMMENTS: json.dumps(list(comments)).encode()})
    # readings repeat too seldom for a dictionary; other encodings are smaller, but not every program reads them
    with parquet.ParquetWriter(file, schema, compression="zstd", use_dictionary=False) as writer:
        rows = len(next(iter(columns.values())))
        for begin in range(0, rows, ROWS):
            part = [arrow.array(values[begin : begin + ROWS]) for values in columns.values()]
            writer.write_table(arrow.table(part, schema))
            tell(f"writing {path}", min(begin + ROWS, rows) / rows)


def _open(path: str | Path) -> Any:
    library = load_library("pyarrow.parquet", path, "Parquet")
    try:
        return library.ParquetFile(str(path))
    except Exception as error:  # pyarrow has many kinds
        raise _damaged(path, error) from None


def _damaged(path: str | Path, error: Exception) -> InputError:
    said = " ".join(str(error).split())[:60]
    return InputError(f"{path}: is not a Parquet file, or is damaged or cut off ({said}); write it again.")
