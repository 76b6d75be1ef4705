"""The shell-mode solver against published and independent three-dimensional frequencies."""

import csv
from functools import cache
from math import pi, sqrt
from pathlib import Path

import numpy as np
import pytest

from shell.elastic import Elastic
from shell.meridian import cylinder, hemisphere
from shell.modes import Mode, solve_modes
from shell.resonator import Resonator, Stem
from tests.shell.samples import SILICA

REFERENCE = Path(__file__).parents[1] / "reference"
STEEL = Elastic(190e9, 0.3, 8000.0)
UNIT = Elastic(1.0, 0.3, 1.0)


def rows(name: str) -> list[dict[str, str]]:
    lines = (REFERENCE / name).read_text().splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def case(name: str, thickness: float) -> tuple[Resonator, Elastic]:
    if name.startswith("closed sphere"):
        return hemisphere(15e-3, thickness, rim_angle=pi), SILICA
    if name == "free hemisphere":
        return hemisphere(15e-3, thickness), SILICA
    if name == "stem":
        return hemisphere(15e-3, thickness, support="stem", stem=Stem(2.5e-3, -5e-3)), SILICA
    return cylinder(12.5e-3, thickness, 18e-3, bottom_thickness=1e-3, clamp_radius=3e-3), STEEL


@pytest.mark.parametrize(
    "row", rows("reference_frequencies.csv"), ids=lambda row: f"{row['case']} n={row['harmonic']} {row['mode']}"
)
def test_solid_frequencies_of_two_spectral_codes(row: dict[str, str]) -> None:
    resonator, elastic = case(row["case"], float(row["thickness_mm"]) * 1e-3)
    corner = row["case"] in ("stem", "cylinder")
    # rows with a sharp re-entrant corner converge algebraically: 1e-6 here, to keep the suite short
    tolerance, allowed = (1e-6, 1e-6) if corner else (1e-7, 1e-7)
    for n in (int(k) for k in row["harmonic"].split(",")):
        index = {"lowest": 0, "1": 0, "2": 1, "torsion": 0, "axial": 1}[row["mode"]]
        if row["case"] == "closed sphere l=3":
            index = 1 if n < 3 else 0  # l = 2 lies below for n <= 2
        mode = solve_modes(resonator, elastic, n, index + 1, tolerance=tolerance)[index]
        assert mode.frequency == pytest.approx(float(row["frequency_Hz"]), rel=max(allowed, float(row["uncertainty"])))
        if n == 0 and corner:
            assert mode.label == row["mode"]


@pytest.mark.parametrize(("thickness", "within"), [(0.9e-3, 2e-4), (0.15e-3, 2.5e-5)])
def test_shell_theory_is_close_to_the_solid(thickness: float, within: float) -> None:
    references = {0.9e-3: 4596.3915, 0.15e-3: 823.47643}
    (mode,) = solve_modes(hemisphere(15e-3, thickness), SILICA, theory="shell")
    assert mode.frequency == pytest.approx(references[thickness], rel=within)
    (stemmed,) = solve_modes(case("stem", 0.9e-3)[0], SILICA, theory="shell")
    assert stemmed.frequency == pytest.approx(4626.5922, rel=2e-4)


@pytest.mark.parametrize("harmonic", [2, 3])
@pytest.mark.parametrize("name", ["free hemisphere", "stem", "cylinder"])
def test_default_setting_is_within_1e_5(name: str, harmonic: int) -> None:
    thickness = "0.6" if name == "cylinder" else "0.9"
    (row,) = (
        row
        for row in rows("reference_frequencies.csv")
        if (row["case"], row["harmonic"], row["thickness_mm"]) == (name, str(harmonic), thickness)
    )
    (mode,) = solve_modes(*case(name, float(thickness) * 1e-3), harmonic)
    assert mode.frequency == pytest.approx(float(row["frequency_Hz"]), rel=1e-5)


@cache
def tube_modes(n: int) -> tuple[Mode, ...]:
    return solve_modes(cylinder(1.0, 0.2, 2.0), UNIT, n, 6, tolerance=1e-6)


def published(source: str) -> list[object]:
    return [
        pytest.param(row, id=f"{row['case']} n={row['n']} {row['mode']}")
        for row in rows("shell_published.csv")
        if row["source"] in source.split(",")
    ]


@pytest.mark.parametrize("row", published("Gladwell-Vijay,Ladefoged,exact"))
def test_thick_free_cylinder(row: dict[str, str]) -> None:
    """Gladwell & Vijay print ω R √(ρ/G), Ladefoged ω R √(ρ (1 - ν²)/E); both to four digits."""
    scale = sqrt((1 - UNIT.nu**2) / UNIT.E) if row["source"] == "Ladefoged" else sqrt(1 / UNIT.G)
    kind, _, number = row["mode"].rpartition(" ")
    alike = [mode for mode in tube_modes(int(row["n"])) if tube_symmetry(mode) == kind]
    found = 2 * pi * alike[int(number) - 1].frequency * scale
    assert found == pytest.approx(float(row["reference"]), rel=1e-5)
    assert found == pytest.approx(float(row["published"]), rel=1e-3)


