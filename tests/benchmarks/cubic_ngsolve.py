"""A dome of silicon (100) by NGSolve: a quarter of it, curved tetrahedra, by parity a mode with an antinode along [100] or [110]; by hand.

    OPENBLAS_NUM_THREADS=1 python tests/benchmarks/cubic_ngsolve.py --size 3e-3 --order 4

Free hemisphere of 15 mm x 0.9 mm, C11, C12, C44 of 165.7, 63.9, 79.6 GPa, 2329 kg/m³; beside shell.cubic.
"""

import argparse
import sys
import time

import numpy as np

R, H = 15e-3, 0.9e-3
C11, C12, C44, RHO = 165.7e9, 63.9e9, 79.6e9, 2329.0
SHIFT = (2 * np.pi * 5000.0) ** 2  # between the rigid motions and the pair


def quarter_dome(size, order):
    """Mesh a quarter of the dome, its cuts named x and y."""
    import ngsolve as ng
    from netgen import occ

    dome = occ.Sphere(occ.Pnt(0, 0, 0), R + H / 2) - occ.Sphere(occ.Pnt(0, 0, 0), R - H / 2)
    dome = dome * occ.Box(occ.Pnt(0, 0, 0), occ.Pnt(2 * R, 2 * R, 2 * R))
    for face in dome.faces:
        if abs(face.center.x) < 1e-9:
            face.name = "x"
        elif abs(face.center.y) < 1e-9:
            face.name = "y"
    mesh = ng.Mesh(occ.OCCGeometry(dome).GenerateMesh(maxh=size))
    mesh.Curve(order)
    return mesh


def frequencies(mesh, order, antinode):
    """Unknowns and the lowest elastic frequencies whose antinodes lie along [100] or between."""
    import ngsolve as ng
    from scipy.sparse import csr_matrix
    from scipy.sparse.linalg import LinearOperator, eigsh

    # even about both planes: the normal component is held there; odd: the tangential ones
    held = (
        {"dirichletx": "x", "dirichlety": "y"}
        if antinode == "100"
        else {"dirichletx": "y", "dirichlety": "x", "dirichletz": "x|y"}
    )
    space = ng.VectorH1(mesh, order=order, **held)
    u, v = space.TnT()

    def strain(w):
        return 0.5 * (ng.Grad(w) + ng.Grad(w).trans)

    e, f = strain(u), strain(v)
    elastic = C12 * ng.div(u) * ng.div(v) + 2 * C44 * ng.InnerProduct(e, f)
    elastic += (C11 - C12 - 2 * C44) * (e[0, 0] * f[0, 0] + e[1, 1] * f[1, 1] + e[2, 2] * f[2, 2])
    forms = []
    for integrand in (elastic, RHO * u * v, elastic - SHIFT * RHO * u * v):
        forms.append(ng.BilinearForm(space))
        forms[-1] += integrand * ng.dx
        forms[-1].Assemble()
    free = np.flatnonzero(np.array(list(space.FreeDofs())))
    K, M = (
        csr_matrix((x, (i, j)), shape=(space.ndof,) * 2)[free][:, free] for i, j, x in (g.mat.COO() for g in forms[:2])
    )
    inverse = forms[2].mat.Inverse(space.FreeDofs(), inverse="sparsecholesky")
    load, answer = forms[2].mat.CreateColVector(), forms[2].mat.CreateColVector()

    def solve(x):
        load.FV().NumPy()[:] = 0
        load.FV().NumPy()[free] = x.ravel()
        answer.data = inverse * load
        return answer.FV().NumPy()[free].copy()

    values = eigsh(
        K, 2, M, sigma=SHIFT, OPinv=LinearOperator(K.shape, matvec=solve, dtype=float), return_eigenvectors=False
    )
    return len(free), np.sqrt(np.sort(np.abs(values))) / (2 * np.pi)


def main():
    """Print both and what shell.cubic says."""
    from shell.cubic import Cubic, solve_cubic
    from shell.meridian import hemisphere

    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--size", type=float, default=3e-3)
    options.add_argument("--order", type=int, default=4)
    chosen = options.parse_args()
    mesh = quarter_dome(chosen.size, chosen.order)
    for antinode in ("100", "110"):
        began = time.process_time()
        unknowns, f = frequencies(mesh, chosen.order, antinode)
        print(f"[{antinode}] NGSolve {f} Hz, {unknowns} unknowns, {time.process_time() - began:.1f} s", flush=True)
    print(solve_cubic(hemisphere(R, H), Cubic(C11, C12, C44, RHO)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
