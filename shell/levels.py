"""The levels of refinement: polynomial orders and lengths of elements, which rise together or one by one."""

from dataclasses import dataclass, replace
from typing import Literal

from shell.kernel import Orders

Theory = Literal["solid", "shell", "rayleigh"]
Kind = Literal["along", "through", "solids"]
KINDS: tuple[Kind, ...] = ("along", "through", "solids")  # what an error may come from
LONGEST = 1.6  # element length over the radius


@dataclass(frozen=True)
class Level:
    """Polynomial orders: (u, v, w) through the thickness, along the meridian, in blocks; rings around sharp corners.

    No element is longer than `longest` times the radius (and less for n > 4); each is cut into `split`.
    """

    through: Orders
    along: int
    block: int
    rings: int
    split: int = 1
    longest: float = LONGEST

    def raised(self, theory: Theory, kinds: set[Kind]) -> "Level":
        """The next level in what the error comes from; the same level where that is at its end."""
        ladder = LEVELS[theory]
        steps: dict[Kind, dict[str, object]] = {
            "along": next(
                ({"along": one.along} for one in ladder if one.along > self.along), {"split": ladder[-1].split}
            ),
            "through": next(({"through": one.through} for one in ladder if one.through > self.through), {}),
            "solids": next(({"block": one.block, "rings": one.rings} for one in ladder if one.block > self.block), {}),
        }
        return replace(self, **{name: value for kind in kinds for name, value in steps[kind].items()})  # type: ignore[arg-type]


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
        for along, solid, split in zip(
            (10, 12, 16, 20, 20), ((5, 3), (6, 3), (8, 5), *_SOLID[3:]), (1, 1, 1, 1, 2), strict=True
        )
    ),
}
FIRST = {theory: levels[0] for theory, levels in LEVELS.items()}
ROUGH = {theory: replace(level, along=6, block=4, rings=2) for theory, level in FIRST.items()}  # for 1e-3
