"""`hrg compensate`: apply a saved model to a record, or turn it into C for firmware."""

from functools import partial
from typing import TYPE_CHECKING

from studies.cli.output import answers
from studies.results import Figure, Result, Sentence

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.figure import Figure as Drawing
    from numpy.typing import NDArray

    from studies.record import Record

AVERAGE = 100.0  # s
NOISE = 0.02  # relative: what the noise of a model's inputs may add to a record that has nothing to compensate


@answers("hrg.compensate/1")
def compensate(
    model: str,
    run: str | None = None,
    /,
    *,
    out: str | None = None,
    extrapolate: bool = False,
    emit: str | None = None,
) -> Result:
    """Write a record again with compensated_… columns, from a model that one of the hrg fit commands saved.

    The model refuses values that its fit has not seen. A frequency model takes the housing's temperature, without it the
    resonator's or the chamber's; of a record without any thermometer the frequency is its own, and the resonator's
    temperature is added instead, as hrg temperature does.

    Parameters
    ----------
    model : str
        A model file (TOML) written with --save.
    run : str
        The record (CSV) to compensate.
    out : str
        Where the record with the added columns goes.
    extrapolate : bool
        Apply the model outside the range of its fit too; of a record without a thermometer, leave the rows empty there.
    emit : str
        Write the model as C99 source for firmware.
    """
    import numpy as np

    from studies import models
    from studies.cli.output import say
    from studies.errors import InputError
    from studies.files.writing import write_text
    from studies.instrument.units import unit_of
    from studies.record import COMPENSATED, RESONATOR, read_record, write_record

    loaded = models.read_model(model)
    if (run is None) != (out is None):
        raise InputError(
            "a record needs --out for the result, and --out needs a record: hrg compensate MODEL RUN --out FILE."
        )
    if run is None and emit is None:
        raise InputError("nothing to do: give a record and --out FILE, or --emit FILE.c.")
    if emit is not None:
        write_text(emit, models.emit_c(loaded))
        say(f"C source: {emit}")
    columns: dict[str, dict[str, float | None]] = {}
    added: list[str] = []
    if run is not None and out is not None:
        say(f"reading {run}")
        record = read_record(run)
        result = models.compensate(loaded, record, extrapolate=extrapolate)
        write_record(
            result, out, lambda rows: say(f"written {rows:,} of {len(result):,} rows") if rows % 500_000 == 0 else None
        )
        added = [name for name in result.columns if name not in record]
        for name in result.columns:
            if name.startswith(COMPENSATED) and name not in record:
                original, after = name.removeprefix(COMPENSATED), result[name]
                # A rate made from raw counts has no uncompensated column of its own in the record.
                before = record.columns.get(original)
                missing = np.isnan(after) if before is None else np.isnan(after) & ~np.isnan(before)
                columns[name] = {
                    "stability_before": None if before is None else _stability(record["time_s"], before),
                    "stability_after": _stability(record["time_s"], after),
                    "rows_not_compensated": int(np.count_nonzero(missing)),
                }
    said: list[Sentence] = []
    if RESONATOR in added:
        said.append(Sentence(
            f"{out}: {RESONATOR}, by the frequency: {run} has no other thermometer, and a frequency that is compensated by"
            " itself is the same in every row. hrg fit bias --over temperature compensates the other outputs over it."
        ))  # fmt: skip
        if empty := int(np.count_nonzero(np.isnan(result[RESONATOR]))):
            stay = "row stays" if empty == 1 else "rows stay"
            said.append(Sentence(f"{empty} {stay} empty: no frequency, or one outside the range of the model."))
    for name, facts in columns.items():
        was, now, lost = (facts[key] for key in ("stability_before", "stability_after", "rows_not_compensated"))
        if was is not None and now is not None and now > was * (1 + NOISE):
            words = (
                f"{name} is worse than the record: standard deviation of {AVERAGE:g} s averages {was:.4g} → {now:.4g}."
            )
            words += " Is the model of this gyro, with this sign of the output? Do not use it otherwise."
            say(f"warning: {words}")
            said.append(Sentence(words, "warning", "page"))
        earlier = "" if was is None else f"{was:.4g} → "
        unit = "" if unit_of(name) == "1" else f" {unit_of(name)}"
        later = "too few rows for it" if now is None else f"{now:.4g}{unit}"
        said.append(Sentence(f"{out}: {name}; standard deviation of {AVERAGE:g} s averages: {earlier}{later}"))
        if lost:
            words = "an input is missing there, or too few samples for its rate lie before them"
            said.append(Sentence(f"{lost:g} rows stay empty: {words}."))
    payload = {
        "schema": "hrg.compensate/1",
        "model": model,
        "kind": loaded.kind,
        "run": run,
        "out": out,
        "added": added,
        "columns": columns,
    }
    pictures = [Figure(partial(_compare, record, result, name), f"{name} beside the record.") for name in columns]
    title, lead = f"Compensation of {run or model}", f"Model of kind {loaded.kind}: {model}."
    return Result(payload, title, lead, [*said, *pictures])


def _compare(record: "Record", result: "Record", name: str) -> "Drawing":
    from studies.record import COMPENSATED
    from studies.reports import style

    rows = style.few_rows(len(result))
    with style.figure() as (made, axis):
        original = name.removeprefix(COMPENSATED)
        if original in record:
            axis.plot(
                result["time_s"][rows] / 3600, record[original][rows], color=style.ORANGE, linewidth=0.8, label="record"
            )
        axis.plot(
            result["time_s"][rows] / 3600, result[name][rows], color=style.BLUE, linewidth=0.8, label="compensated"
        )
        axis.set_xlabel("time (h)")
        axis.set_ylabel(original)
        axis.legend()
        return made


def _stability(time: "NDArray[np.float64]", values: "NDArray[np.float64]") -> float | None:
    """Return the standard deviation of block averages, missing values left out; None of too few rows."""
    from compensation.decimation import average_blocks
    from compensation.errors import CompensationError

    try:
        return float(average_blocks(time, {"output": values}, AVERAGE).columns["output"].std())
    except CompensationError:
        return None
