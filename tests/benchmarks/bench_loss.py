"""Processor time of the loss budget after the mode is solved, with and without the anchor: python tests/benchmarks/bench_loss.py.

Targets: without anchor 50 ms, with anchor 2 s, seven temperatures, a card with a film, gas and an activated loss.
"""

import time
from collections.abc import Callable

import numpy as np

from studies.instrument.card import load_card
from studies.loss.model import loss_model

PARTS = {
    "pressure_Pa": 1e-3,
    "film": [{"material": "gold", "thickness_nm": 100.0, "loss": 1e-4}],
    "activated": [{"height": 1e-9, "energy_eV": 0.5, "peak_degC": 120.0}],
}
TEMPERATURES = np.linspace(253.15, 313.15, 7)


def best_of(run: Callable[[], object], times: int) -> float:
    """Return the shortest processor time of several runs, s."""
    found = []
    for _ in range(times):
        start = time.process_time()
        run()
        found.append(time.process_time() - start)
    return min(found)


def main() -> None:
    """Print one line for each card; the mode is solved once and kept."""
    for name in ("free-dome", "hrg-30mm", "cvg-25mm", "bvg-bell"):
        card = load_card(name).with_table("loss", PARTS)
        loss_model(card)  # the mode
        plain = best_of(lambda card=card: loss_model(card).budget(TEMPERATURES), 5)
        line = f"{name:10} {1e3 * plain:6.1f} ms"
        if card.resonator.stem is not None:
            line += f", with anchor {best_of(lambda card=card: loss_model(card, anchor=True), 2):5.2f} s"
        print(line)


if __name__ == "__main__":
    main()
