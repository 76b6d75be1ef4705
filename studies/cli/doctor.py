"""`hrg doctor`: what this environment has and what it lacks."""

import platform
import shutil

from studies.cli.output import answers
from studies.results import Result, Table

NEEDED = ["numpy", "scipy", "sympy", "pandas", "pyvista", "vtk", "trimesh", "matplotlib", "cyclopts", "rich", "jinja2"]
OPTIONAL = (
    # package, extra of pyproject.toml, what it brings
    ("distributed", "cluster", "for studies on several machines"),
    ("openpyxl", "excel", "to import spreadsheets"),
    ("nptdms", "formats", "for TDMS files"),
    ("asammdf", "formats", "for MDF files"),
    ("h5py", "formats", "for HDF5 and MATLAB 7.3 files"),
    ("pyarrow", "formats", "for Parquet files"),
    ("fmpy", "twin", "to run FMUs from Python"),
)


@answers("hrg.doctor/1")
def doctor() -> Result:
    """Show versions, OpenGL and the optional parts, and how to install what is missing.

    Exit status 3 when pictures cannot be drawn.

    """
    from importlib.metadata import PackageNotFoundError, version

    from shell.render import can_draw
    from studies.cli.guard import PACKAGES, package_home

    def installed(name: str, missing: tuple[bool, str, str]) -> tuple[str, bool, str, str]:
        try:
            return name, True, version(name), ""
        except PackageNotFoundError:
            return name, *missing

    checks = [("Python", True, platform.python_version(), "")]
    checks += [installed(name, (False, "missing", f"pip install {name}")) for name in NEEDED]
    checks += [(f"package '{name}'", True, str(package_home(name)), "") for name in PACKAGES]
    drawn, remedy = can_draw()
    checks.append(("OpenGL", drawn, "pictures can be drawn" if drawn else "no pictures", remedy))
    compiler = shutil.which("cc")
    needed = "" if compiler else "needed only to compile code that 'hrg twin', 'hrg derive' and models emit"
    checks.append(("C compiler", True, compiler or "not found (optional)", needed))
    for name, extra, brings in OPTIONAL:
        remedy = f"needed only {brings}: pip install 'hrg-workbench[{extra}]'"
        checks.append(installed(name, (True, "not installed (optional)", remedy)))
    healthy = all(ok for _, ok, _, _ in checks)
    described = [dict(zip(("name", "ok", "found", "remedy"), check, strict=True)) for check in checks]
    rows = [{**check, "state": "ok" if check["ok"] else "missing"} for check in described]
    return Result(
        {"healthy": healthy, "checks": described},
        "Environment",
        "Versions, OpenGL and optional parts.",
        [Table("Environment", rows, "name: part | state | found | remedy")],
        status=0 if healthy else 3,
    )
