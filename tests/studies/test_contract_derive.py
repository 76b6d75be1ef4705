"""`hrg derive` speaks as promised, and the code that it prints agrees with quadrature."""

import ctypes
import importlib.util
import json
import re
from math import pi, radians

import numpy as np
import pytest
from scipy.integrate import quad

from studies.cli import main
from tests.compiled import compile_c

pytestmark = pytest.mark.slow  # each derives
CASES = [(2, 0.0, 90.0), (3, 12.5, 77.0), (7, 0.0, 20.0)]


def speak(capsys, *words):
    status = main(["derive", *words])
    return status, capsys.readouterr()


def options(n, start, end):
    return ["--harmonic", str(n), "--pole-angle-deg", str(start), "--rim-angle-deg", str(end)]


def frequency_by_quadrature(n, start, end, E, nu, rho, h, R):
    """HRG paper eq. (13), its integrals written anew in x = sin²(φ/2)."""
    lower, upper = (np.sin(radians(angle) / 2) ** 2 for angle in (start, end))

    def tangent_power(x):
        return (x / (1 - x)) ** n

    def bending(x):
        return tangent_power(x) / (8 * (x * (1 - x)) ** 2)

    def mass(x):
        return 2 * ((n + 1 - 2 * x) ** 2 + 8 * x * (1 - x)) * tangent_power(x)

    I, J = (quad(f, lower, upper, epsabs=0, epsrel=1e-12)[0] for f in (bending, mass))
    return n * (n**2 - 1) * h / R**2 * np.sqrt(E * I / (3 * (1 + nu) * rho * J)) / (2 * pi)


def random_shells(seed, count=20):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield {
            "E": rng.uniform(1e9, 3e11),
            "nu": rng.uniform(-0.5, 0.49),
            "rho": rng.uniform(1e3, 2e4),
            "h": rng.uniform(1e-5, 1e-2),
            "R": rng.uniform(1e-3, 1.0),
        }


