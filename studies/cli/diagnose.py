"""`hrg diagnose`: what the simulation gets wrong, why, and what the repair is worth."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from studies.cli.arguments import Seed
from studies.cli.output import Answer, answers

if TYPE_CHECKING:
    from studies.diagnosis.planning.chamber import Chamber


@answers("hrg.diagnosis/1, with --plan hrg.plan/1, with --device hrg.fleet/1")
def diagnose(
    *runs: str,
    card: str | None = None,
    save: str | None = None,
    report: str | None = None,
    plan: list[str] | None = None,
    chamber: str | None = None,
    draws: int = 100,
    seed: Seed = 0,
    device: list[str] | None = None,
    fleet: str | None = None,
) -> Answer:
    """Name the physical effect that a campaign shows and the simulation lacks, or say that the data cannot decide.

    Give the records of one gyro (several runs are better than one), or a steady-state table.

    Parameters
    ----------
    runs : str
        Records (CSV with time_s), or one table with temperature_degC,frequency_Hz.
    card : str
        The instrument's card: its own simulation, calibrated within its uncertainties, is what the records are held against.
    save : str
        Write the extended model as a card (TOML); needs --card. It is not written, with exit status 2, where its calibration does not
        converge.
    report : str
        Write a page (HTML).
    plan : list[str]
        Chamber profiles of a planned campaign, in words or as files, one a run: predict which effects it could tell
        apart. Further profiles may follow without --plan.
    chamber : str
        What the chamber can do, such as "rate 3 range -40 85" (K/min, °C): for --plan and for the suggested next run.
    draws : int
        With --plan, four times the cases of each effect at each SNR (1, 0.3, 0.1).
    seed : int
        Of the draws.
    device : list[str]
        A device of a fleet and its records, such as A=a1.csv,a2.csv; once for each device of one design: what they share,
        and which of them is the odd one out.
    fleet : str
        The same as a file (TOML): a table [devices] with lines such as A = ["a1.csv", "a2.csv"], beside the records.
    """
    from studies.diagnosis.planning.chamber import parse_chamber
    from studies.errors import InputError
    from studies.files.columns import read_header

    limits = None if chamber is None else parse_chamber(chamber)
    if plan:
        return (yield from _plan([*plan, *runs], card, limits, draws, seed, report))
    if device or fleet is not None:
        if runs or save is not None:
            raise InputError("a fleet has its records behind --device and saves no card; leave the rest out.")
        return (yield from _fleet(device or [], fleet, card, report))
    if not runs:
        raise InputError("give the records of one gyro: hrg diagnose RUN.csv [RUN.csv ...].")
    if save is not None and card is None:
        raise InputError("--save writes an extended card, so it needs --card CARD to extend.")
    tables = [path for path in runs if "time_s" not in (names := read_header(path)) and "temperature_degC" in names]
    if not tables:
        return (yield from _campaign(runs, card, limits, save, report))
    if len(runs) > 1:
        raise InputError(f"{tables[0]}: a steady-state table is diagnosed alone; leave the other files out.")
    if save is not None:
        raise InputError(
            f"{tables[0]}: a steady-state table does not decide on a model, so --save has nothing to write."
        )
    return (yield from _table(tables[0], card, report))


def _plan(
    profiles: list[str], card: str | None, limits: "Chamber | None", draws: int, seed: int, report: str | None
) -> Answer:
    """Say what a planned campaign could tell apart."""
    from studies.cli.output import print_table
    from studies.cli.telling import Told
    from studies.diagnosis.planning.plan import plan_campaign
    from studies.reports.plan import headline, plan_page, plan_table

    told = Told("plan")
    cases = max(4, min(draws, 2000) // 4)
    outlook = plan_campaign(profiles, seed=seed, cases=cases, card=card, chamber=limits, progress=told)
    told.done()
    _write(report, lambda: plan_page(outlook, profiles))
    yield outlook.as_dict()
    print(headline(outlook))
    block = plan_table(outlook)
    print_table(block.caption, block.columns, block.rows, block.note)
    return 0


def _table(path: str, card: str | None, report: str | None) -> Answer:
    """Diagnose one steady-state table."""
    from studies.diagnosis.table import diagnose_table
    from studies.reports.diagnosis_table import table_page, table_text

    found = diagnose_table(path, card)
    _write(report, lambda: table_page(found, path))
    yield found.as_dict()
    print(table_text(found))
    return 0


def _campaign(
    runs: tuple[str, ...], card: str | None, limits: "Chamber | None", save: str | None, report: str | None
) -> Answer:
    """Diagnose the records of one gyro."""
    import numpy as np

    from shell.constants import zero_Celsius
    from studies.calibration.misreading import check_readings
    from studies.cli.output import print_table, say
    from studies.cli.telling import Told
    from studies.diagnosis.campaign import load_campaign
    from studies.diagnosis.extension import extend
    from studies.diagnosis.investigate import investigate
    from studies.instrument.card import load_card, save_card
    from studies.record import read_record
    from studies.reports import diagnosis as page

    instrument = None if card is None else load_card(card)
    reference = None if instrument is None else instrument.reference_temperature - zero_Celsius
    records = [read_record(path) for path in runs]
    campaign = load_campaign(records, reference)
    if instrument is not None:
        check_readings(instrument, records)
        instrument.material.check(np.concatenate([np.empty(0), *(run.states.housing for run in campaign.runs)]))
    told = Told("diagnosis")
    diagnosis = investigate(campaign, progress=told, chamber=limits, card=instrument)
    extended = None if save is None or instrument is None else extend(instrument, diagnosis, records, told)
    told.done()
    refused = extended is not None and not extended.fit.converged
    if refused:
        say(f"{save} is not written: the calibration of the extended card has not converged, and that is no card.")
        save = None
    if save is not None and extended is not None:
        save_card(extended.instrument, save)
        say(f"extended model: {save}")
    _write(report, lambda: page.diagnosis_page(diagnosis))
    yield {**diagnosis.verdict.as_dict(), "extended_model": save}, 2 if refused else 0
    print(page.headline(diagnosis.verdict))
    for block in (page.cause_table(diagnosis.verdict), page.response_table(diagnosis.verdict)):
        if block.rows:
            print_table(block.caption, block.columns, block.rows, block.note)
    for remark in page.remarks(diagnosis.verdict):
        print(remark)
    for note in diagnosis.verdict.notes:
        print(f"Note: {note}")
    if diagnosis.verdict.next_experiment:
        print(f"Next: {diagnosis.verdict.next_experiment}")
    return 0


def _fleet(devices: list[str], manifest: str | None, card: str | None, report: str | None) -> Answer:
    """Diagnose devices of one design together."""
    from studies.cli.output import print_table
    from studies.cli.telling import Told
    from studies.diagnosis.fleet.investigation import diagnose_fleet
    from studies.diagnosis.fleet.records import read_fleet
    from studies.instrument.card import load_card
    from studies.reports import fleet as page

    told = Told("fleet")
    design = None if card is None else load_card(card)
    whole = diagnose_fleet(read_fleet(devices, manifest), design, progress=told)
    told.done()
    _write(report, lambda: page.fleet_page(whole))
    yield whole.as_dict()
    print(page.headline(whole))
    for block in (page.share_table(whole), page.device_table(whole), page.value_table(whole)):
        if block.rows:
            print_table(block.caption, block.columns, block.rows, block.note)
    return 0


def _write(report: str | None, page: Callable[[], str]) -> None:
    if report is not None:
        from studies.cli.output import say
        from studies.files.writing import write_text

        write_text(report, page())
        say(f"report: {report}")
