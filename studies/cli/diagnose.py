"""`hrg diagnose`: what the simulation gets wrong, why, and what the repair is worth."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from studies import workbench
from studies.cli.output import answers, keep_card, say
from studies.errors import InputError
from studies.instrument.card import load_card
from studies.planning.chamber import Chamber, parse_chamber
from studies.progress import Told
from studies.record import OUTPUTS, is_table, read_record
from studies.reports.diagnosis import diagnosis_parts, headline
from studies.results import Result
from studies.simulation.chamber import columns_of

PLANNED = "hrg-30mm"  # card of a plan without --card
STAGES = {
    "step 1:": 0.05, "all effects in all shapes": 0.2, "what could stand in the place of": 0.6,
    "held-out rows": 0.93, "lack of fit": 0.96, "calibrating the extended card": 0.97,
}  # fmt: skip


@answers("hrg.diagnosis/1, with --plan hrg.plan/2")
def diagnose(
    *runs: str,
    card: str | None = None,
    save: str | None = None,
    plan: list[str] | None = None,
    next_: Annotated[bool, Parameter(name="--next")] = False,
    chamber: str | None = None,
) -> Result:
    """Name the physical effect that the simulation lacks, or say that the data cannot identify it.

    Give the records of one gyro (several runs are better than one), or a steady-state table.

    Args:
        runs: Records (CSV with time_s), or one table with temperature_degC,frequency_Hz.
        card: The gyro's card. The records are compared with its simulation, calibrated within the card's uncertainties.
        save: Save the extended model as a card (TOML): the card with the causes found. Without --card it is a card with a
            polynomial law ([law]); the records are diagnosed again with it, and causes may differ from those without
            --save. Not saved, with exit status 2, if its calibration does not converge.
        plan: Chamber profiles of a planned campaign, text or files, one a run: predict which effects it can identify
            with the gyro of --card, and how small they may be. Further profiles may follow without --plan.
        next_: Propose the next run: the profile that best separates the remaining candidates, or else narrows the
            intervals of the causes found, per hour of chamber time.
        chamber: Limits of the chamber, such as "rate 3 range -40 85" (K/min, °C), for --plan and for the next run.
    """
    limits = None if chamber is None else parse_chamber(chamber)
    if plan:
        return _plan([*plan, *runs], card, limits)
    if not runs:
        raise InputError("no records given: hrg diagnose RUN.csv [RUN.csv ...].")
    tables = [path for path in runs if is_table(path)]
    if not tables:
        return _campaign(runs, card, (limits or Chamber()) if next_ or limits else None, save)
    if len(runs) > 1:
        raise InputError(f"{tables[0]}: a steady-state table must be diagnosed alone; leave out the other files.")
    if save is not None:
        raise InputError(f"{tables[0]}: a steady-state table cannot determine an extended model; leave out --save.")
    return _table(tables[0], card)


def _plan(profiles: list[str], card: str | None, limits: Chamber | None) -> Result:
    from studies.planning.plan import plan_campaign
    from studies.reports import plan as parts

    for path in profiles:
        header = columns_of(path)
        if set(OUTPUTS) & set(header):
            what = "record of a run" if "time_s" in header else "steady-state table"
            raise InputError(f"{path}: this is a {what}; --plan takes profiles of runs to come. Leave out --plan to diagnose it; of records, --next then proposes a run.")  # fmt: skip
    if card is None:
        say(f"no --card given: planning with the card {PLANNED}.")
    with Told("plan", {"all effects in all shapes": 0.3, "what would be answered": 0.7}) as told:
        plan = plan_campaign(load_card(card or PLANNED), profiles, limits, told)
    return Result(plan.as_dict(), "Planned campaign", parts.headline(plan), parts.plan_parts(plan, profiles))


def _table(path: str, card: str | None) -> Result:
    from studies.diagnosis.table import diagnose_table
    from studies.reports.diagnosis_table import table_parts

    found = diagnose_table(path, card)
    return Result(found.as_dict(), f"Diagnosis of {Path(path).name}", headline(found.verdict), table_parts(found))


def _campaign(runs: tuple[str, ...], card: str | None, limits: Chamber | None, save: str | None) -> Result:
    from studies.inference.diagnosis import Inference
    from studies.inference.extension import extend

    instrument, records = None if card is None else load_card(card), [read_record(run) for run in runs]
    with Told("diagnosis", STAGES) as told:
        found = workbench.diagnose_records(records, instrument, limits, told)
        extended = extend(found, told) if save is not None and isinstance(found, Inference) else None
    saved = save
    if extended is not None:
        against = "" if extended.fit.converged else "the calibration of the extended card did not converge"
        saved = keep_card(extended.instrument, save, against, "extended model")
    payload = {**found.verdict.as_dict(), "extended_model": saved}
    parts = diagnosis_parts(found)
    return Result(payload, "Diagnosis of a campaign", headline(found.verdict), parts, 2 * (saved != save))
