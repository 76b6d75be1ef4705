"""A dome with four real cuts by NGSolve: a quarter of it, curved tetrahedra, the modes n = 2 told apart by parity; by hand.

    OPENBLAS_NUM_THREADS=1 python tests/benchmarks/groove_ngsolve.py outer --position 0.95 --width 0.5 --length 0.5 --depth 217

Free hemisphere of 15 mm x 0.9 mm with equal cuts at the azimuths 0°, 90°, 180°, 270°, walls along radial planes and cones, sharp
corners; a cut of the edge goes through the wall. About both mirrors x = 0 and y = 0 the mode cos 2θ is even and sin 2θ odd.
Prints the change of f_cos - f_sin, Hz, against the same mesh with the cuts filled. Nothing of the workbench is used.
"""

import argparse
import time
from math import cos, degrees, pi, sin

import numpy as np

R, H = 15.0, 0.9  # mm
E, NU, RHO = 72.6283391332881e9, 0.1663662749173554, 2203.0  # fused silica at 20 °C as in the card free-dome
SHIFT = (2 * pi * 4400.0) ** 2  # between the rigid motion and the mode


def cut_dome(kind, position, width, length, depth, size, fine, order):
    """Mesh of a quarter of the dome, its mirrors named x and y; lengths in mm."""
    import ngsolve as ng
    from netgen import occ

    origin = occ.Pnt(0, 0, 0)

    def ball(r):
        return occ.Sphere(origin, r)

    def between(one, two):  # two cones
        plane = occ.WorkPlane(occ.Axes(origin, n=-occ.Y, h=occ.X))
        corners = [
            (r * sin(a), r * cos(a)) for r, a in ((0.9 * R, two), (1.1 * R, two), (1.1 * R, one), (0.9 * R, one))
        ]
        plane.MoveTo(*corners[0])
        for corner in corners[1:]:
            plane.LineTo(*corner)
        return plane.Close().Face().Revolve(occ.Axis(origin, occ.Z), 360)

    dome = (ball(R + H / 2) - ball(R - H / 2)) * occ.Box(origin, occ.Pnt(2 * R, 2 * R, 2 * R))
    polar = position * pi / 2
    side = width / (2 * R * sin(polar))
    if kind == "edge":
        ring = between(pi / 2 - depth / R, pi / 2 + 0.01)  # a cone: along the normal of the wall
    else:
        layer = ball(R + H) - ball(R + H / 2 - depth) if kind == "outer" else ball(R - H / 2 + depth)
        ring = layer * between(polar - length / (2 * R), polar + length / (2 * R))
    upper, about = occ.Box(occ.Pnt(-90, 0, -90), occ.Pnt(90, 90, 90)), occ.Axis(origin, occ.Z)
    first = dome * ring * (upper - upper.Rotate(about, degrees(side)))
    last = dome * ring * (upper.Rotate(about, degrees(pi / 2 - side)) - upper.Rotate(about, 90))
    rest = dome - first - last
    rest.mat("rest")
    for plug in (first, last):
        plug.mat("plug")
        for face in plug.faces:
            face.maxh = fine
    body = occ.Glue([rest, first, last])
    for face in body.faces:
        if abs(face.center.x) < 1e-9:
            face.name = "x"
        elif abs(face.center.y) < 1e-9:
            face.name = "y"
    mesh = ng.Mesh(occ.OCCGeometry(body).GenerateMesh(maxh=size, grading=0.35))
    mesh.Curve(order)
    return mesh


def frequency(mesh, order, which, parts):
    """Unknowns and the lowest elastic frequency of these parts, of the parity of cos 2θ or sin 2θ, Hz."""
    import ngsolve as ng

    # even about both planes: the normal component is held there; odd: the tangential ones
    if which == "cos":
        held = {"dirichletx": "x", "dirichlety": "y"}
    else:
        held = {"dirichletx": "y", "dirichlety": "x", "dirichletz": "x|y"}
    space = ng.VectorH1(mesh, order=order, definedon=mesh.Materials(parts), **held)
    u, v = space.TnT()

    def strain(w):
        return 0.5 * (ng.Grad(w) + ng.Grad(w).trans)

    lam, G = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
    elastic = lam * ng.div(u) * ng.div(v) + 2 * G * ng.InnerProduct(strain(u), strain(v))
    heavy = 1e-6 * RHO * ng.InnerProduct(u, v)  # lengths in mm
    K, M, A = (ng.BilinearForm(space, symmetric=True) for _ in range(3))
    for form, integrand in ((K, elastic), (M, heavy), (A, elastic - SHIFT * heavy)):
        form += integrand * ng.dx(definedon=mesh.Materials(parts))
        form.Assemble()
    inverse = A.mat.Inverse(space.FreeDofs(), inverse="sparsecholesky")
    x, y = A.mat.CreateColVector(), A.mat.CreateColVector()
    shape = ng.GridFunction(space)
    X, Y = ng.x, ng.y
    shape.Set(ng.CF((X, -Y, 0)) if which == "cos" else ng.CF((Y, X, 0)))
    x.data = ng.Projector(space.FreeDofs(), True) * shape.vec
    value = 0.0
    for _ in range(30):
        y.data = M.mat * x
        x.data = inverse * y
        y.data = M.mat * x
        norm = ng.InnerProduct(x, y)
        y.data = K.mat * x
        last, value = value, ng.InnerProduct(x, y) / norm
        x.data = (1 / np.sqrt(norm)) * x
        if abs(value - last) < 1e-12 * value:
            break
    return space.ndof, np.sqrt(value) / (2 * pi)


def main():
    """Print the split on finer and finer meshes."""
    import ngsolve as ng

    ng.SetNumThreads(1)
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("kind", choices=("edge", "inner", "outer"))
    for name, default in (("position", 1.0), ("width", 0.5), ("length", 0.5), ("depth", 100.0)):
        options.add_argument(f"--{name}", type=float, default=default)
    options.add_argument("--size", type=float, default=2.0)
    options.add_argument("--fine", type=float, nargs="+", default=[0.2, 0.1])
    options.add_argument("--order", type=int, nargs="+", default=[3, 4])
    o = options.parse_args()
    for fine in o.fine:
        for order in o.order:
            began = time.process_time()
            mesh = cut_dome(o.kind, o.position, o.width, o.length, 1e-3 * o.depth, o.size, fine, order)
            mass = 4 * RHO * ng.Integrate(1, mesh, definedon=mesh.Materials("plug"))
            count, split = 0, {}
            for parts in ("rest|plug", "rest"):
                (count, f_cos), (_, f_sin) = (frequency(mesh, order, which, parts) for which in ("cos", "sin"))
                split[parts] = f_cos - f_sin
            print(
                f"{o.kind} {o.position:g} {o.width:g} x {o.length:g} mm, {o.depth:g} µm: fine {fine:g} mm, order {order}, {count} unknowns: "
                f"removed {mass:.3f} µg, uncut {split['rest|plug']:+.4f}, change of the split {split['rest'] - split['rest|plug']:+.5f} Hz, "
                f"{time.process_time() - began:.0f} s",
                flush=True,
            )


if __name__ == "__main__":
    main()
