"""The page of a diagnosed steady-state table."""

from pathlib import Path
from typing import TYPE_CHECKING

from studies.reports.diagnosis import headline, reason
from studies.reports.digits import plain
from studies.reports.page import Chapter, Facts, Picture, Table, Text, draw, render_page
from studies.reports.style import BLACK, ORANGE, VERMILION, figure

if TYPE_CHECKING:
    from studies.diagnosis.table import TableDiagnosis


def table_text(found: "TableDiagnosis") -> str:
    """Return the diagnosis of a steady-state table as text."""
    following = [f"Next: {found.verdict.next_experiment}"] if found.verdict.next_experiment else []
    return "\n".join([headline(found.verdict), *found.sentences, *following])


def table_page(found: "TableDiagnosis", path: str) -> str:
    """Return the page of a steady-state table as HTML."""
    return render_page(f"Diagnosis of {Path(path).name}", headline(found.verdict), table_chapters(found))


def table_chapters(found: "TableDiagnosis") -> list[Chapter]:
    """Return the chapters of a steady-state table: the answer, and who else could have given it."""
    facts = [
        ("Verdict", found.verdict.verdict.replace("-", " "), reason(found.verdict)),
        *_law_facts(found),
        ("Curvature", f"{plain(found.curvature_ratio)} times", "the measured one over the law's"),
    ]
    rows = [[name, plain(ssq), plain(loo), plain(score)] for name, ssq, loo, score in found.candidates]
    columns = ("Candidate", "Sum of squares (Hz²)", "Leave-one-out (Hz)", "Evidence")
    candidates = Table("Candidates on top of the baseline", columns, rows)
    following = found.verdict.next_experiment
    note = [Text(f"Next experiment: {following}", "note")] if following else []
    return [
        Chapter("The answer", [Facts(facts), *note, table_residuals(found), *(Text(s) for s in found.sentences)]),
        Chapter("Candidates", [candidates]),
    ]


def _law_facts(found: "TableDiagnosis") -> list[tuple[str, str, str]]:
    """Return what the law leaves, or the card's level and slope beside the measured."""
    compared = found.verdict.details.get("settled")
    if compared is None:
        return [("Law imposed", f"{plain(1e3 * found.law_rms)} mHz", "misfit rms with the law's curvature fixed")]
    facts = []
    for name, key, unit in (("Level", "level_Hz", "Hz"), ("Slope", "slope_ppm_per_degC", "ppm/°C")):
        one = compared[key]
        if one is not None:
            remark = f"the card predicts {plain(one['predicted'], 6)} ± {plain(one['sd'], 2)} {unit}; {one['away_sd']:+.1f} standard deviations"
            facts.append(
                (f"{name} at {compared['temperature_degC']:.4g} °C", f"{plain(one['measured'], 6)} {unit}", remark)
            )
    return facts


def table_residuals(found: "TableDiagnosis") -> Picture:
    """Draw what the law, the baseline and the strongest candidate leave of a steady-state table."""
    words = (
        ("card as given", "card calibrated")
        if found.from_card
        else ("law imposed, f₀ and slope free", "baseline: curvature free")
    )
    first, second = words
    with figure(1, 1, height=3.2) as (canvas, axis):
        # lines in the order of the rows, so that a loop shows as one
        axis.plot(found.temperature, found.law_residual, "o-", color=VERMILION, label=first)
        axis.plot(found.temperature, found.baseline_residual, "s-", color=ORANGE, label=second)
        axis.plot(found.temperature, found.extended_residual, "^-", color=BLACK, label="with the strongest candidate")
        axis.set_xlabel("temperature (°C)")
        axis.set_ylabel("measured − model (Hz)")
        axis.legend()
        return draw(
            canvas, "What each model leaves of the measured table.", "Residuals of three models over temperature."
        )
