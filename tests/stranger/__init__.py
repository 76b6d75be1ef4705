"""An independent generator of measurement campaigns with a hidden truth, and their marking.

Written from the formats and the papers alone: it shares no formula with the library of effects, so that
an answer which is right here was not learned from the generator.

`make_campaign(seed, kind, effect=None, snr=None, runs=None, folder=…) -> Truth`

kind    `effect` (one known effect), `pair` (two; effect = "a+b" or None), `null` (effect = a noise family or None),
        `alien` (a cause that no listed effect describes).
snr     rms of what the refitted generic baseline cannot absorb over rms of the noise after the same projection.
runs    1 to 6, or None to draw. folder: gets `run_1.csv` …, `card.toml`, `truth.json`.

`python -m tests.stranger OUT --count N --seed S` writes N campaigns;
`tests/benchmarks/judge.py` asks `hrg diagnose` about such campaigns and compares the answers of two commits.
"""

from tests.stranger.campaign import make_campaign
from tests.stranger.truth import Truth

__all__ = ["Truth", "make_campaign"]
