"""The chapters on the two CVG papers and the BVG paper for the page of `hrg reproduce`, and their numbers."""

from typing import Any

from studies.papers import bvg, cvg_cross_damping, cvg_filters
from studies.papers.bvg_theory import compare_bell_theory, read_planted_rate, theory_chapters
from studies.papers.loop_claims import LoopClaims, study_claims
from studies.results import Chapter, Column, Table, row_of

CLAIMS_SOURCES = (
    "Lynch D., Vibratory gyro analysis by the method of averaging, St. Petersburg 1995; IEEE Std 1431-2004, Annex B.",
    "Micromachines 2021, 12, 266 (Q, split, open and closed loop of a quartz gyro); Microsystems & Nanoengineering 2025, s41378-025-00872-z (abstract).",
)
CLAIMS = ("Verdict", Column(lambda one: f"{one.claim} ({one.source})", "Claim and source"), "twin: Simulation")
SOURCES = (*cvg_cross_damping.SOURCES, *cvg_filters.SOURCES, *bvg.SOURCES, *CLAIMS_SOURCES)
MAP_POINTS = 31


def reproduce_gyro_papers(seeds: int = 20) -> tuple[list[Chapter], dict[str, Any]]:
    """Run the virtual gyros of the three papers, so many for cross-damping; return chapters and the numbers for summary.json."""
    damping = cvg_cross_damping.reproduce_cross_damping(seeds)
    study, chain = cvg_filters.study_filters(), bvg.reproduce_bell()
    claims, theory, reading = study_claims(), compare_bell_theory(), read_planted_rate()
    chapters = [
        *cvg_cross_damping.twin_chapters(damping),
        *cvg_filters.filter_chapters(study, cvg_filters.study_error_map(MAP_POINTS)),
        *theory_chapters(theory, reading),
        *bvg.bell_chapters(chain),
        _claims_chapter(claims),
    ]
    return chapters, {
        "cvg_cross_damping": _summarise_damping(damping),
        "cvg_filters": _summarise_filters(study),
        "bvg": row_of(chain, "claims", "fitted", "held_out"),
        "bvg_theory": {**vars(theory), "loop": reading},
        "loops": claims,
    }


def _summarise_damping(twin: cvg_cross_damping.CrossDampingTwin) -> dict[str, Any]:
    return {
        "improvement_printed": cvg_cross_damping.PRINTED_IMPROVEMENT,
        **row_of(twin, improvement_training="study.training.rows.ratio", improvement_held_out="improvement.ratio"),
        "improvement_over_seeds_5_50_95": twin.spread,
        **row_of(twin, by_lag_s="lags", by_random_walk_deg_per_sqrt_h="noises"),
        "improvement_by_lag_and_random_walk": twin.table,
    }


def _summarise_filters(study: cvg_filters.FilterStudy) -> dict[str, Any]:
    errors = {"error_of_optimum": "optimum.error", "error_as_printed": "renormalised.error"}
    return {
        "wiener": [row_of(case, noise="name", **errors) for case in study.wiener],
        "figure5_noise_reduction": study.figure5.noise_before / study.figure5.noise_after,
        "figure6_noise_reduction": study.figure6.noise_before / study.figure6.noise_after,
        "figure7_rms_error_rad_per_s": study.figure7.error_after,
        **row_of(study, kalman_mean_nis="mean_nis", kalman_nis_band="nis_band"),
    }


def _claims_chapter(found: LoopClaims) -> Chapter:
    (drift, drift_closed), (mean, mean_closed) = found.drift, found.mean_rate
    text = (
        f"A damping anisotropy of 1 % at Q = 1e7 causes a drift of {drift:.3f} °/h in the simulation ({drift_closed:.3f} in closed form)."
        f" At the earth rate of 15.041 °/h a free wave indicates {mean:.3f} °/h on average ({mean_closed:.3f} in closed form). Below the drift rate the wave is locked and shows no rate."
    )
    title = "Control loops: published claims and simulation"
    return Chapter(title, [text, Table("Published claims", found.claims, CLAIMS)])
