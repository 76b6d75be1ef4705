"""Two splits by three-dimensional finite elements (NGSolve, extra `peers`): python tests/benchmarks/split_ngsolve.py [ORDER:SIDE ...].

A quarter of the free hemisphere of 15 mm x 0.9 mm, with its symmetry planes, so that n = 2 is symmetric on both (cos 2θ) or on
neither (sin 2θ). Two imperfections: the wall 1 + 0.02 sin⁴φ cos 4θ times as thick about the same middle surface (the mesh is moved), and
four lumps of mass, ρ (1 + 0.02 Σ exp(30 (cos γ_k - 1))), γ_k the angle from the rim at 0°, 90°, 180°, 270°. The split that the mesh
has by itself is taken off. A row for every order and mesh: the differences fall towards the last.
"""

import sys
import time
from math import pi

import numpy as np
from scipy.special import ive

from shell.elastic import Elastic
from shell.imperfection import CoupledHarmonics, Imperfection, Pair, Waves, find_split, wave
from shell.meridian import hemisphere
from shell.modes import solve_modes

R, H, E, NU, RHO = 15e-3, 0.9e-3, 72.7e9, 0.17, 2203.0
EPSILON = 0.02
STEPS = ((3, 0.2), (3, 0.12), (4, 0.12), (5, 0.12))  # order, largest side of a cell at the rim over R


def mesh_quarter(rim):
    import ngsolve as ng
    from netgen.occ import Box, OCCGeometry, Pnt, Sphere

    ratio = H / R / 2
    dome = (Sphere(Pnt(0, 0, 0), 1 + ratio) - Sphere(Pnt(0, 0, 0), 1 - ratio)) * Box(Pnt(0, 0, 0), Pnt(2, 2, 2))
    for face in dome.faces:
        c = face.center
        face.name = "px" if abs(c.x) < 1e-9 else "py" if abs(c.y) < 1e-9 else "pz" if abs(c.z) < 1e-9 else "wall"
        if face.name == "pz":
            face.maxh = rim
    return ng.Mesh(OCCGeometry(dome).GenerateMesh(maxh=0.3, grading=0.5))


def solve(mesh, order, thicker=0.0, heavier=0.0):
    """Frequencies (Hz) of cos 2θ and sin 2θ, and the number of unknowns."""
    import ngsolve as ng
    import scipy.sparse as sp
    from ngsolve import Grad, InnerProduct, Trace, dx, x, y, z
    from scipy.sparse.linalg import eigsh

    mesh.UnsetDeformation()
    mesh.Curve(order)
    r = ng.sqrt(x * x + y * y + z * z)
    if thicker:
        move = ng.GridFunction(ng.VectorH1(mesh, order=order + 1))
        move.Set(ng.CF((x, y, z)) / r * (r - 1) * thicker * (x**4 - 6 * x * x * y * y + y**4) / r**4)
        mesh.SetDeformation(move)
    rho = 1 + heavier * (ng.exp(30 * (x / r - 1)) + ng.exp(30 * (y / r - 1)))
    mu, lam = 1 / (2 * (1 + NU)), NU / ((1 + NU) * (1 - 2 * NU))
    found = []
    for held in (
        {"dirichletx": "px", "dirichlety": "py"},
        {"dirichletx": "py", "dirichlety": "px", "dirichletz": "px|py"},
    ):
        space = ng.VectorH1(mesh, order=order, **held)
        u, v = space.TnT()
        strain = [0.5 * (Grad(w) + Grad(w).trans) for w in (u, v)]
        forms = []
        for integrand, more in (
            (2 * mu * InnerProduct(*strain) + lam * Trace(strain[0]) * Trace(strain[1]), 2),
            (rho * InnerProduct(u, v), 4),
        ):
            form = ng.BilinearForm(integrand * dx(bonus_intorder=more)).Assemble()
            i, j, value = form.mat.COO()
            free = np.flatnonzero(list(space.FreeDofs()))
            matrix = sp.csr_matrix((np.array(value), (np.array(i), np.array(j))), shape=(space.ndof,) * 2)
            forms.append(matrix[free][:, free].tocsc())
        values = eigsh(forms[0], k=2, M=forms[1], sigma=0.02, return_eigenvectors=False)
        frequency = np.sqrt(np.abs(values) * E / RHO) / (2 * pi * R)
        found.append(frequency[np.argmin(abs(frequency - 4600))])
    return np.array(found), len(free)


def main(*steps):
    elastic = Elastic(E, NU, RHO)
    (mode,) = solve_modes(hemisphere(radius=R, thickness=H), elastic, 2, tolerance=1e-7)
    pair, coupled = Pair(mode), CoupledHarmonics(mode, elastic, highest=14)
    wall = wave(4, EPSILON * H, profile=lambda s: np.sin(s * pi / 2) ** 4)

    def lump(m):
        """Wave m of Σ exp(30 (sin φ cos(θ - k π/2) - 1)) over four k, by Bessel functions."""
        return lambda s: (
            EPSILON * (8 if m else 4) * ive(m, 30 * np.sin(s * pi / 2)) * np.exp(30 * (np.sin(s * pi / 2) - 1))
        )

    lumps = Waves({m: lump(m) for m in range(0, 17, 4)})
    cases = {
        "thickness": (Imperfection(thickness=wall), {"thicker": EPSILON}),
        "mass": (Imperfection(density=lumps), {"heavier": EPSILON}),
    }
    ours = {}
    for name, (flaw, _) in cases.items():
        whole, first = coupled.solve(flaw), find_split(pair, flaw)
        ours[name] = whole.wave.real / (1 + whole.shift)
        print(f"{name}: coupled harmonics {ours[name]:+.7f}, first order {first.wave.real:+.7f}")
    print(
        f"perfect: {mode.frequency:.4f} Hz\n\nsplits of finite elements; in brackets their distance from the coupled harmonics"
    )
    print("order  tetrahedra  unknowns  perfect (Hz)             thickness               mass                    s")
    meshes = {}
    for order, rim in steps or STEPS:
        start = time.perf_counter()
        mesh = meshes.setdefault(rim, mesh_quarter(rim))
        perfect, unknowns = solve(mesh, order)
        own = (perfect[0] - perfect[1]) / perfect.mean()
        cells = [f"{perfect.mean():.4f} ({perfect.mean() / mode.frequency - 1:+.1e})"]
        for name, (_, change) in cases.items():
            f, _ = solve(mesh, order, **change)
            peer = (f[0] - f[1]) / f.mean() - own
            cells.append(f"{peer:+.7f} ({peer / ours[name] - 1:+.1e})")
        seconds = time.perf_counter() - start
        print(f"{order:5d}  {mesh.ne:10d}  {unknowns:8d}  " + "   ".join(cells) + f"  {seconds:4.0f}", flush=True)


if __name__ == "__main__":
    words = [word.split(":") for word in sys.argv[1:]]
    main(*((int(order), float(rim)) for order, rim in words))
