"""A twin as an FMU for co-simulation: model description of FMI 2.0 or 3.0, sources, and a binary where there is a compiler."""

import os
import platform
import re
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Literal
from xml.sax.saxutils import quoteattr

from studies.files.writing import written_whole
from studies.models.c_source import one_line
from studies.twin.plan import Plan, idle_input, input_starts, symbol
from studies.twin.source import CORE, FMI, exposed, outputs_of, sources

Version = Literal["2.0", "3.0"]
OUT, USE, IN, PARAMETER = 100, 199, 200, 1000  # value references, as fmi.c has them
COMPILED = (*CORE, "card.c", "fmi.c")
OPTIONS = ("-std=c11", "-O2")
BINARIES = {"2.0": "linux64", "3.0": "x86_64-linux"}
BASE = {
    # units that other tools convert: exponents of the SI base units, factor, offset
    "°C": 'K="1" offset="273.15"',
    "K": 'K="1"',
    "K/s": 'K="1" s="-1"',
    "s": 's="1"',
    "Hz": 's="-1"',
    "V": 'kg="1" m="2" s="-3" A="-1"',
    "°": 'rad="1" factor="0.017453292519943295"',
    "°/s": 'rad="1" s="-1" factor="0.017453292519943295"',
    "°/h": 'rad="1" s="-1" factor="4.84813681109536e-06"',
    "W/K": 'kg="1" m="2" s="-3" K="-1"',
    "J/K": 'kg="1" m="2" s="-2" K="-1"',
    "1": "",
}
DATE = (1980, 1, 1, 0, 0, 0)


def compiler() -> str | None:
    """Return the C compiler: that of the variable CC, else cc or gcc; None where there is none."""
    return next((found for name in (os.environ.get("CC"), "cc", "gcc") if name and (found := shutil.which(name))), None)


