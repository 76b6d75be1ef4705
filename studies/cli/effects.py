"""`hrg effects`: the library of effects that a simulation can leave out, and that a card can have."""

from typing import Any

from studies.cli.output import answers
from studies.diagnosis.response import RESPONSES
from studies.effects import Effect, find_effect, library
from studies.instrument.tables.effect import keys_of
from studies.results import Result, Sentence, Table, row_of
from studies.schema.reference import list_keys

KEYS = "name: key | unit | shown: default | bounds | kind: type | meaning"


@answers("hrg.effects/2")
def effects(name: str = "") -> Result:
    """List the physical effects that a diagnosis can name and an `[[effect]]` table of a card can have.

    Args:
        name: Show one effect: parameters, units, bounds, drives, source, isolating experiment.
    """
    chosen = [find_effect(name)] if name else list(library().values())
    entries = [describe(effect) for effect in chosen]
    payload = {"effects": entries}
    if not name:
        rows = [{**entry, "acts": _words(effect)} for entry, effect in zip(entries, chosen, strict=True)]
        columns = "name | acts: acts on | summary: description"
        table = Table("Effects", rows, columns, "hrg effects NAME shows one of them in full.")
        lead = "What a diagnosis can name, and an [[effect]] table of a card can have."
        return Result(payload, "Effects", lead, [table])
    effect, entry = chosen[0], entries[0]
    keys = [{**one, "shown": "required" if one["required"] else one["default"]} for one in entry["parameters"]]
    said = {
        "Its sizes, in their order, are factors of": entry["form"].rstrip("."),
        "Acts on": ", ".join(_words(effect)),
        "Drive that must be recorded and vary": ", ".join(entry["drives"]),
        "To isolate it": effect.isolate,
        "Sensor that would show it": effect.sensor,
        "Source": effect.source,
    }
    return Result(
        payload,
        f"Effect {effect.name}",
        f"{effect.summary}.",
        [
            Sentence(f"{effect.name}: {effect.summary}.", where="terminal"),
            Table("Keys of its [[effect]] table", keys, KEYS),
            *(f"{label}: {words}." for label, words in said.items() if words),
        ],
    )


DRIVES = {
    "amplitude_squared": "drive_amplitude_V",
    "voltage_squared": "electrode_bias_V",
    "quadrature": "quadrature_V",
    "pattern_angle": "pattern_angle_deg",
}


def _words(effect: Effect) -> tuple[str, ...]:
    if effect.thermal:
        return ("temperature of the resonator",)
    return tuple(RESPONSES[one].word for one in effect.responses)


def parameters(effect: Effect) -> list[dict[str, Any]]:
    """Return every key of the effect's table as the reader of cards declares it, coefficients for each response."""
    tables = {r: list(list_keys(keys_of({"name": effect.name, "response": r}, ""))) for r in effect.responses}
    rows: dict[str, dict[str, Any]] = {}
    for response, table in tables.items():
        for row in table:
            of_all = all(any(one["key"] == row["key"] for one in other) for other in tables.values())
            meaning = row["meaning"] if of_all else f"with response = '{response}': {row['meaning']}"
            said = row_of(row, "unit", "required", "default", "bounds", name="key", kind="type")
            rows[row["key"]] = said | {"meaning": meaning}
    return list(rows.values())


def describe(effect: Effect) -> dict[str, Any]:
    """Return an effect as a plain object."""
    told = row_of(effect, "name", "summary", "responses", "acts_on", "isolate", "sensor", "source")
    told["form"] = " ".join((effect.columns.__doc__ or "").split())  # the formulas stand once, above what computes them
    return told | {"parameters": parameters(effect), "drives": [DRIVES[need] for need in effect.needs]}
