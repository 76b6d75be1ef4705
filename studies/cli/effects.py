"""`hrg effects`: the library of effects that a simulation can leave out, and that a card can have."""

from typing import Any

from studies.cli.output import answers
from studies.diagnosis.response import RESPONSES
from studies.effects import Effect, find_effect, library
from studies.results import Result, Sentence, Table, row_of


@answers("hrg.effects/1")
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
    said = {
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
            Table("Parameters of its [[effect]] table", entry["parameters"], "name: key | kind | bounds | meaning"),
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


def parameters(effect: Effect) -> list[dict[str, str]]:
    """Return every key of the effect's table: its shape, and its coefficients for the first response."""
    rows = [
        row_of(p, "name", "meaning")
        | {"kind": "shape, optional" if p.steady else "shape", "bounds": f"{p.low:g} to {p.high:g}"}
        for p in effect.shape
    ]
    names = effect.coefficient_names(effect.responses[0])
    for name, coefficient in zip(names, effect.coefficients, strict=True):
        many = len(coefficient.spread)
        kind = "coefficient" if many == 1 else f"coefficient, or a list of {many}"
        bounds = "0 and above" if effect.positive and name == names[0] else "any"
        bounds = bounds.replace("and above", f"to {coefficient.most:g}") if coefficient.most < float("inf") else bounds
        rows.append({"name": name, "kind": kind, "bounds": bounds, "meaning": "size, in the unit that the key names"})
    return rows


def describe(effect: Effect) -> dict[str, Any]:
    """Return an effect as a plain object."""
    told = row_of(effect, "name", "summary", "responses", "acts_on", "isolate", "sensor", "source")
    return told | {"parameters": parameters(effect), "drives": [DRIVES[need] for need in effect.needs]}
