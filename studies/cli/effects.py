"""`hrg effects`: the library of effects that a simulation can leave out, and that a card can have."""

from typing import TYPE_CHECKING, Any

from studies.cli.output import Answer, answers

if TYPE_CHECKING:
    from studies.effects import Effect


@answers("hrg.effects/1")
def effects(name: str = "") -> Answer:
    """List the physical effects that a diagnosis can name and an `[[effect]]` table of a card can have.

    Parameters
    ----------
    name : str
        Show one effect: parameters, units, bounds, drives, source, isolating experiment.
    """
    from studies.cli.output import print_table
    from studies.effects import find_effect, library

    chosen = [find_effect(name)] if name else list(library().values())
    yield {"schema": "hrg.effects/1", "effects": [describe(effect) for effect in chosen]}
    if not name:
        rows = [[e.name, ", ".join(_words(e)), e.summary] for e in chosen]
        print_table("Effects", ["Name", "Acts on", "What happens"], rows, "hrg effects NAME shows one of them in full.")
        return 0
    effect = chosen[0]
    print(f"{effect.name}: {effect.summary}.")
    rows = [[p["name"], p["kind"], p["bounds"], p["meaning"]] for p in parameters(effect)]
    print_table("Parameters of its [[effect]] table", ["Key", "Kind", "Bounds", "Meaning"], rows)
    print(f"Acts on: {', '.join(_words(effect))}.")
    if effect.needs:
        print(f"Drive that must be recorded and vary: {', '.join(DRIVES[need] for need in effect.needs)}.")
    print(f"To isolate it: {effect.isolate}.")
    if effect.sensor:
        print(f"Sensor that would show it: {effect.sensor}.")
    print(f"Source: {effect.source}.")


DRIVES = {
    "amplitude_squared": "drive_amplitude_V",
    "voltage_squared": "electrode_bias_V",
    "quadrature": "quadrature_V",
    "pattern_angle": "pattern_angle_deg",
}


def _words(effect: "Effect") -> tuple[str, ...]:
    return ("temperature of the resonator",) if effect.thermal else effect.responses


def parameters(effect: "Effect") -> list[dict[str, str]]:
    """Return every key of the effect's table: its shape, and its coefficients for the first response."""
    rows = [
        {
            "name": p.name,
            "kind": "shape, optional" if p.steady else "shape",
            "bounds": f"{p.low:g} to {p.high:g}",
            "meaning": p.meaning,
        }
        for p in effect.shape
    ]
    names = effect.coefficient_names(effect.responses[0])
    for name, coefficient in zip(names, effect.coefficients, strict=True):
        many = len(coefficient.spread)
        kind = "coefficient" if many == 1 else f"coefficient, or a list of {many}"
        bounds = "0 and above" if effect.positive and name == names[0] else "any"
        bounds = bounds.replace("and above", f"to {coefficient.most:g}") if coefficient.most < float("inf") else bounds
        rows.append({"name": name, "kind": kind, "bounds": bounds, "meaning": "size; the unit is that of the name"})
    return rows


def describe(effect: "Effect") -> dict[str, Any]:
    """Return an effect as a plain object."""
    return {
        "name": effect.name,
        "summary": effect.summary,
        "responses": list(effect.responses),
        "acts_on": effect.acts_on,
        "parameters": parameters(effect),
        "drives": [DRIVES[need] for need in effect.needs],
        "isolate": effect.isolate,
        "sensor": effect.sensor,
        "source": effect.source,
    }
