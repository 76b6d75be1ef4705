"""One free hemisphere by this solver's three theories and by peers, side by side; run by hand.

    OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 python tests/benchmarks/bench_solver.py

15 x 0.9 mm, E = 72.7 GPa, ν = 0.17, ρ = 2203 kg/m³; three-dimensional elasticity: 4596.3915 Hz (two independent Fourier
spectral codes and an hp finite-element code, to 3e-8). In a three-dimensional mesh the two n = 2 modes, which are one pair
on a body of revolution, split: that split is the mesh's own. A peer that is not installed is left out with the reason.
The peers solve one coarse and one finer mesh of second or third order; the time is mesh, assembly and modes together.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import shell.corner
import shell.root
import shell.surplus
from shell.assembly import build_system
from shell.elastic import Elastic
from shell.meridian import hemisphere
from shell.modes import solve_modes

R, H = 15e-3, 0.9e-3
GLASS = Elastic(72.7e9, 0.17, 2203.0)
EXACT = 4596.3915
SHIFT = (2 * np.pi * 3500.0) ** 2  # between the rigid motions and the pair


def forget():
    """Empty every cache that depends on the geometry."""
    for cached in (build_system, shell.surplus.extend, shell.root._find_frame, shell.corner._meet):
        cached.cache_clear()


def best_time(work, repeats):
    """Return the shortest time in s and the last result."""
    shortest = np.inf
    for _ in range(repeats):
        began = time.perf_counter()
        result = work()
        shortest = min(shortest, time.perf_counter() - began)
    return shortest, result


def ours():
    """Yield (name, s, unknowns, frequencies) of the three theories, operators cached and not."""
    dome = hemisphere(R, H)
    for name, theory, tolerance in (
        ("rayleigh", "rayleigh", 1e-5),
        ("shell (tolerance 1e-3)", "shell", 1e-3),
        ("solid (tolerance 1e-4)", "solid", 1e-4),
        ("solid (tolerance 1e-5)", "solid", 1e-5),
        ("solid (tolerance 1e-7)", "solid", 1e-7),
    ):

        def solve(theory=theory, tolerance=tolerance):
            return solve_modes(dome, GLASS, theory=theory, tolerance=tolerance)[0]

        solve()
        cached, mode = best_time(solve, 7)
        size = mode.solution.vector.size if mode.solution else 0
        yield f"ours {name}, cached", cached, size, [mode.frequency]
        if theory != "rayleigh":

            def cold(solve=solve):
                forget()
                return solve()

            yield f"ours {name}, cold", best_time(cold, 3)[0], size, [mode.frequency]


def dome_hexahedra(cells, layers=1):
    """Return a mesh of 27-node hexahedra: a half cube shell blown up to the dome, with the cube's fourfold symmetry."""
    from skfem import MeshHex1, MeshHex2

    ticks, radial = np.linspace(-1, 1, cells + 1), 1 + np.linspace(-0.5, 0.5, layers + 1) * H / R
    corners, numbers, hexahedra = [], {}, []

    def number(point):
        key = tuple(np.round(np.array(point) * 1e9).astype(np.int64))
        if key not in numbers:
            numbers[key] = len(corners)
            corners.append(point)
        return numbers[key]

    faces = [((1, 0, 0), (0, 1, 0), (0, 0, 1), ticks)]
    upper = ticks[ticks >= -1e-12]
    faces += [
        (along, (0, 0, 1), out, upper)
        for along, out in (
            ((0, 1, 0), (1, 0, 0)),
            ((0, -1, 0), (-1, 0, 0)),
            ((-1, 0, 0), (0, 1, 0)),
            ((1, 0, 0), (0, -1, 0)),
        )
    ]
    for a, b, c, second in faces:
        a, b, c = (np.array(x, dtype=float) for x in (a, b, c))
        for i in range(cells):
            for j in range(len(second) - 1):
                for k in range(layers):
                    hexahedra.append(
                        [
                            number(t * (x * a + y * b + c))
                            for t in radial[k : k + 2]
                            for x, y in (
                                (ticks[i], second[j]),
                                (ticks[i + 1], second[j]),
                                (ticks[i + 1], second[j + 1]),
                                (ticks[i], second[j + 1]),
                            )
                        ]
                    )
    # the local order of MeshHex is (x, y, z) = 000, 001, 010, 100, 011, 101, 110, 111 of the unit cube
    order = [0, 4, 3, 1, 7, 5, 2, 6]
    mesh = MeshHex2.from_mesh(MeshHex1(np.array(corners).T, np.array(hexahedra).T[order]))
    cube = mesh.doflocs
    size = np.max(abs(cube), axis=0)
    direction = np.tan(np.pi / 4 * cube / size)
    return type(mesh)(R * size * direction / np.linalg.norm(direction, axis=0), mesh.t)


