"""Contract of the house: `studies` joins three packages that know nothing of each other, and no imports run in a circle."""

import ast
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path
from random import Random

import pytest

ROOT = Path(__file__).parents[1]
PHYSICS = ("shell", "thermal", "compensation")
SHORT = {
    "calibrate": "import studies.calibration.fit as module; module.MOST_STEPS = 1",
    "diagnose": "import studies.inference.diagnosis as module; module.BLOCKS, module.BLOCKS_OF_RUN = 60, (60, 60)",
}
"""What ends a command early: the way that it goes counts here, not how far."""
LAZY = {"pyvista", "trimesh", "matplotlib", "dask", "distributed", "vtk"}


def modules():
    """Return module name -> path of every file of the four packages."""
    found = {}
    for package in (*PHYSICS, "studies"):
        for path in (ROOT / package).rglob("*.py"):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = modules()


@cache
def parsed(path):
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def imports(path, *, top_only=False):
    """Return the modules that a file imports, anywhere in it or at its top level, each as deep as it is a file."""
    tree = parsed(path)
    nodes = tree.body if top_only else ast.walk(tree)
    names = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {
                f"{node.module}.{alias.name}" if f"{node.module}.{alias.name}" in MODULES else node.module
                for alias in node.names
            }
    return names


@pytest.mark.parametrize("package", PHYSICS)
def test_physics_knows_only_itself(package):
    others = {*PHYSICS, "studies"} - {package}
    for name, path in MODULES.items():
        if name.split(".")[0] == package:
            assert not {i for i in imports(path) if i.split(".")[0] in others}, name


@pytest.mark.slow
def test_no_imports_run_in_a_circle():
    """Also those that only the type checker follows; `TopologicalSorter` raises CycleError with the circle."""
    graph = {name: {i for i in imports(path) if i in MODULES and i != name} for name, path in MODULES.items()}
    order = list(TopologicalSorter(graph).static_order())
    assert len(order) == len(MODULES)


def test_heavy_packages_are_imported_where_they_are_needed():
    for name, path in MODULES.items():
        lazy = LAZY if name.split(".")[1:2] == ["derivation"] else LAZY | {"sympy"}
        if not name.startswith("studies.examples"):
            assert not {i.split(".")[0] for i in imports(path, top_only=True)} & lazy, name


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "spared"),
    [
        ("cards", {"scipy", "pandas"}),
        ("modes free-dome", {"scipy.constants", "scipy.optimize", "scipy.signal", "pandas"}),
        ("simulate free-dome run.csv --out out.csv", {"scipy.signal", "scipy.stats", "pandas"}),
        ("calibrate free-dome run.csv", {"scipy.signal", "scipy.stats", "pandas"}),
        ("diagnose run.csv", {"scipy.signal", "scipy.stats", "pandas"}),
    ],
)
def test_a_command_loads_no_package_for_one_number(words, spared, tmp_path):
    """What takes longer to load than all that it does there: 0.1 to 0.5 s of processor time each."""
    noise, warm = Random(1), [10 * (1 - 0.9**k) for k in range(60)]  # plain: nothing to search for
    rows = [f"{60 * k},{20 + x:.4f},{4600 + 0.4 * x + noise.gauss(0, 0.01):.6f}" for k, x in enumerate(warm)]
    (tmp_path / "run.csv").write_text("\n".join(["time_s,housing_temperature_degC,frequency_Hz", *rows]) + "\n")
    run = f"import sys; from studies.cli import main; main({words.split()!r}); print(*sys.modules, file=sys.stderr)"
    run = f"{SHORT.get(words.split()[0], '')}\n{run}"
    ended = subprocess.run([sys.executable, "-c", run], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert not spared & set(ended.stderr.split())
    assert "studies.instrument.card" in ended.stderr or "diagnose" in words
