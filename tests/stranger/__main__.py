"""`python -m tests.stranger OUT --count N --seed S`: a mixed set of campaigns, the kinds in turn.

Beside each campaign `ideal.json`: what an ideal predictor leaves of held-out rows, over the floor.
"""

import argparse
import json
from itertools import cycle, islice
from pathlib import Path

from tests.stranger.aliens import ALIENS
from tests.stranger.campaign import make_campaign
from tests.stranger.effects import EFFECTS
from tests.stranger.ideal import ideal_ratios
from tests.stranger.noise import FAMILIES

SNRS = (0.3, 1.0, 3.0, 6.0, 12.0)
ALIEN_SNRS = (3.0, 6.0, 12.0)


def plan(count: int) -> list[tuple[str, str | None, float | None]]:
    """Of twelve campaigns: seven effects, two nulls, two aliens, one pair; names and SNR go round in step."""
    effects, nulls, aliens = cycle(EFFECTS), cycle(FAMILIES), cycle(ALIENS)
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    for i, (kind, name, snr) in enumerate(islice(plan(given.count), given.count)):
        folder = given.out / f"s{given.seed + i:04d}"
        truth = make_campaign(given.seed + i, kind, name, snr, folder=folder)
        (folder / "ideal.json").write_text(json.dumps(ideal_ratios(truth)))
        print(f"s{given.seed + i:04d} {kind:6} {'+'.join(h.effect for h in truth.hidden) or name}", flush=True)


if __name__ == "__main__":
    main()
