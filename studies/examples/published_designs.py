"""Published resonators beside the same ones computed: frequency, Q with interval, slope.

Of the first two one dimension is not printed and fitted to the frequency. Of the oxide shell nothing is fitted: as a free, even
hemisphere it comes out 18 % below the printed frequency of n = 2 and 21 % below 55.2 kHz of n = 3; a mould etched in silicon is none.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import hrg

ROOM = 293.15  # K


@dataclass(frozen=True)
class Published:
    """What is printed of a resonator, `q` and `slope` (ppm/K) from … to; None where nothing is."""

    card: str
    frequency: float  # Hz
    q: tuple[float, float]
    slope: tuple[float, float] | None
    source: str
    name: str = ""  # where it is not the card's
    values: Mapping[str, float] = field(default_factory=dict)  # printed dimensions, in place of the card's


DESIGNS = (
    Published(
        "hrg-30mm", 4432.07, (30e6, 50e6), (78.8, 79.3),
        "f and, from its differences at 15 and 25 °C, slope: Sensors 2012, 12, 6434, Table 1; Q of bare shells of silica: Wikipedia, Hemispherical resonator gyroscope",
    ),
    Published(
        "birdbath-5mm", 8800.0, (1.2e6, 1.2e6), None,
        "Fused Silica Micro Birdbath Shell Resonators With 1.2 Million Q and 43 Second Decay Time Constant, Hilton Head Workshop 2014",
    ),
    Published(
        "free-dome", 19170.0, (19100.0, 19100.0), None,
        "oxide shell, 910 µm across, 2.6 µm thick; Q printed with 30 nm of platinum on it, ours bare: Electrical characterization of"
        " ALD-coated silicon dioxide micro-hemispherical shell resonators, 2014 (abstract: acemap.info/paper/276657221)",
        "oxide-1mm", {"resonator.radius_mm": 0.4537, "resonator.thickness_mm": 0.0026},
    ),
)  # fmt: skip


def beside(design: Published) -> dict[str, float]:
    """Return our frequency (Hz), Q with its interval, and slope (ppm/K) with its standard deviation."""
    card = hrg.load_card(design.card).with_values(design.values)
    model = hrg.loss_model(card)
    budget, law = model.budget(ROOM), hrg.law_of(card, ROOM, ROOM)
    low, high = (1 / float(end[0]) for end in reversed(budget.interval))
    return {
        "frequency": model.frequency, "q": 1 / float(budget.inverse_q[0]), "low": low, "high": high,
        "slope": 1e6 * float(law.slope([ROOM])[0]), "sd": 1e6 * float(law.slope_uncertainty([ROOM])[0]),
    }  # fmt: skip


if __name__ == "__main__":
    for design in DESIGNS:
        ours, printed = (
            beside(design),
            "nothing printed" if design.slope is None else f"printed {design.slope[0]:g} to {design.slope[1]:g}",
        )
        print(f"{design.name or design.card}: f {ours['frequency']:.1f} Hz (printed {design.frequency:g})")
        print(
            f"  Q {ours['q']:.3g}, 90 % from {ours['low']:.3g} to {ours['high']:.3g} (printed {design.q[0]:.3g} to {design.q[1]:.3g})"
        )
        print(f"  slope {ours['slope']:.1f} ± {ours['sd']:.1f} ppm/K ({printed})")
        print(f"  {design.source}")
