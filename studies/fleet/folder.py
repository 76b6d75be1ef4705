"""Devices of a lot: a folder each with its records; `lot.csv` says serial, date and batch."""

import csv
import hashlib
from collections.abc import Collection
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from studies.errors import InputError, nearest
from studies.files.columns import read_header

LOT, LOT_COLUMNS = "lot.csv", ("serial", "date", "batch")


@dataclass(frozen=True)
class Device:
    """One device: paths of its records and of its own card, when and in which batch it was made."""

    serial: str
    records: tuple[str, ...]
    card: str | None = None
    made: date | None = None
    batch: str = ""

    @property
    def key(self) -> str:
        """What its answer depends on: names and contents of its files."""
        digest = hashlib.sha256()
        for path in (*self.records, *([self.card] if self.card and Path(self.card).is_file() else [self.card or ""])):
            digest.update(Path(path).name.encode())
            if Path(path).is_file():
                digest.update(Path(path).read_bytes())
        return digest.hexdigest()


def read_lot(folder: str, card: str | None = None) -> list[Device]:
    """Return the devices of a folder, a subfolder each, in the order of their serials; a card in a subfolder counts before the common one."""
    root = Path(folder)
    if not root.is_dir():
        wrong = "is a file; give the folder of the lot." if root.exists() else "there is no such folder."
        raise InputError(f"{folder}: {wrong}")
    inside = sorted(path for path in root.iterdir() if path.is_dir() and not path.name.startswith("."))
    if not inside:
        raise InputError(f"{folder}: no folders of devices, each named by its serial number, with its records.")
    said = _read_table(root / LOT, {path.name for path in inside}) if (root / LOT).is_file() else {}
    out = []
    for path in inside:
        records = tuple(str(one) for one in sorted(path.glob("*.csv")))
        cards = sorted(path.glob("*.toml"))
        if len(cards) > 1:
            raise InputError(f"{path}: {len(cards)} TOML files; keep one card for the device.")
        made, batch = said.get(path.name, (None, ""))
        out.append(Device(path.name, records, str(cards[0]) if cards else card, made, batch))
    return out


def _read_table(path: Path, serials: Collection[str]) -> dict[str, tuple[date | None, str]]:
    header = read_header(str(path))
    for name in header:
        if name not in LOT_COLUMNS:
            raise InputError(f"{path}: unknown column '{name}'{nearest(name, LOT_COLUMNS)}")
    if "serial" not in header:
        raise InputError(f"{path}: the column serial is missing; it names the folder of each device.")
    found: dict[str, tuple[date | None, str]] = {}
    with path.open(newline="", encoding="utf-8-sig") as file:
        for line, row in enumerate(csv.DictReader(file), 2):
            serial = (row["serial"] or "").strip()
            if serial not in serials:
                raise InputError(f"{path}, line {line}: no folder of device '{serial}'{nearest(serial, serials)}")
            try:
                made = date.fromisoformat(row["date"].strip()) if (row.get("date") or "").strip() else None
            except ValueError:
                raise InputError(f"{path}, line {line}: date '{row['date']}' is not of the form 2024-05-31.") from None
            if serial in found:
                raise InputError(f"{path}, line {line}: device '{serial}' is listed twice.")
            found[serial] = made, (row.get("batch") or "").strip()
    return found
