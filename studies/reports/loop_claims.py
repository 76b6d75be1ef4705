"""The chapter on what is claimed of loops, and what the twin says."""

from studies.papers.loop_claims import LoopClaims
from studies.results import Chapter, Column, Part, Sentence, Table

SOURCES = (
    "Lynch D., Vibratory gyro analysis by the method of averaging, St. Petersburg 1995; IEEE Std 1431-2004, Annex B.",
    "Micromachines 2021, 12, 266 (Q, split, open and closed loop of a quartz gyro); Microsystems & Nanoengineering 2025,"
    " s41378-025-00872-z (abstract).",
)
COLUMNS = (
    Column("verdict", "Verdict"),
    Column(lambda one: f"{one.claim} ({one.source})", "Claim and source"),
    Column("twin", "Simulation"),
)


def claims_chapter(found: LoopClaims) -> Chapter:
    """Return the chapter."""
    (drift, drift_closed), (mean, mean_closed) = found.drift, found.mean_rate
    text = (
        f"A damping anisotropy of 1 % at Q = 1e7 causes a drift of {drift:.3f} °/h in the simulation ({drift_closed:.3f} in closed form)."
        f" At the earth rate of 15.041 °/h a free wave indicates {mean:.3f} °/h on average ({mean_closed:.3f} in closed form). Below"
        " the drift rate the wave is locked and shows no rate."
    )
    parts: list[Part] = [Sentence(text), Table("Published claims", found.claims, COLUMNS)]
    return Chapter("Control loops: published claims and simulation", parts)
