"""C sources of a card's twin: the code that all cards share, and card.h and card.c with the numbers of one."""

import hashlib
import math
from collections.abc import Iterable, Sequence
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np

from studies.effects.effect import AROUND
from studies.models.c_source import one_line
from studies.simulation.heat_path import LEAST_LAG, SENSOR, SENSOR_SHARE
from studies.simulation.virtual_gyro import COMMAND_DIGITS, DIGITS
from studies.twin.plan import EFFECTS, PAST, PRECESSION, START, Plan, input_starts
from thermal.constants import Stefan_Boltzmann
from thermal.network import Conductor, Node, Radiator

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

CORE = ("heat.c", "effects.c", "loops.c", "gyro.c")
SHARED = ("twin.h", *CORE)
PROGRAM = ("main.c",)
FMI = ("fmi.c", "fmi2.inc", "fmi3.inc")
TARGETS = ("temperature", "frequency_Hz", "bias_deg_per_h", "inverse_q")
OUTPUTS = ("housing_temperature_degC", "resonator_temperature_degC", "frequency_Hz", "bias_deg_per_h", "inverse_q")
LOOP_OUTPUTS = ("quadrature_V", "pattern_angle_deg")
RATE_OUTPUT = "measured_rate_deg_per_s"
UNDATED = 1e300  # s: no run begins after it


def outputs_of(plan: Plan) -> tuple[str, ...]:
    """Return the columns that the twin gives, in the order of a record."""
    loops = LOOP_OUTPUTS if plan.instrument.loop is not None else ()
    return (*OUTPUTS, *loops, RATE_OUTPUT)


def sources(plan: Plan, names: Iterable[str]) -> dict[str, str]:
    """Return the text of the files by name: shared ones, and those of the card."""
    folder = files("studies.twin") / "sources"
    found = {name: (folder / name).read_text(encoding="utf-8") for name in (*SHARED, *names)}
    head, body = card_header(plan), card_body(plan)
    token = hashlib.sha256("".join([*found.values(), head, body]).encode()).hexdigest()[:32]
    return {**found, "card.h": head.replace("@TOKEN@", token), "card.c": body}


def card_header(plan: Plan) -> str:
    """Return card.h: sizes, names of parameters and outputs, and single numbers."""
    card, network = plan.instrument, plan.network
    nodes = [node.name for node in network.nodes]
    outputs = outputs_of(plan)
    sizes = {
        "NODES": len(nodes),
        "LINKS": len(network.conductors),
        "RADIATORS": max(len(network.radiators), 1),
        "EFFECTS": max(len(plan.effects), 1),
        "LAGS": len(plan.lags.times),
        "MEMORY": plan.memory * max(len(plan.effects), 1),
        "PAST": PAST if plan.constants["DELAY"] > 0.0 else 1,
        "SENSOR": nodes.index(SENSOR) if SENSOR in nodes else -1,
        "HOUSING": nodes.index("housing") if "housing" in nodes else 0,
        "QUADRATURE": outputs.index("quadrature_V") if card.loop is not None else 0,
    }
    switches = {
        "LOOPS": int(card.loop is not None),
        "FREE": int(plan.turns_freely),
        "AHEAD": int(plan.constants["DELAY"] < 0.0),
        "LINEAR": int(card.polynomial is None and not card.thermal.radiation),
        "STIFF": int(card.loop is not None and card.loop.quadrature_control == "stiffness"),
    }
    numbers = {
        **plan.constants,
        "STEFAN_BOLTZMANN": Stefan_Boltzmann,
        "SENSOR_SHARE": SENSOR_SHARE,
        "LEAST_LAG": LEAST_LAG,
    }
    lines = ["/* One card's sizes and numbers; card.c has its tables. */", "#ifndef CARD_H", "#define CARD_H", ""]
    lines += [f"#define TWIN_NAME {_text(one_line(card.name))}", '#define TWIN_TOKEN "@TOKEN@"']
    lines += [f"#define TWIN_BOUNDARY {_text(plan.boundary + '_temperature_degC')}"]
    lines += [f"#define TWIN_INPUT_STARTS {{{', '.join(_number(v) for v in input_starts(plan).values())}}}"]
    lines += [f"#define TWIN_{name} {value}" for name, value in switches.items()]
    lines += [f"#define TWIN_{name} {_number(value)}" for name, value in numbers.items()]
    lines += [f"enum {{ {', '.join(f'TWIN_{name} = {value}' for name, value in sizes.items())} }};"]
    named = [f"P_{''.join(c if c.isascii() and c.isalnum() else '_' for c in key)}" for key in plan.parameters]
    lines += ["enum {", *(f"    {name}," for name in named), "    TWIN_PARAMETERS", "};"]
    lines += [f"enum {{ {', '.join(f'OUT_{name}' for name in outputs)}, TWIN_OUTPUTS }};"]
    lines += [f"enum {{ E_none, {', '.join(f'E_{name}' for name in EFFECTS)} }};", "", "#endif", ""]
    return "\n".join(lines)


