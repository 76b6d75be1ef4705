"""The results of a study: a table with units, columns as arrays, failures, outcomes of searches."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from studies.instrument.card import Instrument
from studies.sweeps.design import nominal_design
from studies.sweeps.engine import make_item
from studies.sweeps.spec import Study, check_study
from studies.sweeps.store import Store, Stored, open_store

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Results:
    """What a store holds of a study; cases stand in the order of the spec's design."""

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

    @cached_property
    def cases(self) -> list[Stored]:
        """The computed cases, a design that the spec repeats as often as it does."""
        cases = list(self.store.cases())
        repeats = self.about["repeats"]
        if not repeats:
            return cases
        by_place = {case.position: case for case in cases}
        return [by_place[place] for place in repeats if place in by_place]

    @cached_property
    def values(self) -> Array:
        """All results, shape (cases, columns); NaN where a quantity failed."""
        return np.array([case.values for case in self.cases]).reshape(len(self.cases), len(self.study.columns))

    @cached_property
    def errors(self) -> Array:
        """Estimates of the numerical error, shape and units as `values`; NaN where there is none."""
        return np.array([case.errors for case in self.cases]).reshape(self.values.shape)

    def column(self, name: str) -> Array:
        """Return one column of results."""
        return self.values[:, [column.name for column in self.study.columns].index(name)]

    def parameter(self, name: str) -> NDArray[Any]:
        """Return one parameter of every case."""
        return np.array([case.parameters[name] for case in self.cases])

    @property
    def failed(self) -> list[Stored]:
        """The cases that failed, with their reasons."""
        return [case for case in self.cases if case.status == "failed"]

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
        columns["status"] = [case.status for case in self.cases]
        columns["remark"] = [case.remark for case in self.cases]
        table = pd.DataFrame(columns)
        table.attrs = {"study": self.study.name, "units": units}
        return table

    def close(self) -> None:
        """Close the store."""
        self.store.close()


def open_results(folder: str | Path) -> Results:
    """Return the results that a folder holds; InputError when there is no study in it or its store is damaged."""
    store = open_store(folder)
    about = store.about()
    given = about["instrument"]
    instrument = Instrument(given["name"], given["reference_temperature"], given["content"], given["path"])
    return Results(check_study(about["spec"], instrument, str(folder), about["folder"], about["spec_text"]), store)
