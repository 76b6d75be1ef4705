"""Devices of a lot in parallel: an answer is a file written whole, and a run again works out only what is missing or has changed."""

import json
import multiprocessing
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from pathlib import Path

from compensation.errors import CompensationError
from shell.errors import ShellError
from studies.errors import InputError
from studies.files.writing import write_text
from studies.fleet.device import SCHEMA, Answer, diagnose_device
from studies.fleet.folder import Device
from studies.fleet.lot import Lot, gather
from thermal.errors import ThermalError

FOLDER = "devices"
Progress = Callable[[str], None]
Done = tuple[Device, Answer | str]


def run_lot(
    devices: Sequence[Device], out: str | None = None, workers: int = 1, progress: Progress = lambda words: None
) -> Lot:
    """Diagnose the devices of a lot, in so many processes, and compare them; `out` keeps the answer and the page of each."""
    if len(devices) < 2:
        raise InputError("a fleet needs at least two devices, such as --device A=a1.csv,a2.csv --device B=b1.csv.")
    if out is not None:
        (Path(out) / FOLDER).mkdir(parents=True, exist_ok=True)
    answers: dict[str, Answer] = {}
    failed: dict[str, str] = {}
    begin = time.monotonic()
    for count, (device, answer) in enumerate(_all(devices, out, workers, progress), 1):
        if isinstance(answer, Answer):
            answers[device.serial] = answer
        else:
            failed[device.serial] = answer
        left = (time.monotonic() - begin) / count * (len(devices) - count) / 60.0
        progress(f"{count} of {len(devices)} devices ({100 * count // len(devices)} %), about {left:.0f} min left")
    if not answers:
        raise InputError(f"none of {len(devices)} devices could be diagnosed; {next(iter(failed.values()))}")
    progress("the lot")
    order = [one for one in devices if one.serial in answers]
    return gather(devices, {one.serial: answers[one.serial] for one in order}, failed)


def _all(devices: Sequence[Device], out: str | None, workers: int, progress: Progress) -> Iterator[Done]:
    """Yield the answers of all devices as they come, or why there is none."""
    if workers < 2:
        for device in devices:
            yield device, _answer(device, out, progress)
        return
    executor = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))
    waiting: set[Future[Answer | str]] = set()
    try:
        work = {executor.submit(_answer, device, out): device for device in devices}
        waiting = set(work)
        while waiting:
            done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for one in done:
                yield work[one], one.result()
    finally:
        executor.shutdown(wait=not waiting, cancel_futures=True)


def _answer(device: Device, out: str | None, progress: Progress = lambda words: None) -> Answer | str:
    """Return the answer of a device, kept or new; a sentence where its files cannot be used."""
    try:
        key = device.key
        if (kept := _kept(device, key, out)) is not None:
            return kept
        answer, found = diagnose_device(device, key, lambda words: progress(f"{device.serial}: {words}"))
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