@pytest.mark.parametrize("case", CASES, ids=str)
def test_emitted_code_agrees_with_quadrature(case, tmp_path, capsys):
    """Python, and C where there is a compiler: one derivation for both."""
    status, said = speak(capsys, "--code", "python", *options(*case))
    assert status == 0
    file = tmp_path / "rayleigh_design.py"
    file.write_text(said.out)
    spec = importlib.util.spec_from_file_location("rayleigh_design", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for shell in random_shells(seed=4):
        assert module.rayleigh_frequency(**shell) == pytest.approx(frequency_by_quadrature(*case, **shell), rel=1e-11)
    check_derivatives(case, module.rayleigh_log_derivatives(0.2))
    check_temperature(case, *module.rayleigh_temperature_coefficient(0.2, *SLOPES))
    check_bryan_factor(case, module.rayleigh_bryan_factor())
    status, said = speak(capsys, "--code", "c", *options(*case))
    assert status == 0
    compiled = compile_c(said.out, tmp_path)
    for function in (compiled.rayleigh_frequency, compiled.rayleigh_bryan_factor):
        function.restype = ctypes.c_double
    for shell in random_shells(seed=5):
        value = compiled.rayleigh_frequency(*(ctypes.c_double(shell[name]) for name in ("E", "nu", "rho", "h", "R")))
        assert value == pytest.approx(frequency_by_quadrature(*case, **shell), rel=1e-11)
    derivative = (ctypes.c_double * 6)()
    compiled.rayleigh_log_derivatives(ctypes.c_double(0.2), derivative)
    check_derivatives(case, dict(zip(("E", "nu", "rho", "h", "R", "phi_2"), derivative, strict=True)))
    check_bryan_factor(case, compiled.rayleigh_bryan_factor())
    compiled.rayleigh_temperature_coefficient.restype = ctypes.c_double
    part = (ctypes.c_double * 5)()
    total = compiled.rayleigh_temperature_coefficient(ctypes.c_double(0.2), (ctypes.c_double * 5)(*SLOPES), part)
    check_temperature(case, total, dict(zip(("E", "nu", "rho", "h", "R"), part, strict=True)))


SLOPES = (1.5e-4, 3e-5, -1.5e-6, 5e-7, 5e-7)  # of ln E, ν, ln ρ, ln h, ln R, 1/K


def check_temperature(case, total, parts):
    """Equation (15) against the quadrature at shells one kelvin apart."""
    shell = {"E": 7e10, "nu": 0.2, "rho": 2200.0, "h": 1e-3, "R": 2e-2}

    def log_frequency(kelvin):
        names = ("E", "nu", "rho", "h", "R")
        moved = {
            name: shell[name] + kelvin * slope if name == "nu" else shell[name] * np.exp(kelvin * slope)
            for name, slope in zip(names, SLOPES, strict=True)
        }
        return np.log(frequency_by_quadrature(*case, **moved))

    assert total == pytest.approx(log_frequency(0.5) - log_frequency(-0.5), rel=1e-6)
    assert total == pytest.approx(sum(parts.values()), rel=1e-12)
    assert parts["R"] == pytest.approx(-2 * SLOPES[-1], rel=1e-12)


def check_derivatives(case, derivative):
    """Against central differences of the quadrature."""
    shell = {"E": 7e10, "nu": 0.2, "rho": 2200.0, "h": 1e-3, "R": 2e-2}
    n, start, end = case

    def log_frequency(end=end, **change):
        return np.log(frequency_by_quadrature(n, start, end, **(shell | change)))

    for name in ("E", "rho", "h", "R"):
        up, down = (log_frequency(**{name: shell[name] * (1 + sign * 1e-4)}) for sign in (1, -1))
        assert derivative[name] == pytest.approx((up - down) / 2e-4, abs=1e-7)
    up, down = (log_frequency(nu=0.2 + sign * 1e-4) for sign in (1, -1))
    assert derivative["nu"] == pytest.approx((up - down) / 2e-4, abs=1e-7)
    up, down = (log_frequency(end=end + sign * 0.01) for sign in (1, -1))
    assert derivative["phi_2"] == pytest.approx((up - down) / radians(0.02), rel=1e-5)


def check_bryan_factor(case, value):
    """K = −2 ∫ V (U cos φ + W sin φ) sin φ dφ / (n ∫ (U² + V² + W²) sin φ dφ) of HRG paper eq. (10)."""
    n, start, end = case

    def mode(phi):
        power = np.tan(phi / 2) ** n
        return np.sin(phi) * power, np.sin(phi) * power, -(n + np.cos(phi)) * power

    def coupling(phi):
        U, V, W = mode(phi)
        return -2 * V * (U * np.cos(phi) + W * np.sin(phi)) * np.sin(phi)

    def mass(phi):
        return sum(part**2 for part in mode(phi)) * np.sin(phi)

    above, below = (quad(f, radians(start), radians(end), epsabs=0, epsrel=1e-12)[0] for f in (coupling, mass))
    assert value == pytest.approx(above / (n * below), rel=1e-11)


def test_plain_text_walks_through_the_numbered_equations(capsys):
    status, said = speak(capsys)
    assert status == 0
    numbers = re.findall(r"^\((\d+)\)", said.out, flags=re.MULTILINE)
    assert numbers == [str(k) for k in range(1, 16)]
    assert max(len(line) for line in said.out.splitlines()) <= 120
    assert "↪" not in said.out


def test_latex_fragment_is_balanced_and_tagged(capsys):
    status, said = speak(capsys, "--latex", "--harmonic", "3")
    assert status == 0
    assert said.out.count(r"\begin{gather}") == said.out.count(r"\end{gather}") > 20
    assert all(rf"\tag{{{k}}}" in said.out for k in range(1, 14))
    assert said.out.count("{") == said.out.count("}")
    assert said.out.count(r"\left") == said.out.count(r"\right")
    assert said.out.isascii()


def test_latex_equations_are_typeset_by_an_independent_parser(capsys):
    from matplotlib.mathtext import MathTextParser

    status, said = speak(capsys, "--json")
    assert status == 0
    parser = MathTextParser("path")
    for step in json.loads(said.out)["equations"]:
        for latex in step["latex"]:
            parser.parse("$" + latex.replace(r"\limits", "") + "$")


def test_the_bell_is_derived_beside_its_numbers(capsys):
    status, said = speak(capsys, "--bell", "--json")
    assert status == 0
    payload = json.loads(said.out)
    assert payload["schema"] == "hrg.derive-bell/1"
    assert all(latex.isascii() for step in payload["equations"] for latex in step["latex"])
    numbers = [step["number"] for step in payload["equations"] if step["number"]]
    assert numbers == [
        "1", "2", "3", "4", "5", "6", "7", "7 as printed", "8-10", "11", "12", "13", "13 as printed", "14", "19", "17, 18", "16 as printed", "20",
        "20 as printed", "21", "22",
    ]  # fmt: skip
    rows = {row["name"]: row["frequency"] for row in payload["numbers"]["rows"]}
    solid = payload["numbers"]["solid"]["frequency"]
    assert rows["(19) as printed"] > 100 * solid
    assert 1 < rows["solved from (17), (18)"] / solid < 1.4


@pytest.mark.parametrize(("n", "solid"), [(2, 4596.3915), (3, 11921.2280)], ids=["n = 2", "n = 3"])
def test_code_says_how_far_rayleigh_is_off_for_its_harmonic(n, solid, capsys):
    """Against three-dimensional frequencies of the free dome, 15 x 0.9 mm, from tests/reference/reference_frequencies.csv."""
    assumed = frequency_by_quadrature(n, 0.0, 90.0, E=72.7e9, nu=0.17, rho=2203.0, h=0.9e-3, R=15e-3)
    for language in ("python", "c"):
        said = speak(capsys, "--code", language, "--harmonic", str(n))[1].out
        assert f"lower, by {100 * (1 - solid / assumed):.1f} % at h/R = 0.06" in said


def test_both_languages_agree(tmp_path, capsys):
    space = {}
    exec(speak(capsys, "--dynamics", "--code", "python")[1].out, space)
    compiled = compile_c(speak(capsys, "--dynamics", "--code", "c")[1].out, tmp_path).averaged_rates
    rng = np.random.default_rng(5)
    for _ in range(20):
        values = rng.uniform(0.2, 2.0, 15)
        rates = (ctypes.c_double * 4)()
        compiled(*(ctypes.c_double(value) for value in values), rates)
        assert list(rates) == pytest.approx(list(space["averaged_rates"](*values)), rel=1e-12)


def test_latex_is_plain_ascii(capsys):
    """Letters that pdflatex does not know end the run of the document that reads the fragment."""
    assert speak(capsys, "--dynamics", "--latex")[1].out.isascii()


@pytest.mark.parametrize("form", [["--latex"]])
def test_a_file_holds_what_would_be_printed(form, tmp_path, capsys):
    assert main(["derive", *form]) == 0
    printed = capsys.readouterr().out
    assert main(["derive", *form, "--out", str(tmp_path / "derived")]) == 0
    assert (tmp_path / "derived").read_text(encoding="utf-8") == printed
    assert capsys.readouterr().out.startswith("wrote ")
