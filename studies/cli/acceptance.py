"""`hrg acceptance`: the tests of IEEE Std 1431 in its order, as far as records go, against limits.

With --json one object, schema `hrg.acceptance/1`: `card`, `verdict` ("pass", "fail", "incomplete": a limit undecided or
without a record), `confidence`, `quantities` (list in the order of the standard: `key`, `section`, `unit`, `value`, `low`,
`high`, `limit`, `bound` ("most" or "least"), `verdict`, `records`, `needs` where it is missing), `elsewhere` (tests that ask
for more than records), `records` (path: the test that it served), `warm_up_band_deg_per_h`, `report`.
"""

from typing import TYPE_CHECKING, Any

from studies.cli.output import Answer, answers

if TYPE_CHECKING:
    from studies.acceptance.judgement import Acceptance


@answers("hrg.acceptance/1")
def acceptance(
    card: str,
    *runs: str,
    limits: str | None = None,
    output: str = "bias_deg_per_h",
    report: str | None = None,
) -> Answer:
    """Judge a gyro by its records: warm-up, temperature, scale factor, drift with Allan deviation, run-down, transfer function.

    Each record serves the test that it shows: at rest over temperature, at rest for an hour, several applied rates, a swept rate,
    a free decay of vibration_amplitude_V. A line '# test: warm-up' (or temperature, scale-factor, drift, run-down, transfer,
    angle-storage) above its header decides otherwise; warm-up and angle storage are taken only from records so marked. Every value has a 95 % interval; a limit is met, or
    not met, if the whole interval is.

    Parameters
    ----------
    card : str
        Path of a card, or the name of one that ships: the gyro that the records are of.
    runs : str
        The records (CSV).
    limits : str
        Limits (TOML, schema hrg.limits/1): a table [limits] with the names of the quantities.
    output : str
        Column that is judged as zero-rate output, such as compensated_bias_deg_per_h.
    report : str
        Write a page (HTML).
    """
    from studies.acceptance.judgement import judge
    from studies.acceptance.limits import Limits, read_limits
    from studies.cli.output import print_table, say
    from studies.errors import InputError
    from studies.files.writing import write_text
    from studies.instrument.card import load_card
    from studies.record import read_record

    instrument = load_card(card)
    if not runs:
        raise InputError("name at least one record (CSV) of the gyro.")
    records = [read_record(path) for path in runs]
    for record in records:
        if record.instrument and record.instrument != instrument.name:
            say(f"warning: {record.path} is of '{record.instrument}', the card of '{instrument.name}'.")
    allowed = read_limits(limits) if limits is not None else Limits()
    found = judge(records, allowed, output)
    for line in found.lines:
        if line.limit is not None and line.measured is None:
            say(f"warning: {allowed.path} limits {line.quantity.key}, which no record gives: {line.quantity.needs}.")
    for path, use in found.used.items():
        if use.startswith("no test"):
            say(f"warning: {path} serves {use}.")
    if report is not None:
        from studies.reports.acceptance import acceptance_page

        write_text(report, acceptance_page(found, instrument.name, records, output))
        say(f"report: {report}")
    yield _payload(found, instrument.name, report)
    from studies.reports.acceptance import quantities_table

    table = quantities_table(found)
    print_table(table.caption, table.columns, table.rows, table.note)
    print(f"verdict: {found.verdict}")
    missing: dict[str, list[str]] = {}
    for line in found.lines:
        if line.measured is None:
            missing.setdefault(line.quantity.needs, []).append(line.quantity.words)
    for needs, words in missing.items():
        print(f"missing: {'; '.join(words)}: {needs}.")


def _payload(found: "Acceptance", name: str, report: str | None) -> dict[str, Any]:
    from studies.acceptance.measure import CONFIDENCE

    quantities = []
    for line in found.lines:
        q, m = line.quantity, line.measured
        entry = {
            "key": q.key,
            "section": q.section,
            "unit": q.unit,
            "value": m.value if m else None,
            "low": m.low if m else None,
            "high": m.high if m else None,
            "limit": line.limit,
            "bound": "most" if q.upper else "least",
            "verdict": line.verdict,
            "records": list(m.sources) if m else [],
            "needs": None if m else q.needs,
        }
        quantities.append(entry)
    return {
        "schema": "hrg.acceptance/1",
        "card": name,
        "verdict": found.verdict,
        "confidence": CONFIDENCE,
        "quantities": quantities,
        "elsewhere": [{"section": s, "test": test, "needs": needs} for s, test, needs in found.elsewhere],
        "records": found.used,
        "warm_up_band_deg_per_h": found.band,
        "report": report,
    }
