"""`hrg fit scale`: bias and scale of a bell-shaped gyro, step by step."""

import re
from dataclasses import replace
from typing import Annotated, Any

from compensation.bell import PolynomialCurve
from compensation.rate_law import CARRIED, SURE, RateCurve, RateLaw
from studies.cli.arguments import COUNT, POSITIVE, Records, SaveModel
from studies.cli.output import answers, keep_model, say
from studies.errors import InputError, numbered
from studies.fits.scale import ScaleStudy, study_scale
from studies.models import source_of
from studies.models.kinds.scale import save_scale
from studies.papers.bvg import ERRORS, SOURCES, draw_steps, steps_table
from studies.record import read_record
from studies.record.repeated import drop_repeats
from studies.reports.digits import raised
from studies.results import Chapter, Facts, Figure, Result, Sentence, Table, row_of

STEPS = {
    "rough": "null and scale (33)",
    "bias": "bias (34)",
    "scale_over_rate": "scale over rate (35)",
    "scale_over_temperature": "scale over temperature (36)",
}
FORMS = "Form | gain: Evidence over the line .3 | over: Null and scale over | held_out_deg_per_s: Error on rates left out (°/s) .2 | chosen: "
FORM_NOTE = (
    "Evidence: fall of N ln(mean square) + p ln N; above 6 is 20:1. Directions: different scales for positive and negative rates. The"
    " model takes the chosen form, a line and a square as the paper's parabola."
)
COEFFICIENTS = "Step | name: Coefficient | value ± standard_error: Value | Unit"
NOTE = "Each step is fitted to the output of the steps before it; its errors assume that those are exact, and allow for white noise plus a random walk. Temperature in °C, rate in °/s."


@answers("hrg.fit-scale/1")
def fit_scale(
    *data: Records,
    cutoff: Annotated[float, POSITIVE] = 1.0,
    order: Annotated[int, COUNT] = 50,
    no_filter: bool = False,
    save: SaveModel = None,
) -> Result:
    """Fit null, bias over temperature, and scale over rate and over temperature (BVG paper, equations 32 to 36).

    Give the paper's three records in any order, each with time_s, rate_deg_per_s (the applied rate), a temperature, and
    output_counts or measured_rate_deg_per_s: several rates at one temperature; at rest over temperature; at one rate over
    temperature. The first alone is enough, and a rate table over temperature can replace any of them; the answer then says which steps
    could not be fitted. A model from the first alone is valid only at its temperatures. A record at one temperature, first at rest and then at one rate (the paper:
    five minutes of rest, then +100 °/s), gives the rough null and scale (33); without it they are found from the record with
    several rates. Further records with several rates, also while the temperature changes, give the law over rate, temperature,
    warming and cooling.

    Args:
        cutoff: Cut-off frequency of the FIR filter in Hz; below half the output rate.
        order: Order of the FIR filter; the paper uses 50.
        no_filter: Omit the FIR filter; the record may then have gaps.
    """
    if no_filter and (cutoff, order) != (1.0, 50):
        raise InputError("--no-filter: --cutoff and --order are of the filter; leave them out, or --no-filter.")
    records, repeated = drop_repeats([read_record(path) for path in data])
    for sentence in repeated:
        say(f"warning: {sentence}")
    study = study_scale(records, None if no_filter else cutoff, order)
    sources = tuple(source_of(record) for record in records)
    chain = replace(study.chain, warming=study.warming)
    model = save_scale(chain, study.output, study.temperature_column, sources, "hrg-workbench, hrg fit scale")
    keep_model(model, save)
    parts: dict[str, dict[str, dict[str, Any]]] = {
        part.name: {
            name: {"value": value, "standard_error": error, "unit": unit}
            for name, value, error, unit in zip(part.names, part.values, part.standard_errors, part.units, strict=True)
        }
        for part in model.parts
    }
    payload: dict[str, Any] = {
        "records": list(data),
        **row_of(study, "output", temperature="temperature_column", rows_left_out="left_out"),
        **row_of(
            study,
            filter_delay_s="chain.delay",
            error_before_deg_per_s="error_before",
            error_held_out_deg_per_s="error_held_out",
        ),
        "parts": parts,
        "steps": study.figures,
        "undetermined": [what for what, there in _undetermined(study)],
        "rate_law": _law_row(study.law),
    }
    rows = [
        {"step": STEPS.get(step, step), "name": name} | one | {"unit": _spell_unit(one["unit"])}
        for step, found in parts.items()
        for name, one in found.items()
    ]
    shown = [one for one in study.figures if one.step != "filtered" or len(study.chain.taps)]
    law = study.law
    return Result(
        payload,
        "Bias and scale of a bell-shaped gyro",
        f"Null, bias over temperature, and scale over rate and temperature, fitted step by step to {', '.join(data)}.",
        [
            _facts(study), *_remarks(study),
            Chapter("Output after each step", [
                steps_table(shown, "Output after each step, fitted records"),
                Figure(lambda: draw_steps(study.chain, study.runs), ERRORS),
            ]),
            Chapter("Law over rate", [
                Table("Forms of the raw output over rate", payload["rate_law"]["forms"] if law else [], FORMS, FORM_NOTE),
                _law_words(law, study.chain.scale_over_rate) if law else None,
            ]),
            Chapter("Coefficients", [Table("Coefficients", rows, COEFFICIENTS, NOTE)]),
        ],
        sources=SOURCES,
    )  # fmt: skip