def write_fmu(plan: Plan, path: str | Path, version: Version) -> bool:
    """Write an FMU, whole or not at all, and return whether it holds a binary beside its sources."""
    texts = sources(plan, FMI)
    name = "hrg_" + re.sub(r"\W", "_", plan.instrument.name, flags=re.ASCII)
    found = re.search(r'TWIN_TOKEN "(\w+)"', texts["card.h"])
    assert found is not None
    texts["fmi.c"] = f"#ifndef TWIN_FMI\n#define TWIN_FMI {version[0]}\n#endif\n{texts['fmi.c']}"
    binary = _compile(texts)
    members: dict[str, str | bytes] = {"modelDescription.xml": describe(plan, version, name, found[1])}
    members |= {f"sources/{one}": text for one, text in texts.items()}
    if version == "3.0":
        members["sources/buildDescription.xml"] = _build_description(name)
    if binary is not None:
        members[f"binaries/{BINARIES[version]}/{name}.so"] = binary
    with written_whole(path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for one, content in members.items():
            archive.writestr(zipfile.ZipInfo(one, DATE), content, zipfile.ZIP_DEFLATED)
    return binary is not None


def _compile(texts: Mapping[str, str]) -> bytes | None:
    """Compile the shared library; None without a compiler for 64-bit Linux."""
    cc = compiler()
    if cc is None or platform.system() != "Linux" or platform.machine() not in ("x86_64", "AMD64"):
        return None
    with tempfile.TemporaryDirectory() as folder:
        for name, text in texts.items():
            Path(folder, name).write_text(text, encoding="utf-8")
        words = [cc, *OPTIONS, "-fPIC", "-shared", "-fvisibility=hidden", "-s", *COMPILED, "-lm", "-o", "twin.so"]
        done = subprocess.run(words, cwd=folder, capture_output=True, check=False)
        return Path(folder, "twin.so").read_bytes() if done.returncode == 0 else None


def describe(plan: Plan, version: Version, name: str, token: str) -> str:
    """Return modelDescription.xml."""
    rows = list(_variables(plan))
    units = dict.fromkeys(unit for *_, unit, _ in rows)
    outputs = [ref for ref, _, causality, *_ in rows if causality == "output"]
    title = one_line(plan.instrument.name)
    about = f"{title}: heat path, frequency, zero-rate output and 1/Q; the gyro settles at the temperature it has at the start"
    common = f'fmiVersion="{version}" modelName={quoteattr(title)} description={quoteattr(about)}'
    common += ' generationTool="hrg"'
    able = 'canHandleVariableCommunicationStepSize="true"'
    bases = [
        f"    <Unit name={quoteattr(u)}>" + (f"<BaseUnit {BASE[u]}/>" if u in BASE else "") + "</Unit>" for u in units
    ]
    head = ['<?xml version="1.0" encoding="UTF-8"?>']
    if version == "2.0":
        files = "".join(f'<File name="{one}"/>' for one in COMPILED)
        head += [
            f'<fmiModelDescription {common} guid="{token}" variableNamingConvention="flat">',
            f'  <CoSimulation modelIdentifier="{name}" {able} canInterpolateInputs="true"'
            ' canGetAndSetFMUstate="true" canSerializeFMUstate="true">',
            f"    <SourceFiles>{files}</SourceFiles>",
            "  </CoSimulation>",
        ]
    else:
        head += [
            f'<fmiModelDescription {common} instantiationToken="{token}" variableNamingConvention="flat">',
            f'  <CoSimulation modelIdentifier="{name}" {able} canGetAndSetFMUState="true" canSerializeFMUState="true"/>',
        ]
    lines = [*head, "  <UnitDefinitions>", *bases, "  </UnitDefinitions>"]
    lines += [
        '  <LogCategories><Category name="logStatusError"/></LogCategories>',
        '  <DefaultExperiment stepSize="1"/>',
    ]
    if version == "2.0":
        places = [str(k) for k, row in enumerate(_all(rows, version), 1) if row[2] == "output"]
        unknowns = "".join(f'<Unknown index="{k}"/>' for k in places)
        structure = f"<Outputs>{unknowns}</Outputs><InitialUnknowns>{unknowns}</InitialUnknowns>"
    else:
        structure = "".join(
            f'<{kind} valueReference="{ref}"/>' for kind in ("Output", "InitialUnknown") for ref in outputs
        )
    lines += [
        "  <ModelVariables>",
        *(_variable(row, version, plan.limits.get(row[1])) for row in _all(rows, version)),
        "  </ModelVariables>",
    ]
    return "\n".join([*lines, f"  <ModelStructure>{structure}</ModelStructure>", "</fmiModelDescription>", ""])


Row = tuple[int, str, str, str, float | None]


def _variables(plan: Plan) -> Iterator[Row]:
    """Yield the real variables: reference, name, causality, unit, value at the start."""
    for k, name in enumerate(outputs_of(plan)):
        yield OUT + k, name, "output", symbol(name), None
    if plan.instrument.loop is not None:
        yield USE, "actuator_use", "output", "1", None
    for k, (name, start) in enumerate(input_starts(plan).items()):
        if name != idle_input(plan):
            yield IN + k, name_of_input(plan, name), "input", symbol(name), start
    for k, (key, value) in enumerate(plan.parameters.items()):
        if exposed(plan, key):
            yield PARAMETER + k, key, "parameter", symbol(key), value


def name_of_input(plan: Plan, name: str) -> str:
    """Return the name of an input as the FMU has it: that of a housing is an output too."""
    taken = name in outputs_of(plan)
    assert not taken or plan.boundary == "housing"
    return f"imposed_{name}" if taken else name


def _all(rows: list[Row], version: Version) -> list[Row]:
    """Return the real variables and the two others; FMI 3.0 has the time besides."""
    more: list[Row] = [(2, "seed", "integer", "", 0.0), (3, "noise", "boolean", "", 1.0)]
    return [*([(0, "time", "independent", "s", None)] if version == "3.0" else []), *more, *rows]


def _variable(row: Row, version: Version, limits: tuple[float, float] | None) -> str:
    """Return the element of one variable."""
    reference, name, causality, unit, start = row
    kind = {"integer": ("Integer", "Int32"), "boolean": ("Boolean", "Boolean")}.get(causality, ("Real", "Float64"))[
        version == "3.0"
    ]
    fixed = causality in ("integer", "boolean", "parameter")
    role = "parameter" if fixed else causality
    variability = "fixed" if fixed else "continuous"
    written = {"boolean": "true" if start else "false", "integer": f"{start or 0:.0f}"}.get(causality, repr(start))
    value = "" if start is None else f' start="{written}"'
    typed = f" unit={quoteattr(unit)}" if unit and not (fixed and causality != "parameter") else ""
    ends = zip(("min", "max"), limits or (), strict=False) if causality == "parameter" else ()
    typed += "".join(f' {word}="{end!r}"' for word, end in ends if abs(end) < float("inf"))
    common = f'name={quoteattr(name)} valueReference="{reference}" causality="{role}" variability="{variability}"'
    if version == "3.0":
        return f"    <{kind} {common}{typed}{value}/>"
    exact = ' initial="exact"' if fixed else ' initial="calculated"' if causality == "output" else ""
    return f"    <ScalarVariable {common}{exact}><{kind}{typed}{value}/></ScalarVariable>"


def _build_description(name: str) -> str:
    files = "".join(f'<SourceFile name="{one}"/>' for one in COMPILED)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<fmiBuildDescription fmiVersion="3.0">\n'
        f'  <BuildConfiguration modelIdentifier="{name}"><SourceFileSet language="C11">{files}</SourceFileSet></BuildConfiguration>\n'
        "</fmiBuildDescription>\n"
    )
