"""The results of a study: a table with units, columns as arrays, failures, outcomes of searches."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from studies.instrument.card import build_instrument
from studies.shown import Shown
from studies.sweeps.definition import Study
from studies.sweeps.design import nominal_design
from studies.sweeps.engine import make_item
from studies.sweeps.spec import check_study
from studies.sweeps.store import Store, Stored, open_store

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Loaded:
    parameters: Mapping[str, NDArray[Any]]
    numbers: Array
    failed: NDArray[np.bool_]
    remarks: list[str]

    def take(self, places: list[int]) -> "_Loaded":
        return _Loaded(
            {name: values[places] for name, values in self.parameters.items()},
            self.numbers[places],
            self.failed[places],
            [self.remarks[place] for place in places],
        )


@dataclass(frozen=True, repr=False)
class Results(Shown):
    """What a store holds of a study; cases stand in the order of the spec's design."""

    drawn_by = "studies.reports.sweep_figures:first_figure"

    study: Study
    store: Store = field(repr=False)

    @cached_property
    def about(self) -> Mapping[str, Any]:
        """What the store says of its study."""
        return self.store.about()

    @property
    def total(self) -> int:
        """Number of different designs that the study has."""
        return int(self.about["cases"])

    def __len__(self) -> int:
        """Return the number of computed cases, a design that the spec repeats as often as it does."""
        return len(self._loaded.remarks)

    @property
    def values(self) -> Array:
        """All results, shape (cases, columns); NaN where a quantity failed."""
        return self._loaded.numbers[:, : len(self.study.columns)]

    @property
    def errors(self) -> Array:
        """Estimates of the numerical error, shape and units as `values`; NaN where there is none."""
        return self._loaded.numbers[:, len(self.study.columns) :]

    @property
    def remarks(self) -> list[str]:
        """For every case why it failed, or what the solver warned of; mostly empty."""
        return self._loaded.remarks

    @property
    def failed(self) -> NDArray[np.intp]:
        """The places of the cases that failed."""
        return np.flatnonzero(self._loaded.failed)

    def column(self, name: str) -> Array:
        """Return one column of results."""
        return self.values[:, [column.name for column in self.study.columns].index(name)]

    def parameter(self, name: str) -> NDArray[Any]:
        """Return one parameter of every case."""
        return self._loaded.parameters[name]

    def design(self, place: int) -> dict[str, Any]:
        """Return the parameters of one case by name."""
        return {name: self.parameter(name)[place].item() for name in self.study.names}

    @cached_property
    def _loaded(self) -> "_Loaded":
        """Read the store into columns: a million cases as rows of Python objects would fill the memory."""
        names = self.study.names
        columns: dict[str, list[Any]] = {name: [] for name in names}
        numbers, failed, remarks, place_of = bytearray(), bytearray(), [], {}
        for place, (position, parameters, status, remark, packed) in enumerate(self.store.rows()):
            place_of[position] = place
            for name, value in json.loads(parameters).items():
                columns[name].append(value)
            numbers += packed
            failed.append(status != "ok")
            remarks.append(remark)
        loaded = _Loaded(
            {name: np.array(columns[name]) for name in names},
            np.frombuffer(numbers, "<f8").reshape(len(remarks), 2 * len(self.study.columns)),
            np.frombuffer(failed, np.bool_),
            remarks,
        )
        repeats = [place_of[position] for position in self.about["repeats"] if position in place_of]
        return loaded.take(repeats) if repeats else loaded

    @cached_property
    def nominal(self) -> Stored | None:
        """The nominal design, None before it has been computed."""
        return self.store.find(make_item(self.about["identity"]["base"], None, nominal_design(self.study)).key)

    def table(self) -> "pd.DataFrame":
        """Return one row a case: parameters, results, numerical errors, status, remark; `attrs["units"]` by column."""
        import pandas as pd

        columns: dict[str, Any] = {name: self.parameter(name) for name in self.study.names}
        units = {p.name: p.unit for p in self.study.parameters}
        for place, column in enumerate(self.study.columns):
            columns[column.name] = self.values[:, place]
            units[column.name] = column.unit
            if np.isfinite(self.errors[:, place]).any():
                columns[f"{column.name}_error"] = self.errors[:, place]
                units[f"{column.name}_error"] = column.unit
        columns["status"] = np.where(self._loaded.failed, "failed", "ok")
        columns["remark"] = self.remarks
        table = pd.DataFrame(columns)
        table.attrs = {"study": self.study.name, "units": units}
        return table

    def to_frame(self) -> "pd.DataFrame":
        """Return `table()`, by the name that every result has."""
        return self.table()

    def __repr__(self) -> str:
        return f"Results({self.study.name}: {len(self)} of {self.total} cases, {len(self.failed)} failed)"

    def close(self) -> None:
        """Close the store."""
        self.store.close()


def open_results(folder: str | Path) -> Results:
    """Return the results that a folder holds; InputError when there is no study in it or its store is damaged."""
    store = open_store(folder)
    about = store.about()
    given = about["instrument"]
    instrument = build_instrument(given["content"], given["path"])
    return Results(check_study(about["spec"], instrument, str(folder), about["folder"], about["spec_text"]), store)