def card_body(plan: Plan) -> str:
    """Return card.c: the tables."""
    network, outputs = plan.network, outputs_of(plan)
    place = {name: k for k, name in enumerate(network.names)}
    order = list(plan.parameters)
    keys = plan.key_of

    def link(part: Conductor | Radiator, kind: str) -> str:
        own = f"radiated {part.name}" if kind == "radiated" else part.name
        if SENSOR in (part.one, part.other):
            return f"{{{place[part.one]}, {place[part.other]}, -1, 0}}"
        value = part.exchange_area if kind == "radiated" else part.conductance  # type: ignore[union-attr]
        parameter = order.index(keys.get(own, keys[kind]))
        return f"{{{place[part.one]}, {place[part.other]}, {parameter}, {_number(value)}}}"

    def capacity(node: Node) -> str:
        here, warmer = (node.capacity_at(T) for T in (AROUND, AROUND + 1.0))
        return f"{{{order.index(keys.get(node.name, keys['shell']))}, {_number(here)}, {_number(math.log(warmer / here))}}}"

    power = network.power(0.0)
    lags = zip(plan.lags.times, plan.lags.housing, plan.lags.heat, strict=True)
    effects = [
        f"{{E_{one.name.replace('-', '_')}, {TARGETS.index(one.target)}, {plan.memory * k}, {one.shape}, {one.weights}, {_number(UNDATED if one.since is None else one.since)}}}"
        for k, one in enumerate(plan.effects)
    ]
    nowhere = "{0, 0, 0, 0}"
    splines = {**dict.fromkeys(("law", "heat_capacity", "loss", "wave_0", "wave_1")), **plan.splines}
    digits = [DIGITS.get(name, COMMAND_DIGITS) for name in outputs]
    parts = [
        f"/* Numbers of the card {one_line(plan.instrument.name)}, in the units of its keys, SI elsewhere. */",
        '#include "twin.h"',
        "",
        _table(
            "double", "twin_start", "TWIN_PARAMETERS", [_number(0.0 if v != v else v) for v in plan.parameters.values()]
        ),
        _table("double", "twin_limits", "TWIN_PARAMETERS][2", [_limits(plan, key) for key in order]),
        _table("char *const", "twin_parameter_names", "TWIN_PARAMETERS", [_text(exposed(plan, key)) for key in order]),
        _table("TwinLink", "twin_links", "TWIN_LINKS", [link(part, "conducted") for part in network.conductors]),
        _table(
            "TwinLink",
            "twin_radiators",
            "TWIN_RADIATORS",
            [link(part, "radiated") for part in network.radiators] or [nowhere],
        ),
        _table(
            "TwinCapacity",
            "twin_capacities",
            "TWIN_NODES",
            [capacity(node) for node in network.nodes],
        ),
        _table("double", "twin_power_shares", "TWIN_NODES", [_number(v) for v in power]),
        _table("double", "twin_lags", "TWIN_LAGS][3", [_braced([_number(v) for v in row]) for row in lags]),
        _table("double", "twin_rows", "5][TWIN_NODES", [_braced([_number(v) for v in row]) for row in plan.rows]),
        _table("double", "twin_uneven", "4", [_number(v) for v in plan.uneven]),
        _table("TwinEffect", "twin_effects", "TWIN_EFFECTS", effects or ["{E_none, 0, 0, 0, 0, 0}"]),
        _table("char *const", "twin_columns", "TWIN_OUTPUTS", [_text(name) for name in outputs]),
        _table("int", "twin_digits", "TWIN_OUTPUTS", [str(n) for n in digits]),
        *(_coefficients(name, one) for name, one in splines.items() if one is not None),
        *(f"const TwinSpline twin_{name} = {_head(name, splines[name])};" for name in ("law", "heat_capacity", "loss")),
        f"const TwinSpline twin_wave[2] = {{{_head('wave_0', splines['wave_0'])}, {_head('wave_1', splines['wave_1'])}}};",
        "",
    ]
    return "\n".join(parts)


def exposed(plan: Plan, key: str) -> str:
    """Return the name of a parameter that may be changed; "" of one that is no key of the card, or does not act."""
    value = plan.parameters[key]
    fixed = ("loss.",) * ("loss" in plan.splines) + ("thermal.",) * (plan.instrument.polynomial is not None)
    undated = all(one.since is None for one in plan.effects)
    idle = key.startswith(fixed) or key == PRECESSION or (key == START and undated)  # a command; no date to count from
    return "" if key.startswith(".") or value != value or idle else key


def _limits(plan: Plan, key: str) -> str:
    low, high = plan.limits.get(exposed(plan, key), (-math.inf, math.inf))
    return _braced([_number(max(low, -1e300)), _number(min(high, 1e300))])


def _coefficients(name: str, spline: "CubicSpline") -> str:
    values = [_number(v) for v in spline.c.ravel()]
    return _table("double", f"of_{name}", str(len(values)), values, static=True)


def _head(name: str, spline: "CubicSpline | None") -> str:
    if spline is None:
        return "{0, 1, 0, 0}"
    first, count = spline.x[0], len(spline.x) - 1
    return f"{{{_number(first)}, {_number((spline.x[-1] - first) / count)}, {count}, of_{name}}}"


def _table(kind: str, name: str, size: str, values: Sequence[str], static: bool = False) -> str:
    return f"{'static ' if static else ''}const {kind} {name}[{size}] = {_braced(values)};"


def _braced(values: Sequence[str]) -> str:
    rows = [", ".join(values[k : k + 6]) for k in range(0, len(values), 6)]
    return "{" + ",\n    ".join(rows) + "}"


def _number(value: float) -> str:
    """Spell a number with all its digits; a whole one as a floating one."""
    if not math.isfinite(value):
        return "0.0"
    return repr(float(np.float64(value)))


def _text(words: str) -> str:
    """Spell a C string: every byte that could end or change it as three octal digits."""
    return (
        '"' + "".join(chr(b) if 32 <= b < 127 and chr(b) not in '"\\?%' else f"\\{b:03o}" for b in words.encode()) + '"'
    )
