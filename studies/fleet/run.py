"""Devices of a lot on any workers: an answer is a file written whole, and a run again works out only what is missing or has changed."""

import json
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from pathlib import Path

from compensation.errors import CompensationError
from shell.errors import ShellError
from studies.errors import InputError
from studies.files.writing import write_text
from studies.fleet.device import SCHEMA, Answer, diagnose_device
from studies.fleet.folder import Device
from studies.fleet.lot import Lot, gather
from studies.progress import Progress
from studies.sweeps.engine import LOOK_EVERY, MOST_TASKS
from studies.sweeps.workers import Here, Workers, say_gone
from thermal.errors import ThermalError

FOLDER = "devices"
Done = tuple[Device, Answer | str]


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
        for device, answer in _all(devices, out, crew):
            if isinstance(answer, Answer):
                answers[device.serial] = answer
            else:
                failed[device.serial] = answer
            progress.advance(1, not isinstance(answer, Answer))
    finally:
        crew.close()
    if not answers:
        raise InputError(f"none of {len(devices)} devices could be diagnosed; {next(iter(failed.values()))}")
    order = [one for one in devices if one.serial in answers]
    return gather(devices, {one.serial: answers[one.serial] for one in order}, failed)


def _all(devices: Sequence[Device], out: str | None, crew: Workers) -> Iterator[Done]:
    """Yield the answers of all devices as they come, or why there is none; what a lost worker had is tried again, alone."""
    queue, running, alone = deque(devices), dict[Future[Answer | str], Device](), set[str]()
    while queue or running:
        while queue and len(running) < (1 if alone else MOST_TASKS * crew.count):
            device = queue.popleft()
            running[crew.submit(_answer, device, out)] = device
        finished = wait(running, LOOK_EVERY, FIRST_COMPLETED).done
        if not finished:
            crew.check()
        for future in finished:
            if (one := running.pop(future, None)) is None:
                continue
            try:
                yield one, future.result()
                alone.discard(one.serial)
            except crew.lost:
                again = [*running.values()] if crew.restart() else []
                if again:
                    running.clear()
                if one.serial in alone:
                    yield one, f"device {one.serial}: its process was ended each time (killed, or out of memory)."
                    alone.discard(one.serial)
                else:
                    again.append(one)
                alone |= {device.serial for device in again}
                queue.extendleft(again)
            except crew.gone as error:
                raise say_gone(error) from error


def _answer(device: Device, out: str | None) -> Answer | str:
    """Return the answer of a device, kept or new; a sentence where its files cannot be used."""
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
