"""`hrg twin`: the virtual gyro of a card as C11 and as an FMU, with the numbers of `hrg simulate` and no Python inside."""

import os
from typing import Literal

import numpy as np

from studies.cli.arguments import Card, Theory, ending_of
from studies.cli.output import answers
from studies.errors import InputError
from studies.files.writing import check_folder, write_text
from studies.instrument.card import load_card
from studies.resonator.law import beyond_records
from studies.results import Result, Sentence, Table
from studies.twin.fmu import name_of_input, write_fmu
from studies.twin.plan import idle_input, input_starts, plan_twin, symbol
from studies.twin.source import PROGRAM, exposed, outputs_of, sources

NO_BINARY = (
    "The FMU has no binary, because no C compiler for 64-bit Linux was found or it failed: the importing tool must compile its sources."
    " Install gcc or set CC, and run this command again for a binary."
)


@answers("hrg.twin/1")
def twin(
    card: Card,
    *,
    fmu: str | None = None,
    c: str | None = None,
    fmi: Literal["2.0", "3.0"] | None = None,
    boundary: Literal["chamber", "housing"] = "chamber",
    theory: Theory = "solid",
) -> Result:
    """Write the virtual gyro of a card as an FMU for co-simulation, or as C11.

    The heat path, the frequency law, bias, 1/Q, effects, settled loops and noise are those of hrg simulate; without noise the
    numbers are the same to 1e-9 (terms of ḟ of the bias, where an effect warms the resonator, to some 1e-5 with rows of 1 s: both take its rate between rows). Noise has the levels of [noise]: white, flicker as a sum of first-order processes, random walk, correlated.
    An effect with a date (since) goes on from it: the C program takes the profile's '# start', the FMU its parameter start_s, in s since 1970 (UTC).
    Parameters are named as in the card; shape, material laws, the number of cells, and [law] with its lags are fixed when the twin is written.

    Args:
        fmu: The FMU to write, with sources, and a binary for 64-bit Linux if there is a compiler (CC, cc or gcc).
        c: Folder for the C sources. main.c runs a profile (CSV): cc -std=c11 -O2 *.c -lm -o twin
        fmi: Version of the FMU; 3.0 unless given.
        boundary: Input temperature: that of the chamber, or of the housing itself, ahead of its sensor. Without its slope it is held over a step.
    """
    if fmu is not None:
        ending_of(fmu, (".fmu",), "--fmu")
    if fmu is None and c is None:
        raise InputError("nothing to do: give --fmu FILE.fmu, --c FOLDER, or both.")
    if fmi is not None and fmu is None:
        raise InputError(f"--fmi {fmi}: the version of an FMU; add --fmu FILE.fmu, or leave it out.")
    fmi = fmi or "3.0"
    plan = plan_twin(load_card(card), boundary, theory)
    reach = np.array([plan.constants["LOWEST"], plan.constants["HIGHEST"]])
    beyond = beyond_records(plan.instrument, reach, "this twin")
    sentences: list[Sentence | str] = [Sentence(one, "warning") for one in beyond]
    compiled = size = None
    if c is not None:
        folder = check_folder(c)
        for name, text in sources(plan, PROGRAM).items():
            write_text(folder / name, text)
        sentences.append(f"{c}: C11 sources; compile with cc -std=c11 -O2 *.c -lm -o twin.")
    if fmu is not None:
        compiled = write_fmu(plan, fmu, fmi)
        size = os.path.getsize(fmu)
        sentences.append(f"{fmu}: FMI {fmi} for co-simulation, {size / 1000:.0f} kB, with its sources.")
        if not compiled:
            sentences.append(Sentence(NO_BINARY, "warning"))
    exposed_ones = ((key, value) for key, value in plan.parameters.items() if exposed(plan, key))
    parameters = [{"name": key, "unit": symbol(key), "start": value} for key, value in exposed_ones]
    inputs = [
        {"name": name if fmu is None else name_of_input(plan, name), "unit": symbol(name), "start": start}
        for name, start in input_starts(plan).items()
        if name != idle_input(plan)
    ]
    outputs = [{"name": name, "unit": symbol(name)} for name in outputs_of(plan)]
    payload = {
        "card": plan.instrument.name,
        **{"boundary": boundary, "fmu": fmu, "c": c, "fmi": fmi if fmu is not None else None, "compiled": compiled},
        **{"bytes": size, "inputs": inputs, "outputs": outputs, "parameters": parameters},
    }
    columns = "name | unit | start: start .6"
    return Result(
        payload,
        f"Twin of {plan.instrument.name}",
        "The virtual gyro of the card, for use in other programs.",
        [
            *sentences,
            Table("Inputs", inputs, columns),
            Table("Outputs", outputs, columns),
            Table("Parameters", parameters, columns, where="page"),
        ],
    )
