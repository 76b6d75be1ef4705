"""`python -m tests.stranger OUT --count N --seed S`: a mixed set of campaigns, the kinds in turn.

Beside each campaign `ideal.json`: what an ideal predictor leaves of held-out rows, over the floor.
"""

import argparse
import json
from itertools import cycle
from pathlib import Path

from tests.stranger.aliens import ALIENS
from tests.stranger.campaign import make_campaign
from tests.stranger.effects import JUDGED
from tests.stranger.ideal import ideal_ratios
from tests.stranger.noise import FAMILIES
from tests.stranger.truth import Truth

SNRS = (0.3, 1.0, 3.0, 6.0, 12.0)
ALIEN_SNRS = (3.0, 6.0, 12.0)


def plan(count: int) -> list[tuple[str, str | None, float | None]]:
    """Of twelve campaigns: seven effects, two nulls, two aliens, one pair; names and SNR go round in step."""
    effects, nulls, aliens = cycle(JUDGED), cycle(FAMILIES), cycle(ALIENS)
    out: list[tuple[str, str | None, float | None]] = []
    for i, turn in zip(range(count), cycle("eenepeaeenea"), strict=False):
        level = i // 12 + i  # moves against the turn, so that every name meets every SNR
        if turn == "e":
            out.append(("effect", next(effects), SNRS[level % 5]))
        elif turn == "n":
            out.append(("null", next(nulls), None))
        elif turn == "a":
            out.append(("alien", next(aliens), ALIEN_SNRS[level % 3]))
        else:
            out.append(("pair", None, ALIEN_SNRS[level % 3]))
    return out


def make_one(seed: int, index: int, folder: Path) -> tuple[Truth, dict[str, float]]:
    """Write campaign `index` of the plan; return its truth and what an ideal predictor leaves of held-out rows."""
    kind, name, snr = plan(index + 1)[index]
    truth = make_campaign(seed, kind, name, snr, folder=folder)
    return truth, ideal_ratios(truth)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    for i in range(given.count):
        folder = given.out / f"s{given.seed + i:04d}"
        truth, ideal = make_one(given.seed + i, i, folder)
        (folder / "ideal.json").write_text(json.dumps(ideal))
        print(folder.name, truth.kind, "+".join(h.effect for h in truth.hidden), flush=True)


if __name__ == "__main__":
    main()