def by_scikit_fem(cells):
    """Unknowns and the lowest two elastic frequencies by quadratic hexahedra."""
    from scipy.sparse.linalg import eigsh
    from skfem import Basis, BilinearForm, ElementHex2, ElementVector
    from skfem.helpers import ddot, dot, eye, sym_grad, trace

    mesh = dome_hexahedra(cells)
    basis = Basis(mesh, ElementVector(ElementHex2()), intorder=5)
    lam = GLASS.E * GLASS.nu / (1 + GLASS.nu) / (1 - 2 * GLASS.nu)

    @BilinearForm
    def stiffness(u, v, _):
        strain = sym_grad(u)
        return ddot(2 * GLASS.G * strain + lam * eye(trace(strain), 3), sym_grad(v))

    @BilinearForm
    def mass(u, v, _):
        return GLASS.rho * dot(u, v)

    K, M = stiffness.assemble(basis), mass.assemble(basis)
    values = eigsh(K, 2, M, sigma=SHIFT, which="LM", return_eigenvectors=False)
    return basis.N, np.sqrt(np.sort(values)) / (2 * np.pi)


def by_calculix(cells):
    """The same mesh with 20-node bricks (C3D20)."""
    from skfem import Basis, ElementHex2

    mesh = dome_hexahedra(cells)
    basis = Basis(mesh, ElementHex2())
    here = [tuple(x) for x in ElementHex2().doflocs]
    ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
    halves = [(0.5, 0), (1, 0.5), (0.5, 1), (0, 0.5)]
    wanted = (
        [(*p, z) for z in (0, 1) for p in ring] + [(*p, z) for z in (0, 1) for p in halves] + [(*p, 0.5) for p in ring]
    )
    bricks = basis.element_dofs[[here.index(tuple(float(v) for v in p)) for p in wanted]].T
    points = basis.doflocs
    edges = [points[:, bricks[0, k]] - points[:, bricks[0, 0]] for k in (1, 3, 4)]
    if np.linalg.det(np.array(edges)) < 0:  # turn the brick over
        bricks = bricks[:, [4, 5, 6, 7, 0, 1, 2, 3, 12, 13, 14, 15, 8, 9, 10, 11, 16, 17, 18, 19]]
    used = np.unique(bricks)
    deck = [
        "*NODE, NSET=ALL",
        *(f"{k + 1}, " + ", ".join(f"{x:.12e}" for x in points[:, k]) for k in used),
        "*ELEMENT, TYPE=C3D20, ELSET=DOME",
    ]
    for k, brick in enumerate(bricks + 1, 1):
        deck += [f"{k}, " + ", ".join(map(str, brick[:10])) + ",", ", ".join(map(str, brick[10:]))]
    deck += [
        "*MATERIAL, NAME=GLASS",
        "*ELASTIC",
        f"{GLASS.E}, {GLASS.nu}",
        "*DENSITY",
        f"{GLASS.rho}",
        "*SOLID SECTION, ELSET=DOME, MATERIAL=GLASS",
        "*STEP",
        "*FREQUENCY",
        "10",
        "*END STEP",
    ]
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "dome.inp").write_text("\n".join(deck) + "\n")
        done = subprocess.run(["ccx", "dome"], cwd=folder, capture_output=True, text=True, timeout=300, check=False)
        lines = Path(folder, "dome.dat").read_text() if Path(folder, "dome.dat").exists() else ""
    rows = re.findall(r"^\s+\d+\s+\S+\s+\S+\s+([\d.E+-]+)\s+\S+\s*$", lines, re.MULTILINE)
    elastic = [float(f) for f in rows if float(f) > 1000]
    if len(elastic) < 2:
        raise RuntimeError(f"ccx gave no modes: {done.stdout[-300:]} {done.stderr[-300:]}")
    return 3 * len(used), np.array(elastic[:2])


