"""Parts of a diagnosed steady-state table: the answer, what each model leaves, and the candidates."""

from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.table import TableDiagnosis
from studies.reports.diagnosis import headline, next_step, reason
from studies.reports.digits import plain, to_error
from studies.reports.style import BLACK, ORANGE, VERMILION, figure
from studies.results import Chapter, Drawing, Fact, Facts, Figure, Sentence, Table

CANDIDATES = "0: candidate | 1: sum of squares (Hz²) .3 | 2: leave-one-out (Hz) .3 | 3: evidence .3"
EVIDENCE = (
    "Evidence: twice the logarithm of the Bayes factor, the ratio of the probabilities of the readings with and without the candidate, averaged over its size."
    f" From {-2.0 * CONSTANTS['log_prior_effect']:.0f} it proves a cause; with less, causes are given only for a residual that is no noise."
)


def table_parts(found: TableDiagnosis) -> list[Chapter]:
    """Return what people read of a steady-state table: the answer, and the other candidates."""
    verdict = found.verdict
    ratio = ("Curvature", f"{plain(found.curvature_ratio)} times", "measured over predicted")
    facts = [("Verdict", verdict.verdict.replace("-", " "), reason(verdict)), *law_facts(found), ratio]
    return [
        Chapter("The answer", [
            Sentence(headline(verdict), where="terminal"),
            Facts(facts, "page"),
            Figure(lambda: table_residuals(found), "Residuals of three models of the measured table."),
            *map(Sentence, found.sentences),
            *next_step(verdict),
        ]),
        Chapter("Candidates", [Table("Candidates added to the baseline", found.candidates, CANDIDATES, EVIDENCE, "page")]),
    ]  # fmt: skip


def law_facts(found: TableDiagnosis) -> list[Fact]:
    """Return the residual of the law, or the measured level and slope beside those of the card, to the digits of its uncertainty."""
    compared = found.verdict.details.get("settled")
    if compared is None:
        return [("Residual, default law", f"{plain(1e3 * found.law_rms)} mHz", "rms, with the curvature of the law")]
    facts = []
    for name, key, unit in (("Level", "level_Hz", "Hz"), ("Slope", "slope_ppm_per_degC", "ppm/°C")):
        if (one := compared[key]) is not None:
            predicted, sd = to_error(one["predicted"], one["sd"])
            measured, _ = to_error(one["measured"], one["sd"])
            remark = f"predicted {predicted} ± {sd} {unit}; {abs(one['away_sd']):.1f} standard deviations off"
            facts.append((f"{name} at {compared['temperature_degC']:.4g} °C", f"{measured} {unit}", remark))
    return facts


def table_residuals(found: TableDiagnosis) -> Drawing:
    """Draw the residuals of the law, the baseline and the strongest candidate of a steady-state table."""
    given = ("card as given", "card calibrated") if found.from_card else ("default law", "baseline: curvature free")
    with figure(1, 1, height=3.2, x="temperature (°C)", y="measured − model (Hz)") as (canvas, axis):
        # lines in the order of the rows, so that a loop shows as one
        axis.plot(found.temperature, found.law_residual, "o-", color=VERMILION, label=given[0])
        axis.plot(found.temperature, found.baseline_residual, "s-", color=ORANGE, label=given[1])
        axis.plot(found.temperature, found.extended_residual, "^-", color=BLACK, label="with the strongest candidate")
        return canvas
