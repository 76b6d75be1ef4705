"""`hrg doctor`: what this environment has and what it lacks."""

from studies.cli.output import Answer, answers

OPTIONAL = (
    # package, extra of pyproject.toml, what it brings
    ("distributed", "cluster", "for studies on several machines"),
    ("openpyxl", "excel", "to import spreadsheets"),
)


@answers("hrg.doctor/1")
def doctor() -> Answer:
    """Show versions, OpenGL and the optional parts, with the remedy for what is missing.

    Exit status 3 when pictures cannot be drawn.

    """
    import platform
    import shutil
    from importlib.metadata import PackageNotFoundError, version

    from shell.render import can_draw
    from studies.cli.guard import PACKAGES, package_home
    from studies.cli.output import print_table

    checks = [("Python", True, platform.python_version(), "")]
    for name in (
        "numpy",
        "scipy",
        "sympy",
        "pandas",
        "pyvista",
        "vtk",
        "trimesh",
        "matplotlib",
        "cyclopts",
        "rich",
        "jinja2",
    ):
        try:
            checks.append((name, True, version(name), ""))
        except PackageNotFoundError:
            checks.append((name, False, "missing", f"pip install {name}"))
    checks += [(f"package '{name}'", True, str(package_home(name)), "") for name in PACKAGES]
    drawn, remedy = can_draw()
    checks.append(("OpenGL", drawn, "pictures can be drawn" if drawn else "no pictures", remedy))
    compiler = shutil.which("cc")
    needed = "" if compiler else "needed only to compile code that 'hrg derive' and models emit"
    checks.append(("C compiler", True, compiler or "not found (optional)", needed))
    for name, extra, brings in OPTIONAL:
        try:
            checks.append((name, True, version(name), ""))
        except PackageNotFoundError:
            remedy = f"needed only {brings}: pip install 'hrg-workbench[{extra}]'"
            checks.append((name, True, "not installed (optional)", remedy))
    healthy = all(ok for _, ok, _, _ in checks)
    fields = ("name", "ok", "found", "remedy")
    described = [dict(zip(fields, c, strict=True)) for c in checks]
    yield {"schema": "hrg.doctor/1", "healthy": healthy, "checks": described}, 0 if healthy else 3
    rows = [[name, "ok" if ok else "missing", found, remedy] for name, ok, found, remedy in checks]
    print_table("Environment", ["Part", "State", "Found", "Remedy"], rows)
