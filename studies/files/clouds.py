"""Measured points of a surface: x y z text, PLY or STL, or a table of deviations over position and azimuth."""

import logging
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from compensation.arrays import Array
from studies.errors import InputError
from studies.files.reading import check_file

UNITS = {"m": 1.0, "mm": 1e-3, "um": 1e-6}
Unit = Literal["m", "mm", "um"]
MESHES = (".ply", ".stl", ".obj")
PORTION = 1_000_000  # lines at a time
GRID = "position"  # the first cell of a table


@dataclass(frozen=True, eq=False)
class FaceGrid:
    """How far a face stands out of the material, m, (positions, azimuths); NaN where nothing was measured."""

    position: Array
    azimuth: Array
    values: Array


def read_cloud(path: str | Path, unit: Unit = "mm") -> Array | FaceGrid:
    """Points (count, 3) in m from text with x, y, z, or a table: `position,0,5,10,…` (°), then a position 0 … 1 and departures in µm."""
    file = check_file(path)
    if file.suffix.lower() in MESHES:
        points = _read_mesh(file)
    else:
        first, skipped = _first_line(file)
        if first.lower().startswith(GRID):
            return _read_grid(file, first, skipped)
        if "time_s" in first:
            raise InputError(f"{path}: is a record of a run, with time_s; points must be x y z text, .ply, .stl, .obj or a table.")  # fmt: skip
        if not any(sign.isdigit() for sign in first):  # names of the columns
            first, skipped = _first_line(file, skipped + 1)
        points = _read_text(file, first, skipped)
    if not len(points):
        raise InputError(f"{path}: has no points.")
    return points * UNITS[unit]


def _first_line(path: Path, begin: int = 0) -> tuple[str, int]:
    try:
        with path.open(encoding="utf-8-sig") as lines:
            for number, line in enumerate(lines):
                if number >= begin and line.strip() and not line.lstrip().startswith("#"):
                    return line.strip(), number
    except UnicodeDecodeError:
        raise InputError(f"{path}: not UTF-8 text; points must be x y z text, .ply, .stl, .obj or a table.") from None
    raise InputError(f"{path}: has no points.")


def _read_text(path: Path, first: str, skipped: int) -> Array:
    import pandas as pd

    spaced = len(first.split()) >= 3 and not re.search(r",\s|\s,", first)
    separator = ";" if ";" in first else r"\s+" if spaced else ","
    form: dict[str, Any] = {"sep": separator, "decimal": "." if separator == "," else "," if "," in first else "."}
    form |= {"skiprows": skipped, "header": None, "comment": "#", "usecols": [0, 1, 2], "dtype": float, "engine": "c"}
    kept = []
    try:
        for part in pd.read_csv(path, **form, chunksize=PORTION):
            values = part.to_numpy()
            kept.append(values[np.isfinite(values).all(axis=1)])
    except (ValueError, pd.errors.ParserError):
        raise InputError(f"{path}: is not a table of x y z: below the names of its columns each line needs three numbers; comments start with #.") from None  # fmt: skip
    return np.concatenate(kept)


def _read_mesh(path: Path) -> Array:
    import trimesh

    logging.getLogger("trimesh").setLevel(logging.CRITICAL)  # what it cannot read is said below, in one sentence
    try:
        loaded = trimesh.load(path, process=False)
        points = np.asarray(loaded.vertices, dtype=float)
    except Exception as error:
        raise InputError(f"{path}: is not a {path.suffix[1:].upper()} file, or is damaged; export it again, or give x y z text.") from error  # fmt: skip
    points = points[np.isfinite(points).all(axis=1)] if points.ndim == 2 else points[:0]
    if path.suffix.lower() == ".stl":
        points = np.unique(points, axis=0)  # each corner stands there once per triangle
    return points


FEWEST = 8  # azimuths of a table


def _read_grid(path: Path, first: str, skipped: int) -> FaceGrid:
    import pandas as pd

    separator = next((one for one in ";\t" if one in first), ",")
    form: dict[str, Any] = {"sep": separator, "skiprows": skipped, "comment": "#", "dtype": float, "index_col": 0}
    for decimal in "." if separator == "," else ".,":
        try:
            table = pd.read_csv(path, **form, decimal=decimal)
            azimuth = np.deg2rad([float(name.replace(decimal, ".")) for name in table.columns])
            break
        except (ValueError, pd.errors.ParserError):
            continue
    else:
        raise InputError(f"{path}: is not a table of deviations: after the line {GRID},0,5,10,… every cell must be a number or empty.")  # fmt: skip
    position = table.index.to_numpy(dtype=float)
    order = np.argsort(position)
    if len(position) < 1 or np.any(np.diff(position[order]) <= 0) or position.min() < 0 or position.max() > 1:
        raise InputError(f"{path}: the positions must lie between 0 (start) and 1 (rim), each only once.")
    step = 2 * np.pi / max(len(azimuth), 1)
    if len(azimuth) < FEWEST:
        raise InputError(f"{path}: {len(azimuth)} azimuths are too few for harmonics; a table needs {FEWEST} or more.")
    if np.any(abs(np.diff(azimuth) - step) > 0.01 * step):
        raise InputError(
            f"{path}: the azimuths do not close the circle: {len(azimuth)} columns need steps of {np.rad2deg(step):.4g}°; "
            "remove a column that repeats the first at 360°, or add missing columns with empty cells."
        )
    values = 1e-6 * table.to_numpy()[order]
    if not np.isfinite(values).any():
        raise InputError(f"{path}: every cell of the table is empty; there is nothing to fit; check the column.")
    if np.nanmax(abs(values)) > 2e-3:
        raise InputError(f"{path}: up to {1e3 * np.nanmax(abs(values)):.3g} mm; the cells of the table must be in µm.")
    return FaceGrid(position[order], azimuth, values)
