"""`hrg fleet`: a folder a device, all calibrated and diagnosed, with the lot as prior."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from studies.cli.arguments import COUNT, Quiet
from studies.cli.output import answers, dump_json, resumable, say
from studies.errors import InputError
from studies.files.writing import write_text
from studies.fleet.folder import read_lot
from studies.instrument.card import load_card
from studies.progress import Progress
from studies.reports import fleet as parts
from studies.results import Result


@answers("hrg.fleet/2", page=False)
def fleet(
    folder: str,
    *,
    out: str,
    card: str | None = None,
    workers: Annotated[int, COUNT] = 1,
    scheduler: str | None = None,
    quiet: Quiet = False,
) -> Result:
    """Calibrate and diagnose all devices of a lot: common causes, odd devices and batches, control charts.

    Run it again to resume, or after adding devices: only new or changed devices are computed.

    Args:
        folder: Folder of the lot: a folder for each device, named by its serial number, with its records (CSV) and
            perhaps its card (TOML). A file lot.csv has the columns serial, date, batch.
        out: Folder for the results: lot.html, lot.json, and a page and a result for each device in devices/.
        card: The card of the design. Without it each device gets a polynomial card from its records.
        workers: Devices processed at the same time, some 500 MB each.
        scheduler: Address of a Dask scheduler (tcp://HOST:8786), as for hrg study run, instead of processes here; every
            worker must see both folders under the same paths.
    """
    from studies.fleet.run import run_lot
    from studies.results.page import render_result
    from studies.sweeps.engine import hire

    if Path(out).resolve().is_relative_to(Path(folder).resolve()):
        raise InputError(f"--out {out}: give a folder outside {folder}, where every folder is a device.")
    if card is not None:
        load_card(card)
    if scheduler is not None:  # its workers have other working directories
        folder, out = str(Path(folder).resolve()), str(Path(out).resolve())
    devices = read_lot(folder, card)
    with resumable(out, "devices"), Progress(len(devices), shown=not quiet) as progress:
        lot = run_lot(devices, out, hire(workers, scheduler), progress)
    for why in lot.failed.values():
        say(f"hrg: {why}")
    chapters = parts.fleet_parts(lot, lambda serial: f"devices/{serial}.html")
    result = Result(lot.as_dict(), f"Gyros of {Path(folder).resolve().name}", parts.headline(lot), chapters)
    write_text(Path(out) / "lot.json", dump_json(result.payload))
    write_text(Path(out) / "lot.html", render_result(result))
    say(f"report: {Path(out) / 'lot.html'}")
    return replace(result, status=4 if lot.failed else 0)
