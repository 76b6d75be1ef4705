"""Study specs, `schema = "hrg.study/1"`: what is varied, how it is sampled, what is computed.

```toml
schema = "hrg.study/1"
name = "thickness and radius tolerance"
card = "hrg-30mm"                  # a shipped card, or the path of one beside this file

[sampling]
method = "sobol"                   # grid | list | latin-hypercube | sobol | sensitivity | one-at-a-time
cases = 1024                       # not for grid, list and one-at-a-time; a power of two for sobol and sensitivity
seed = 1
# batch = 8                        # cases that are computed and kept together; 16384 with families
# solver = "auto"                  # family: interpolated between full solves, with its error; full: every design by the solver

[[parameter]]
name = "resonator.thickness_mm"    # a key of the card; or temperature_degC; or user.NAME for a function of yours
tolerance = 0.005                  # nominal ± tolerance; or low and high; or values = [...] for grid and list
# nominal = 0.86                   # the card's value unless given
# distribution = "uniform"         # uniform | normal (standard_deviation) | triangular | log-uniform
# count = 11                       # points of a grid from low to high

[[parameter]]
name = "resonator.radius_mm"
low = 14.99
high = 15.01

[[derived]]                        # a key that follows from others: numbers, names, + - * / ** and brackets
name = "resonator.stem.end_mm"
expression = "4 - radius_mm"

[[quantity]]
name = "frequency"                 # frequency, tcf, bryan-factor, mode-separation, compensation-residual, ...
harmonic = 2
theory = "solid"

[[quantity]]
name = "tcf"

[[requirement]]                    # asked of the yield; may change without computing anew
column = "frequency_n2_Hz"
within = 0.5                       # of target, which is the nominal design's value unless given; or low and/or high

[[search]]                         # optional, after the sampled cases
kind = "worst-case"                # the extremes of a column over the box of all parameters
column = "frequency_n2_Hz"

[[search]]
kind = "inversion"                 # the parameters that give wanted values
vary = ["resonator.thickness_mm", "resonator.radius_mm"]
targets = { frequency_n2_Hz = 4432.07, tcf_n2_ppm_per_degC = 79.5 }

[[search]]
kind = "tolerance"                 # how much wider or narrower all tolerances are with which a share of designs meets the requirements
share = 0.95
# vary = ["resonator.radius_mm"]   # these parameters alone; all unless given
```

`grid` takes every combination, `list` the rows of equally long `values`, `sensitivity` the design of Saltelli for Sobol
indices (cases × (parameters + 2) designs), `one-at-a-time` five levels of each parameter about the nominal design.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from studies.errors import InputError
from studies.files.reading import find_shipped, list_shipped
from studies.files.toml import TomlTable
from studies.instrument.card import Instrument, load_card
from studies.schema.reader import read_toml
from studies.sweeps.definition import Study
from studies.sweeps.tables import (
    read_asked,
    read_derived,
    read_parameter,
    read_requirement,
    read_sampling,
    read_search,
    refuse_twins,
    split_tables,
)
from studies.sweeps.validity import check_nominal, check_sample

SCHEMA = "hrg.study/1"
KEYS = ("schema", "name", "note", "card", "sampling", "parameter", "derived", "quantity", "requirement", "search")
PARAMETER_KEYS = (
    "name", "low", "high", "tolerance", "values", "count", "distribution", "standard_deviation", "nominal",
)  # fmt: skip


def read_study(source: str | Path | Mapping[str, Any], card: str | None = None) -> Study:
    """Read a study from a TOML file, by the name of a shipped one, or from its content as a mapping.

    Parameters
    ----------
    source : path, name or mapping.
    card : another card than the one that the spec names.

    Raises
    ------
    InputError
        An unknown key, parameter or quantity (the nearest is named), a value of the wrong type or out of range.
    """
    if isinstance(source, Mapping):
        content, where, folder, text = dict(source), "study", Path(), ""
        if content.setdefault("schema", SCHEMA) != SCHEMA:
            raise InputError(f'study: schema must be "{SCHEMA}", not {content["schema"]!r}.')
    else:
        path = find_shipped(source, shipped_specs(), "study")
        content, folder = read_toml(path, SCHEMA), path.parent
        where = f"the shipped study '{source}'" if path in shipped_specs().values() else str(path)
        text = path.read_text(encoding="utf-8-sig")
    if card is not None:
        content["card"] = card
        text = f"# computed with --card {card} instead of the card below\n{text}"
    top = TomlTable(content, where, KEYS)
    named = top.text("card")
    beside = folder / named
    instrument = load_card(beside if card is None and named.endswith(".toml") else named)
    return check_study(content, instrument, where, str(folder.resolve()), text)


def check_study(content: Mapping[str, Any], instrument: Instrument, where: str, folder: str, text: str) -> Study:
    """Make a study from its content and its instrument, as read from a spec or from a store."""
    top = TomlTable(content, where, KEYS)
    sampling = read_sampling(top)
    parameters = tuple(
        read_parameter(part, instrument, sampling.method) for part in top.sections("parameter", PARAMETER_KEYS)
    )
    refuse_twins([parameter.name for parameter in parameters], f"{where} [[parameter]]: the name")
    derived = tuple(
        read_derived(part, instrument, [parameter.name for parameter in parameters])
        for part in top.sections("derived", ("name", "expression"))
    )
    refuse_twins([one.name for one in derived], f"{where} [[derived]]: the name")
    asked = tuple(read_asked(part, folder) for part in split_tables(top, "quantity"))
    if not asked:
        raise InputError(f"{where}: a study needs at least one [[quantity]].")
    columns = [column.name for one in asked for column in one.columns]
    refuse_twins(columns, f"{where} [[quantity]]: give one of them another label; the column")
    searches = tuple(
        read_search(part, columns, parameters)
        for part in top.sections("search", ("kind", "column", "vary", "targets", "share"))
    )
    study = Study(
        name=top.text("name", Path(where).stem),
        note=top.text("note", "-"),
        instrument=instrument,
        sampling=sampling,
        parameters=parameters,
        derived=derived,
        asked=asked,
        requirements=tuple(
            read_requirement(part, columns)
            for part in top.sections("requirement", ("column", "low", "high", "target", "within"))
        ),
        searches=searches,
        content=content,
        text=text,
        folder=folder,
    )
    check_nominal(study, where)
    if any(search.kind == "tolerance" for search in searches):
        check_sample(study, where)
    return study


def shipped_specs() -> dict[str, Path]:
    """Return name -> path of the specs that ship with the package."""
    return list_shipped(Path(__file__).parent / "templates")
