"""The results of a study: a table with units, columns as arrays, failures, outcomes of searches."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from compensation.arrays import Array
from studies.instrument.card import build_instrument
from studies.results.shown import Shown
from studies.sweeps.block import Row, decode
from studies.sweeps.definition import Study
from studies.sweeps.design import coding, nominal_row
from studies.sweeps.opening import open_store
from studies.sweeps.spec import check_study
from studies.sweeps.store import Store

if TYPE_CHECKING:
    import pandas as pd

KEPT_BYTES = 4e7  # of columns


@dataclass(frozen=True, repr=False)
class Results(Shown):
    """What a store holds of a study; cases stand in the order of the spec's design, those that are computed."""

    drawn_by = "studies.reports.sweep_figures:first_figure"

    study: Study
    store: Store = field(repr=False)
    _read: dict[int, Array] = field(default_factory=dict, repr=False, compare=False)

    @cached_property
    def about(self) -> Mapping[str, Any]:
        """What the store says of its study."""
        return self.store.about()

    @property
    def total(self) -> int:
        """Number of designs that the study has."""
        return int(self.about["cases"])

    @property
    def done(self) -> int:
        """Number of designs that are computed."""
        return int(self.store.done.sum())

    def __len__(self) -> int:
        return self.done

    @property
    def values(self) -> Array:
        """Results, shape (cases, columns); NaN where a case failed."""
        return np.stack([self.column(column.name) for column in self.study.columns], axis=1)

    @property
    def errors(self) -> Array:
        """Estimates of the numerical error, shape and units as `values`; NaN where there is none."""
        return np.stack([self.error(column.name) for column in self.study.columns], axis=1)

    def column(self, name: str) -> Array:
        """Return one column of results."""
        return self._column(self._places[name])

    def error(self, name: str) -> Array:
        """Return the estimates of the numerical error of one column."""
        return self._column(self._places[name] + len(self.study.columns))

    def parameter(self, name: str) -> NDArray[Any]:
        """Return one parameter of every case."""
        place = self._places[name]
        return decode([coding(self.study)[place - 1]], self._column(place)[:, None])[name]

    def design(self, place: int) -> dict[str, Any]:
        """Return the parameters of one case by name."""
        return {name: self.parameter(name)[place].item() for name in self.study.names}

    def remark(self, place: int) -> str:
        """Return why a case failed, or what the solver warned of; mostly nothing."""
        return self._remarks.get(place, ("", ""))[1]

    @cached_property
    def failed(self) -> NDArray[np.intp]:
        """The places of the cases that failed."""
        return np.array(sorted(k for k, (status, _) in self._remarks.items() if status != "ok"), dtype=np.intp)

    @cached_property
    def nominal(self) -> Row | None:
        """The nominal design, None before it has been computed."""
        return self.store.find(nominal_row(self.study))

    @cached_property
    def numbers(self) -> Mapping[str, Mapping[str, float]]:
        """Every column at the nominal design and over all designs, with its largest numerical error; NaN where there is none."""
        columns = self.study.columns
        w, first = len(columns), 1 + len(self.study.names)
        count, mean, square = (np.zeros(w) for _ in range(3))
        least, greatest, error = np.full(w, np.inf), np.full(w, -np.inf), np.full(w, -np.inf)
        for found in self.blocks(range(first, first + 2 * w)):
            y, judged = found[:w], found[w:]
            there, known = np.isfinite(y), np.isfinite(judged)
            here = there.sum(axis=1)
            aside = y - mean[:, None]  # moments about the mean so far, moved to the new one
            moved = aside.sum(axis=1, where=there) / np.maximum(count + here, 1)
            square += (aside**2).sum(axis=1, where=there) - (count + here) * moved**2
            count, mean = count + here, mean + moved
            least = np.minimum(least, y.min(axis=1, where=there, initial=np.inf))
            greatest = np.maximum(greatest, y.max(axis=1, where=there, initial=-np.inf))
            error = np.maximum(error, judged.max(axis=1, where=known, initial=-np.inf))
        deviation = np.sqrt(np.maximum(square, 0) / np.maximum(count, 1))
        of = {"mean": mean, "deviation": deviation, "least": least, "greatest": greatest}
        some = {"nominal": np.full(w, np.nan) if self.nominal is None else self.nominal.values}
        some |= {name: np.where(count > 0, values, np.nan) for name, values in of.items()}
        some["error"] = np.where(error > -np.inf, error, np.nan)
        return {c.name: {name: float(values[k]) for name, values in some.items()} for k, c in enumerate(columns)}

    def blocks(self, places: Sequence[int]) -> Iterator[Array]:
        """Give columns of the store (columns, m), some thousand cases at a time."""
        for _, found in self.store.read(places):
            yield found

    def pieces(self, names: Sequence[str]) -> Iterator[Array]:
        """Give numeric parameters and columns by name (names, m), some thousand cases at a time."""
        return self.blocks([self._places[name] for name in names])

    def frames(self) -> "Iterator[pd.DataFrame]":
        """Give one row a case, some thousand at a time: parameters, results, numerical errors, status, remark."""
        import pandas as pd

        d, w = len(self.study.names), len(self.study.columns)
        wanted, remarks = range(1, 1 + d + 2 * w), self.store.remarks
        for places, found in self.store.read(wanted):
            columns: dict[str, Any] = dict(decode(coding(self.study), found[:d].T))
            for column, judged, value, error in zip(
                self.study.columns, self.judged, found[d : d + w], found[d + w :], strict=True
            ):
                columns |= {column.name: value} | ({f"{column.name}_error": error} if judged else {})
            status, remark = ["ok"] * len(places), [""] * len(places)
            for row, place in enumerate(places.tolist() if remarks else ()):
                if place in remarks:
                    status[row], remark[row] = "ok" if remarks[place][0] == "ok" else "failed", remarks[place][1]
            yield pd.DataFrame({**columns, "status": status, "remark": remark})

    @property
    def header(self) -> list[str]:
        """The columns of the table."""
        return [*self.units, "status", "remark"]

    def to_frame(self) -> "pd.DataFrame":
        """Return all cases as one table; `attrs["units"]` by column."""
        import pandas as pd

        frames = list(self.frames()) or [pd.DataFrame(columns=self.header)]
        table = pd.concat(frames, ignore_index=True)
        table.attrs = {"study": self.study.name, "units": self.units}
        return table

    table = to_frame

    @property
    def judged(self) -> list[bool]:
        """For every column whether some case has an estimate of its error."""
        return self.store.judged.tolist() or [False] * len(self.study.columns)

    @property
    def units(self) -> dict[str, str]:
        """The unit of every column of the table that has one."""
        units = {p.name: p.unit for p in self.study.parameters}
        for column, judged in zip(self.study.columns, self.judged, strict=True):
            units |= dict.fromkeys([column.name, *([f"{column.name}_error"] if judged else [])], column.unit)
        return units

    def __repr__(self) -> str:
        return f"Results({self.study.name}: {self.done} of {self.total} cases, {len(self.failed)} failed)"

    def close(self) -> None:
        """Close the store."""
        self.store.close()

    @cached_property
    def _places(self) -> dict[str, int]:
        """Columns of the store by name: behind the places of the cases parameters, then results; their errors come last."""
        return {name: k for k, name in enumerate([*self.study.names, *(c.name for c in self.study.columns)], 1)}

    def _column(self, k: int) -> Array:
        """One column of the store; those that were read last are kept, as many as memory is meant for."""
        found = self._read.pop(k, None)
        if found is None:
            found, filled = np.empty(self.done), 0
            for places, columns in self.store.read([k]):
                found[filled : filled + len(places)] = columns[0]
                filled += len(places)
        self._read[k] = found
        while len(self._read) > 1 and len(self._read) * found.nbytes > KEPT_BYTES:
            del self._read[next(iter(self._read))]
        return found

    @cached_property
    def _remarks(self) -> dict[int, tuple[str, str]]:
        """Status and remark by the place of a case among these results."""
        there = np.flatnonzero(self.store.done)
        return {int(np.searchsorted(there, place)): one for place, one in self.store.remarks.items()}


def open_results(folder: str | Path) -> Results:
    """Return the results that a folder holds; InputError when there is no study in it or its store is damaged."""
    store = open_store(folder)
    about = store.about()
    given = about["instrument"]
    instrument = build_instrument(given["content"], given["path"])
    return Results(check_study(about["spec"], instrument, str(folder), about["folder"], about["spec_text"]), store)
