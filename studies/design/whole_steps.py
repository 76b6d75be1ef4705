"""Designs whose parameters are whole steps, such as those of a lathe: whether one is, and which lie about another."""

from dataclasses import dataclass

import numpy as np

from compensation.arrays import Array

MOST_CORNERS = 256  # of the grid of steps about a design


@dataclass(frozen=True)
class WholeSteps:
    """The box from `low` on, its `width`, and the step of every parameter, 0 without one; the first `free` may move."""

    low: Array
    width: Array
    sizes: Array
    free: int

    @property
    def leaves_some(self) -> bool:
        """Whether parameters that may move have no step."""
        return not self.sizes[: self.free].all()

    def are_met(self, x: Array) -> bool:
        """Return whether a design is one of whole steps."""
        sizes = self.sizes[: self.free]
        values = (self.low + x * self.width)[: self.free]
        off = np.abs(values - np.round(values / np.where(sizes > 0, sizes, 1.0)) * sizes)
        return bool((off[sizes > 0] < 1e-9 * self.width[: self.free][sizes > 0]).all())

    def about(self, x: Array, rng: np.random.Generator) -> list[Array]:
        """Return the designs of whole steps about one: of a settled one its neighbours, of another the corners around."""
        choices: list[list[float]] = []
        settled = self.are_met(x)
        for k in range(len(x)):
            value = self.low[k] + x[k] * self.width[k]
            if k >= self.free or not self.sizes[k]:
                choices.append([value])
                continue
            inside = self.low[k] - 1e-9 * self.width[k], self.low[k] + (1 + 1e-9) * self.width[k]
            whole = value / self.sizes[k]
            near = (round(whole) - 1, round(whole), round(whole) + 1) if settled else (np.floor(whole), np.ceil(whole))
            found = [float(n * self.sizes[k]) for n in near if inside[0] <= n * self.sizes[k] <= inside[1]]
            choices.append(found or [value])
        count = int(np.prod([len(one) for one in choices]))
        grid = np.arange(count) if count <= MOST_CORNERS else rng.choice(count, MOST_CORNERS, replace=False)
        places = np.unravel_index(grid, [len(one) for one in choices])
        rows = np.column_stack([np.array(one)[k] for one, k in zip(choices, places, strict=True)])
        return list((rows - self.low) / self.width)
