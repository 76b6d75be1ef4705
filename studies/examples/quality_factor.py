"""Loss of a card's resonator: Q at one temperature, and the contributions that limit it."""

import numpy as np

import hrg


def loss_at(celsius: float = 20.0) -> dict[str, float]:
    """Return the contributions to 1/Q of the card hrg-30mm by name."""
    budget = hrg.loss_model(hrg.load_card("hrg-30mm"), theory="shell").budget(np.array([celsius + 273.15]))
    return {part.name: float(part.inverse_q[0]) for part in budget.parts}


if __name__ == "__main__":
    parts = loss_at()
    print(f"Q = {1 / sum(parts.values()):.3g}")
    for name, inverse_q in parts.items():
        print(f"  {name}: {100 * inverse_q / sum(parts.values()):.1f} %")
