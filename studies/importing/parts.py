"""Raw files of any kind as one table: text, sheets or channels, and files that continue one another."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from studies.errors import InputError
from studies.importing.channels import is_container, read_channel_table
from studies.importing.mapping import FileMap
from studies.importing.raw import TextTable, read_plain, read_raw
from studies.importing.tables import ParsedTable, RawTable


def read_parts(paths: Sequence[str | Path], file: FileMap) -> RawTable:
    """Read raw files that continue one another as one table."""
    if is_container(paths[0]):
        return read_channel_table(paths, file)
    import pandas as pd

    plain = [table for table in (read_plain(path, file) for path in paths) if table is not None]
    if len(plain) == len(paths) == 1:
        return plain[0]
    if len(plain) == len(paths) and all(list(table.columns) == list(plain[0].columns) for table in plain):
        columns = {name: np.concatenate([table.columns[name] for table in plain]) for name in plain[0].columns}
        return ParsedTable(tuple(part for table in plain for part in table.parts), file.missing, columns)
    tables = [read_raw(path, file) for path in paths]
    first = tables[0]
    for other in tables[1:]:
        if list(other.cells) != list(first.cells):
            raise InputError(f"{other.path}: has other columns than {first.path}; give it its own [[file]] table.")
    cells = pd.concat([table.cells for table in tables], ignore_index=True)
    return TextTable(tuple(part for table in tables for part in table.parts), first.missing, cells, first.decimal)
