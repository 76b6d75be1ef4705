"""`hrg diagnose`: what the simulation gets wrong, why, and what the repair is worth."""

from pathlib import Path
from typing import TYPE_CHECKING

from studies.cli.arguments import Seed
from studies.cli.output import answers
from studies.results import Result

if TYPE_CHECKING:
    from studies.diagnosis.planning.chamber import Chamber


@answers("hrg.diagnosis/1, with --plan hrg.plan/1, with --device hrg.fleet/1")
def diagnose(
    *runs: str,
    card: str | None = None,
    save: str | None = None,
    plan: list[str] | None = None,
    chamber: str | None = None,
    draws: int = 100,
    seed: Seed = 0,
    device: list[str] | None = None,
    fleet: str | None = None,
) -> Result:
    """Name the physical effect that the simulation lacks, or say that the data cannot identify it.

    Give the records of one gyro (several runs are better than one), or a steady-state table.

    Parameters
    ----------
    runs : str
        Records (CSV with time_s), or one table with temperature_degC,frequency_Hz.
    card : str
        The gyro's card. The records are compared with its simulation, calibrated within the card's uncertainties.
    save : str
        Save the extended model as a card (TOML); needs --card. Not saved, with exit status 2, if its calibration does not converge.
    plan : list[str]
        Chamber profiles of a planned campaign, as text or as files, one for each run: predict which effects the campaign can
        identify. Further profiles may follow without --plan.
    chamber : str
        Limits of the chamber, such as "rate 3 range -40 85" (K/min, °C), for --plan and for the suggested next run.
    draws : int
        With --plan: random draws, 4 to 2000; each effect is tried in a quarter as many cases at each SNR (1, 0.3, 0.1).
    seed : int
        Seed of the draws.
    device : list[str]
        A device of a fleet and its records, such as A=a1.csv,a2.csv; repeat it for each device of the same design. Shows what the
        devices have in common and which one differs.
    fleet : str
        The same as a file (TOML): a table [devices] with lines such as A = ["a1.csv", "a2.csv"], beside the records.
    """
    from studies.diagnosis.planning.chamber import parse_chamber
    from studies.errors import InputError
    from studies.files.columns import read_header

    limits = None if chamber is None else parse_chamber(chamber)
    if plan:
        return _plan([*plan, *runs], card, limits, draws, seed)
    if device or fleet is not None:
        if runs or save is not None:
            raise InputError("with --device or --fleet, give no other records and no --save.")
        return _fleet(device or [], fleet, card)
    if not runs:
        raise InputError("no records given: hrg diagnose RUN.csv [RUN.csv ...].")
    if save is not None and card is None:
        raise InputError("--save writes an extended card, so it needs --card CARD to extend.")
    tables = [path for path in runs if "time_s" not in (names := read_header(path)) and "temperature_degC" in names]
    if not tables:
        return _campaign(runs, card, limits, save)
    if len(runs) > 1:
        raise InputError(f"{tables[0]}: a steady-state table must be diagnosed alone; leave out the other files.")
    if save is not None:
        raise InputError(f"{tables[0]}: a steady-state table cannot determine an extended model; leave out --save.")
    return _table(tables[0], card)


def _plan(profiles: list[str], card: str | None, limits: "Chamber | None", draws: int, seed: int) -> Result:
    """Predict which effects a planned campaign can identify."""
    from studies.cli.telling import Told
    from studies.diagnosis.planning.plan import plan_campaign
    from studies.reports import plan as parts

    told = Told("plan")
    cases = max(4, min(draws, 2000) // 4)
    outlook = plan_campaign(profiles, seed=seed, cases=cases, card=card, chamber=limits, progress=told)
    told.done()
    title = "Planned campaign"
    return Result(outlook.as_dict(), title, parts.headline(outlook), parts.plan_parts(outlook, profiles))


def _table(path: str, card: str | None) -> Result:
    """Diagnose one steady-state table."""
    from studies.diagnosis.table import diagnose_table
    from studies.reports import diagnosis_table as parts
    from studies.reports.diagnosis import headline

    found = diagnose_table(path, card)
    title = f"Diagnosis of {Path(path).name}"
    return Result(found.as_dict(), title, headline(found.verdict), parts.table_parts(found))


def _campaign(runs: tuple[str, ...], card: str | None, limits: "Chamber | None", save: str | None) -> Result:
    """Diagnose the records of one gyro."""
    import numpy as np

    from shell.constants import zero_Celsius
    from studies.calibration.misreading import check_readings
    from studies.cli.output import say
    from studies.cli.telling import Told
    from studies.diagnosis.campaign import load_campaign
    from studies.diagnosis.extension import extend
    from studies.diagnosis.investigate import investigate
    from studies.instrument.card import load_card, save_card
    from studies.record import read_record
    from studies.reports import diagnosis as parts

    instrument = None if card is None else load_card(card)
    reference = None if instrument is None else instrument.reference_temperature - zero_Celsius
    records = [read_record(path) for path in runs]
    campaign = load_campaign(records, reference)
    if instrument is not None:
        check_readings(instrument, records)
        instrument.material.check(np.concatenate([np.empty(0), *(run.states.housing for run in campaign.runs)]))
    told = Told("diagnosis")
    found = investigate(campaign, progress=told, chamber=limits, card=instrument)
    extended = None if save is None or instrument is None else extend(instrument, found, records, told)
    told.done()
    refused = extended is not None and not extended.fit.converged
    if refused:
        say(f"{save} not saved: the calibration of the extended card did not converge.")
        save = None
    if save is not None and extended is not None:
        save_card(extended.instrument, save)
        say(f"extended model: {save}")
    payload = {**found.verdict.as_dict(), "extended_model": save}
    lead = parts.headline(found.verdict)
    return Result(payload, "Diagnosis of a campaign", lead, parts.diagnosis_parts(found), 2 if refused else 0)


def _fleet(devices: list[str], manifest: str | None, card: str | None) -> Result:
    """Diagnose devices of one design together."""
    from studies.cli.telling import Told
    from studies.diagnosis.fleet.investigation import diagnose_fleet
    from studies.diagnosis.fleet.records import read_fleet
    from studies.instrument.card import load_card
    from studies.reports import fleet as parts

    told = Told("fleet")
    design = None if card is None else load_card(card)
    whole = diagnose_fleet(read_fleet(devices, manifest), design, progress=told)
    told.done()
    return Result(whole.as_dict(), "Diagnosis of a fleet", parts.headline(whole), parts.fleet_parts(whole))