def _law_row(law: RateLaw | None) -> dict[str, Any] | None:
    """The forms for --json; values per °/s of the applied rate, in the unit of the output; A and d in °/s."""
    if law is None:
        return None
    return {
        "chosen": law.chosen.name,
        "left_over": "structure" if law.structure else "none",
        "forms": [
            {"form": f.name, "gain": f.gain, "over": ", ".join(f.over), "held_out_deg_per_s": f.held_out, "values": f.values,
             "chosen": "←" if f.name == law.chosen.name else ""}
            for f in law.forms
        ],
    }  # fmt: skip


def _law_words(law: RateLaw, curve: PolynomialCurve) -> str:
    rivals = [form for form in law.forms if form.name not in (law.chosen.name, "line")]
    alike = [form.name for form in rivals if abs(form.gain - law.chosen.gain) < SURE]
    words = f"The output over rate follows this form: {law.chosen.name}."
    if alike and law.chosen.name != "line":
        words += f" These rates do not separate it from: {', '.join(alike)}."
    left = "It leaves structure beyond the errors of the means: more rates, or another form, are needed."
    if law.chosen.name in CARRIED and not isinstance(curve, RateCurve):
        words += " The run at one temperature has too few rates for it: the model keeps the paper's parabola."
    if isinstance(curve, RateCurve) and curve.blind:
        d = curve.coefficients[2] + curve.blind  # the band, and what noise hides beside it
        words += f" Within ±{d:.2g} °/s the output does not tell the rate: such rows stay empty, and errors here are without them."
    if "warming" in law.chosen.over:
        words += " The model first takes the difference between warming and cooling out of the output."
    return f"{words} {left if law.structure else 'What it leaves is within the errors of the means.'}"


def _facts(study: ScaleStudy) -> Facts:
    first, last = study.figures[0], next(f for f in study.figures if f.step == "temperature_compensated")
    error = f"{study.error_before:.4f} → {study.error_held_out:.4f} °/s"
    facts = [("Rate error, held-out data", error, "rms, rough → compensated, before the filter")]
    if first.nonlinearity is not None and last.nonlinearity is not None:
        change = f"{100 * first.nonlinearity:.3f} → {100 * last.nonlinearity:.3f} %"
        facts.append(("Nonlinearity", change, "largest deviation of the means at each rate from a line, of full scale"))
    if first.at_rest is not None and last.at_rest is not None:
        rest = f"{first.at_rest:.4f} → {last.at_rest:.4f} °/s"
        facts.append(("Output at rest", rest, "standard deviation over temperature"))
    if len(study.chain.taps):
        facts.append(("Filter delay", f"{study.chain.delay:.2f} s", f"FIR with {len(study.chain.taps)} taps"))
    return Facts(facts)


def _undetermined(study: ScaleStudy) -> list[tuple[str, str]]:
    """Return the steps for which there is no run, and the record that would give each."""
    _, rest, turning = study.runs
    found = [("bias over temperature", "at rest over temperature")] if rest is None else []
    return found + ([("scale over temperature", "at one rate over temperature")] if turning is None else [])


def _remarks(study: ScaleStudy) -> list[str | Sentence]:
    ends = (f"{T:.1f}" for T in (study.runs[0].temperature.min(), study.runs[0].temperature.max()))
    where = " … ".join(dict.fromkeys(ends))
    lacks: list[str | Sentence] = [
        Sentence(f"The {what} is not determined: the model holds near {where} °C. Add a record {record}.", "warning")
        for what, record in _undetermined(study)
    ]
    said = {
        f"Left out: {numbered(study.left_out, 'row')} with an empty cell or an outlier.": study.left_out,
        "The rough null and scale are from the record at rest and then at one rate.": study.rough_run,
        "Long records were averaged in blocks before the fit; the held-out error is that of the blocks.": study.averaged,
    }
    if study.from_table:
        said[f"Runs taken from the rate table over temperature, without a filter: {', '.join(study.from_table)}."] = 1
    return [*lacks, *(sentence for sentence, true in said.items() if true)]


def _spell_unit(unit: str) -> str:
    spelled = unit.replace("deg/s per counts", "°/s per count").replace("/degC", "/K").replace("deg", "°")
    return re.sub(r"\^(\d+)", lambda power: raised(int(power[1])), re.sub("^/", "per ", spelled.removeprefix("1")))
