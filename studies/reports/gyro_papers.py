"""The chapters on the two CVG papers and the BVG paper for the page of `hrg reproduce`, and their numbers."""

import dataclasses
from typing import Any

from studies.papers.bvg import BellTwin, reproduce_bell
from studies.papers.bvg_theory import compare_bell_theory, read_planted_rate
from studies.papers.cvg_cross_damping import PRINTED_IMPROVEMENT, CrossDampingTwin, reproduce_cross_damping
from studies.papers.cvg_filters import FilterStudy, study_error_map, study_filters
from studies.papers.loop_claims import study_claims
from studies.reports import bell, cross_damping, filters, loop_claims
from studies.reports.bell_theory import theory_chapters
from studies.results import Chapter

SOURCES = (*cross_damping.SOURCES, *filters.SOURCES, *bell.SOURCES, *loop_claims.SOURCES)
MAP_POINTS = 31


def reproduce_gyro_papers(seeds: int = 20) -> tuple[list[Chapter], dict[str, Any]]:
    """Run the virtual gyros of the three papers; return their chapters and the numbers for summary.json.

    Parameters
    ----------
    seeds : int
        Virtual runs for the spread of the cross-damping improvement.
    """
    damping, study, chain = reproduce_cross_damping(seeds), study_filters(), reproduce_bell()
    claims = study_claims()
    theory, reading = compare_bell_theory(), read_planted_rate()
    chapters = [
        *cross_damping.twin_chapters(damping),
        *filters.filter_chapters(study, study_error_map(MAP_POINTS)),
        *theory_chapters(theory, reading),
        *bell.bell_chapters(chain),
        loop_claims.claims_chapter(claims),
    ]
    summary = {
        "cvg_cross_damping": _summarise_damping(damping),
        "cvg_filters": _summarise_filters(study),
        "bvg": _summarise_bell(chain),
        "bvg_theory": {**dataclasses.asdict(theory), "loop": dataclasses.asdict(reading)},
    }
    summary["loops"] = dataclasses.asdict(claims)
    return chapters, summary


def _summarise_damping(twin: CrossDampingTwin) -> dict[str, Any]:
    return {
        "improvement_printed": PRINTED_IMPROVEMENT,
        "improvement_training": twin.study.training.rows.ratio,
        "improvement_held_out": twin.improvement.ratio,
        "improvement_over_seeds_5_50_95": twin.spread,
        "by_lag_s": twin.lags,
        "by_random_walk_deg_per_sqrt_h": twin.noises,
        "improvement_by_lag_and_random_walk": twin.table,
    }


def _summarise_filters(study: FilterStudy) -> dict[str, Any]:
    return {
        "wiener": [
            {
                "noise": case.name,
                "error_of_optimum": case.optimum.error / case.rate_variance,
                "error_as_printed": case.renormalised.error / case.rate_variance,
            }
            for case in study.wiener
        ],
        "figure5_noise_reduction": study.figure5.noise_before / study.figure5.noise_after,
        "figure6_noise_reduction": study.figure6.noise_before / study.figure6.noise_after,
        "figure7_rms_error_rad_per_s": study.figure7.error_after,
        "kalman_mean_nis": study.mean_nis,
        "kalman_nis_band": study.nis_band,
    }


def _summarise_bell(twin: BellTwin) -> dict[str, Any]:
    return {
        "claims": dataclasses.asdict(twin.claims),
        "fitted": [dataclasses.asdict(step) for step in twin.fitted],
        "held_out": [dataclasses.asdict(step) for step in twin.held_out],
    }
