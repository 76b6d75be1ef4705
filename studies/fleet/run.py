"""Devices of a lot on any workers: an answer is a file written whole, and a run again works out only what is missing or has changed."""

import json
from collections import deque
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from compensation.errors import CompensationError
from shell.errors import ShellError
from studies.errors import InputError
from studies.files.writing import write_text
from studies.fleet.device import SCHEMA, Answer, diagnose_device
from studies.fleet.folder import Device
from studies.fleet.lot import Lot, gather
from studies.progress import Progress
from studies.sweeps.workers import Here, Workers, run_tasks
from thermal.errors import ThermalError

FOLDER = "devices"
KILLED = "its process was ended each time (killed, or out of memory)."


def run_lot(
    devices: Sequence[Device], out: str | None = None, crew: Workers | None = None, progress: Progress | None = None
) -> Lot:
    """Diagnose the devices of a lot on some workers and compare them; `out` keeps the answer and the page of each."""
    if len(devices) < 2:
        raise InputError("a fleet needs at least two devices: a folder with the records of each.")
    if out is not None:
        (Path(out) / FOLDER).mkdir(parents=True, exist_ok=True)
    answers: dict[str, Answer] = {}
    failed: dict[str, str] = {}
    crew, progress = crew or Here(), progress or Progress()
    try:
        queue = deque(devices)
        for (device,), answer in run_tasks(
            crew, lambda: [queue.popleft()] if queue else [], partial(_answer, out), tries=1
        ):
            if isinstance(answer, Answer):
                answers[device.serial] = answer
            else:
                failed[device.serial] = answer or f"device {device.serial}: {KILLED}"
            progress.advance(1, not isinstance(answer, Answer))
    finally:
        crew.close()
    if not answers:
        raise InputError(f"none of {len(devices)} devices could be diagnosed; {next(iter(failed.values()))}")
    order = [one for one in devices if one.serial in answers]
    return gather(devices, {one.serial: answers[one.serial] for one in order}, failed)


def _answer(out: str | None, devices: Sequence[Device]) -> Answer | str:
    """Return the answer of one device, kept or new; a sentence where its files cannot be used."""
    (device,) = devices
    try:
        key = device.key
        if (kept := _kept(device, key, out)) is not None:
            return kept
        answer, found = diagnose_device(device, key)
        if out is not None:
            from studies.reports.diagnosis import diagnosis_parts, headline
            from studies.results import Result
            from studies.results.page import render_result

            parts = diagnosis_parts(found)
            page = Result({}, f"Device {device.serial}", headline(found.verdict), parts)
            write_text(page_of(out, device.serial), render_result(page))
            write_text(_path(out, device.serial), json.dumps(answer.as_dict(), indent=1) + "\n")
    except (InputError, ThermalError, ShellError, CompensationError, OSError) as error:
        return str(error)
    return answer


def _path(out: str, serial: str) -> Path:
    return Path(out) / FOLDER / f"{serial}.json"


def page_of(out: str, serial: str) -> Path:
    """Return the page of a device."""
    return Path(out) / FOLDER / f"{serial}.html"


def _kept(device: Device, key: str, out: str | None) -> Answer | None:
    """Return the answer of an earlier run to the same files."""
    if out is None or not (path := _path(out, device.serial)).is_file() or not page_of(out, device.serial).is_file():
        return None
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        return Answer.read(found) if found["schema"] == SCHEMA and found["key"] == key else None
    except (ValueError, KeyError, TypeError):
        return None