def tube_symmetry(mode: Mode) -> str:
    """Symmetry of the radial displacement about the middle of the tube; torsion is named as such."""
    if mode.label == "torsion":
        return "torsion"
    z, u = (np.concatenate([getattr(patch, name).ravel() for patch in mode.shape(5)]) for name in ("z", "u_r"))
    return "symmetric" if u[z < 0.1].mean() * u[z > 1.9].mean() > 0 else "antisymmetric"


@pytest.mark.parametrize("row", published("SDLS07"))
def test_closed_thin_sphere(row: dict[str, str]) -> None:
    mode = solve_modes(hemisphere(2.5, 0.1, rim_angle=pi), Elastic(2e11, 0.3, 7800.0), int(row["n"]), tolerance=1e-6)[0]
    assert mode.frequency == pytest.approx(float(row["reference"]), rel=1e-6)
    assert mode.frequency == pytest.approx(float(row["published"]), rel=6e-3)  # thin-shell theory


@pytest.mark.parametrize("row", published("Qu"))
def test_hemispherical_zone(row: dict[str, str]) -> None:
    """Qu's zone between π/8 and π/2.

    The reference of the clamped rows is not converged at the singular corners of the clamp: it lies up to 5e-4 above
    this solver and above the finite elements of `test_clamped_zone_by_finite_elements`.
    """
    support = {"zone F-F": "free", "zone F-C": "clamped-rim", "zone C-F": "clamped-pole"}[row["case"]]
    zone = hemisphere(1.0, 0.05, pole_angle=pi / 8, support=support)  # type: ignore[arg-type]
    mode = solve_modes(zone, UNIT, int(row["n"]), tolerance=1e-6)[0]
    found = 2 * pi * mode.frequency * sqrt(1 - UNIT.nu**2)
    free = row["case"] == "zone F-F" or row["mode"].startswith("torsion")
    assert found == pytest.approx(float(row["reference"]), rel=1e-5 if free else 5e-4)
    assert found == pytest.approx(float(row["published"]), rel=1.5e-3)


@pytest.mark.slow
def test_clamped_zone_by_finite_elements() -> None:
    """The clamped zone by scikit-fem, in spherical components: an upper bound that comes within 1e-4."""
    zone = hemisphere(1.0, 0.05, pole_angle=pi / 8, support="clamped-pole")
    (mode,) = solve_modes(zone, UNIT, 2, tolerance=1e-6)
    bound = clamped_zone(2, pi / 8, pi / 2, 0.05, UNIT.nu)
    assert 0 < bound / (2 * pi * mode.frequency) - 1 < 1.2e-4


def clamped_zone(n: int, first: float, last: float, h: float, nu: float) -> float:
    """Lowest ω of a spherical zone of radius 1 and E = ρ = 1, clamped at its first edge, by cubic elements graded towards the clamp."""
    from scipy.sparse.linalg import eigsh
    from skfem import Basis, BilinearForm, ElementQuadP, ElementVector, MeshQuad

    graded = np.array([0.0, 0.18**2, 0.18, 1.0])
    through = np.concatenate([graded - 1, (1 - graded)[::-1][1:]]) * h / 2
    along = np.concatenate(
        [first + graded * 2 * h, np.linspace(first + 2 * h, last - 2 * h, 7)[1:], [last - h / 2, last]]
    )
    basis = Basis(MeshQuad.init_tensor(along, 1 + through), ElementVector(ElementQuadP(3), 3), intorder=10)
    lam, G = nu / ((1 + nu) * (1 - 2 * nu)), 1 / (2 * (1 + nu))

    def strain(u, w):  # type: ignore[no-untyped-def]
        phi, r = w.x
        sine, cot, d = np.sin(phi), 1 / np.tan(phi), u.grad
        return (
            d[0][1],
            (d[1][0] + u[0]) / r,
            (n * u[2] / sine + u[1] * cot + u[0]) / r,
            (d[0][0] - u[1]) / r + d[1][1],
            d[2][1] - u[2] / r - n * u[0] / (r * sine),
            d[2][0] / r - u[2] * cot / r - n * u[1] / (r * sine),
        )

    @BilinearForm  # type: ignore[untyped-decorator]
    def stiffness(u, v, w):  # type: ignore[no-untyped-def]
        e, t = strain(u, w), strain(v, w)
        energy = (
            lam * sum(e[:3]) * sum(t[:3])
            + 2 * G * sum(e[k] * t[k] for k in range(3))
            + G * sum(e[k] * t[k] for k in range(3, 6))
        )
        return energy * w.x[1] ** 2 * np.sin(w.x[0])

    @BilinearForm  # type: ignore[untyped-decorator]
    def mass(u, v, w):  # type: ignore[no-untyped-def]
        return sum(u[k] * v[k] for k in range(3)) * w.x[1] ** 2 * np.sin(w.x[0])

    K, M = stiffness.assemble(basis), mass.assemble(basis)
    free = basis.complement_dofs(basis.get_dofs(lambda x: np.isclose(x[0], first)))
    found = eigsh(K[free][:, free].tocsc(), 1, M[free][:, free].tocsc(), sigma=1e-4, return_eigenvectors=False)
    return float(np.sqrt(found[0]))
