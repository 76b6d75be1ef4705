"""Contract of the house: no imports run in a circle, heavy packages stay away; that the physics knows only itself is import-linter's."""

import ast
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LAZY = {"pyvista", "trimesh", "matplotlib", "dask", "distributed", "vtk"}


def modules():
    """Return module name -> path of every file of the four packages."""
    found = {}
    for package in ("shell", "thermal", "compensation", "studies"):
        for path in (ROOT / package).rglob("*.py"):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = modules()


@cache
def parsed(path):
    return ast.parse(path.read_text(encoding="utf-8"))


def statements(node):
    """All statements within a node, expressions apart."""
    for name in ("body", "orelse", "handlers", "finalbody", "cases"):
        for one in getattr(node, name, ()):
            yield one
            yield from statements(one)


@cache
def imports(path, *, top_only=False):
    """Return the modules that a file imports, anywhere in it or at its top level, each as deep as it is a file."""
    nodes = parsed(path).body if top_only else statements(parsed(path))
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


@pytest.mark.slow
def test_no_imports_run_in_a_circle():
    """Also those that only the type checker follows; `TopologicalSorter` raises CycleError with the circle."""
    graph = {name: {i for i in imports(path) if i in MODULES and i != name} for name, path in MODULES.items()}
    order = list(TopologicalSorter(graph).static_order())
    assert len(order) == len(MODULES)


@pytest.mark.slow
def test_heavy_packages_are_imported_where_they_are_needed():
    for name, path in MODULES.items():
        lazy = LAZY if name.split(".")[1:2] == ["derivation"] else LAZY | {"sympy"}
        if not name.startswith("studies.examples"):
            assert not {i.split(".")[0] for i in imports(path, top_only=True)} & lazy, name
