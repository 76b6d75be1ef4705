"""A calibration: a gyro that differs from its card is run in the chamber, and the record finds the difference."""

import hrg

TRUE = {"thermal.mount_conductance_W_per_K": 0.014}  # the card has 0.0120


def calibrate_card() -> tuple[float, float, float]:
    """Return the conductance (W/K) of the card, of the gyro, and as calibrated."""
    card = hrg.load_card("hrg-30mm")
    name, true = next(iter(TRUE.items()))
    record = hrg.simulate(card.with_values(TRUE), "step 20 -10 5h", row=300, seed=1)
    found = hrg.calibrate(card, record)
    before, after = (next(v.value for v in one.uncertain if v.name == name) for one in (card, found.instrument))
    return before, true, after


if __name__ == "__main__":
    before, true, after = calibrate_card()
    print(f"card {before:.4f}, gyro {true:.4f}, calibrated {after:.4f} W/K")
