"""The levels of refinement: polynomial orders that rise together."""

from dataclasses import dataclass
from typing import Literal

from shell.kernel import Orders

Theory = Literal["solid", "shell", "rayleigh"]


@dataclass(frozen=True)
class Level:
    """Polynomial orders: (u, v, w) through the thickness, along the meridian, in blocks; rings around sharp corners."""

    through: Orders
    along: int
    block: int
    rings: int
    split: int = 1


_SOLID = ((5, 3), (6, 5), (8, 7), (10, 9), (12, 11))  # degree of blocks, rings around sharp corners
LEVELS: dict[str, tuple[Level, ...]] = {
    "solid": tuple(
        Level(through, along, *solid, split)
        for through, along, solid, split in zip(
            ((3, 3, 3), (5, 5, 4), (7, 7, 6), (9, 9, 8), (11, 11, 10)),
            (9, 12, 16, 20, 20),
            _SOLID,
            (1, 1, 1, 1, 2),
            strict=True,
        )
    ),
    "shell": tuple(
        Level((1, 1, 0), along, *solid, split)
        for along, solid, split in zip((8, 12, 16, 20, 20), _SOLID, (1, 1, 1, 1, 2), strict=True)
    ),
}
