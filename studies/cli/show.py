"""`hrg show`: records looked at without a card and without a fit."""

from pathlib import Path

from studies.cli.arguments import Records
from studies.cli.output import answers
from studies.instrument.display import display_name
from studies.record import read_record
from studies.record.survey import Survey, survey_record
from studies.record.uses import find_uses
from studies.reports import survey as parts
from studies.reports.digits import plain
from studies.results import Fact, Facts, Result, Sentence, Table, row_of

FAULTS = {"spikes": "spikes", "stuck readings": "stuck", "dropouts to 0": "zeros"}


@answers("hrg.show/1")
def show(*runs: Records) -> Result:
    """Look at records: range and faults of every column, steps, settled parts, spectra, noise, and what they can be used for.

    Needs no card and fits no model of the gyro. The page has every column over time and over temperature, spectra and Allan
    deviations; its figures show values under the pointer and can be enlarged.
    """
    records = [read_record(path) for path in runs]
    surveys = [survey_record(record) for record in records]
    told = [parts.tell(survey) for survey in surveys]
    uses, pairs = find_uses(records), list(zip(surveys, told, strict=True))
    payload = {
        "records": told,
        "uses": [row_of(use, "command", "line", "missing") | {"ready": not use.missing} for use in uses],
    }
    lead = f"{', '.join(runs)} as recorded, without fitting or editing."
    return Result(
        payload,
        _title([Path(run).name for run in runs]),
        lead,
        [
            *(part for survey, one in pairs for part in (Facts(_facts(survey)),
                Table(f"Columns of {one['path']}", one["columns"], parts.COLUMNS, parts.COLUMNS_NOTE))),
            *_warnings(surveys),
            *parts.use_parts(uses),
            *(chapter for survey, one in pairs for chapter in parts.run_chapters(survey, one, several=len(runs) > 1)),
        ],
    )  # fmt: skip


def _title(names: list[str]) -> str:
    more = f" and {len(names) - 3} more" if len(names) > 4 else ""
    return f"Record{'s' * (len(names) > 1)} {', '.join(names[: 3 if more else 4])}{more}"


def _facts(survey: Survey) -> list[Fact]:
    record, time = survey.record, survey.record["time_s"]
    even = "regular" if survey.even else "irregular or with gaps"
    about = " ".join(filter(None, (record.instrument, record.start.isoformat() if record.start else "")))
    return [
        (record.path, f"{len(record):,} rows", about),
        ("Duration", f"{plain((time[-1] - time[0]) / 3600, 4)} h", ""),
        ("Sample interval", f"{plain(survey.step, 4)} s", even),
    ]


def _warnings(surveys: list[Survey]) -> list[Sentence]:
    found = [
        f"{survey.record.path}, {display_name(column.name)}: {words}: {count}"
        for survey in surveys
        for column in survey.columns
        for words, fault in FAULTS.items()
        if (count := getattr(column, fault))
    ]
    mend = "They are still in the record; 'drop' in the map of hrg import turns them into missing values."
    return [Sentence(f"{'; '.join(found)}. {mend}", "warning")] if found else []