def by_ngsolve(size):
    """Curved tetrahedra of third order of about `size` metres."""
    import ngsolve as ng
    from netgen import occ
    from scipy.sparse import csr_matrix
    from scipy.sparse.linalg import LinearOperator, eigsh

    dome = occ.Sphere(occ.Pnt(0, 0, 0), R + H / 2) - occ.Sphere(occ.Pnt(0, 0, 0), R - H / 2)
    dome = dome * occ.Box(occ.Pnt(-2 * R, -2 * R, 0), occ.Pnt(2 * R, 2 * R, 2 * R))
    mesh = ng.Mesh(occ.OCCGeometry(dome).GenerateMesh(maxh=size))
    mesh.Curve(3)
    space = ng.VectorH1(mesh, order=3)
    u, v = space.TnT()
    lam = GLASS.E * GLASS.nu / (1 + GLASS.nu) / (1 - 2 * GLASS.nu)

    def strain(w):
        return 0.5 * (ng.Grad(w) + ng.Grad(w).trans)

    elastic = 2 * GLASS.G * ng.InnerProduct(strain(u), strain(v)) + lam * ng.div(u) * ng.div(v)
    forms = []
    for integrand in (elastic, GLASS.rho * u * v, elastic - SHIFT * GLASS.rho * u * v):
        forms.append(ng.BilinearForm(space))
        forms[-1] += integrand * ng.dx
        forms[-1].Assemble()
    K, M = (csr_matrix((values, (i, j)), shape=(space.ndof,) * 2) for i, j, values in (f.mat.COO() for f in forms[:2]))
    inverse = forms[2].mat.Inverse(inverse="sparsecholesky")
    load, answer = forms[2].mat.CreateColVector(), forms[2].mat.CreateColVector()

    def solve(x):
        load.FV().NumPy()[:] = x.ravel()
        answer.data = inverse * load
        return answer.FV().NumPy().copy()

    operator = LinearOperator(K.shape, matvec=solve, dtype=float)
    values = eigsh(K, 2, M, sigma=SHIFT, OPinv=operator, which="LM", return_eigenvectors=False)
    return space.ndof, np.sqrt(np.sort(values)) / (2 * np.pi)


PEERS = (
    ("scikit-fem, 27-node bricks", "skfem", by_scikit_fem, (8, 12)),
    ("CalculiX, 20-node bricks", "ccx", by_calculix, (8, 14)),
    ("NGSolve, tetrahedra of order 3", "ngsolve", by_ngsolve, (3e-3, 1.8e-3)),
)


def missing(needs):
    """Return why a peer cannot run, or ''."""
    if needs == "ccx":
        return (
            ""
            if shutil.which("ccx") and importable("skfem")
            else "not on the path (Debian: apt install calculix-ccx; needs scikit-fem for the mesh)"
        )
    return "" if importable(needs) else f"not installed (pip install {needs.replace('skfem', 'scikit-fem')})"


def importable(name):
    """Whether a module is installed."""
    from importlib.util import find_spec

    return find_spec(name) is not None


def main():
    """Print the table."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    print(f"threads of BLAS: {os.environ.get('OPENBLAS_NUM_THREADS', 'not limited')}; load {os.getloadavg()[0]:.1f}")
    rows = list(ours())
    for name, needs, solve, sizes in PEERS:
        if reason := missing(needs):
            print(f"left out: {name}: {reason}")
            continue
        for size in sizes:
            try:
                seconds, (unknowns, pair) = best_time(lambda solve=solve, size=size: solve(size), 1)
            except Exception as fault:  # a peer's failure is a row of the report, not the end of it
                print(f"left out: {name} ({size:g}): {type(fault).__name__}: {fault}")
                continue
            rows.append((f"{name} ({size:g})", seconds, unknowns, list(pair)))
    unit = next(row[1] for row in rows if row[0] == "ours solid (tolerance 1e-5), cached")
    print(f"\n{'solver':42} {'time':>11} {'ratio':>8} {'unknowns':>9} {'f (Hz)':>12} {'error':>9} {'split':>9}")
    for name, seconds, unknowns, pair in rows:
        mean = sum(pair) / len(pair)
        split = f"{(pair[-1] - pair[0]) / mean * 1e6:.3g} ppm" if len(pair) > 1 else "none"
        print(
            f"{name:42} {1e3 * seconds:8.2f} ms {seconds / unit:8.2f} {unknowns:9d} {mean:12.4f} {mean / EXACT - 1:9.1e} {split:>9}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
