"""Modes of a body of revolution by NGSolve: finite elements in the (r, z) plane, Fourier in θ. An independent oracle.

Displacements u_r, u_z ~ cos nθ, u_θ ~ sin nθ. On the axis they vanish for n > 1; for n = 1 u_θ = -u_r + r b with b a function
of its own, so that the strains stay finite; for n = 0 only u_z is free.
"""

from math import atan2, cos, hypot, pi, sin

import numpy as np

Spot = tuple[float, float]
Piece = tuple[Spot, Spot, Spot | None]  # start, end, centre of an arc


def section(outline: list[Piece], clamped: list[int], maxh: float, corners: list[tuple[Spot, float]]):
    """A curved mesh of the closed outline; pieces on the axis and those clamped are named, `corners` get their own size."""
    from netgen.occ import ArcOfCircle, Face, OCCGeometry, Pnt, Segment, Wire

    edges = []
    for start, end, center in outline:
        one, two = Pnt(*start, 0), Pnt(*end, 0)
        if center is None:
            edge = Segment(one, two)
        else:
            a, b = (atan2(z - center[1], r - center[0]) for r, z in (start, end))
            middle = a + ((b - a + pi) % (2 * pi) - pi) / 2
            radius = hypot(start[0] - center[0], start[1] - center[1])
            edge = ArcOfCircle(one, Pnt(center[0] + radius * cos(middle), center[1] + radius * sin(middle), 0), two)
        edges.append(edge)
    face = Face(Wire(edges))
    for edge in face.edges:
        k = min(
            range(len(outline)),
            key=lambda k: abs(edge.center.x - edges[k].center.x) + abs(edge.center.y - edges[k].center.y),
        )
        edge.name = "axis" if max(outline[k][0][0], outline[k][1][0]) < 1e-12 else "clamp" if k in clamped else "free"
    for vertex in face.vertices:
        for (r, z), size in corners:
            if hypot(vertex.p.x - r, vertex.p.y - z) < 1e-9:
                vertex.maxh = size
    return OCCGeometry(face, dim=2).GenerateMesh(maxh=maxh, grading=0.3)


def modes(
    mesh, elastic, n: int, count: int, order: int, near: float, refine: list[Spot] = (), levels: int = 0, moved=None
):
    """The `count` frequencies (Hz) above the rigid motions nearest to `near`, of polynomials of one order.

    `refine` : re-entrant corners towards which the mesh is refined geometrically `levels` times.
    `moved` : displacement (r, z) that shapes the mesh, an expression of r and z of NGSolve.
    """
    import ngsolve as ng
    from scipy.sparse import csr_matrix
    from scipy.sparse.linalg import LinearOperator, eigsh

    mesh = ng.Mesh(mesh)
    for _ in range(levels):
        for element in mesh.Elements(ng.VOL):
            there = [mesh[v].point for v in element.vertices]
            touches = any(hypot(p[0] - r, p[1] - z) < 1e-9 for p in there for r, z in refine)
            mesh.SetRefinementFlag(ng.ElementId(element), touches)
        mesh.Refine()
    mesh.Curve(order)
    if moved is not None:
        shape = ng.GridFunction(ng.VectorH1(mesh, order=order))
        shape.Set(ng.CF(moved))
        mesh.SetDeformation(shape)
    held = [
        ("clamp|axis", "clamp|axis", "clamp|axis"),
        ("clamp", "clamp", "clamp|axis"),
        ("clamp|axis",) * 2 + ("clamp",),
    ]
    names = held[0] if n > 1 else held[1] if n == 1 else held[2]
    space = ng.FESpace([ng.H1(mesh, order=order, dirichlet=name) for name in names])
    (a, b, c), (ta, tb, tc) = space.TnT()
    r = ng.x

    def kinematics(a, b, c):
        da, db, dc = ng.grad(a), ng.grad(b), ng.grad(c)
        if n == 1:  # u_θ = -a + r b
            b_r, b_z, v = -da[0] + b + r * db[0], -da[1] + r * db[1], -a + r * b
            ring, twist = b, b_r - b  # (a + v)/r = b;  v_r - a/r - v/r = v_r - b
        else:
            b_r, b_z, v = db[0], db[1], b
            ring, twist = (a + n * b) / r, b_r - (n * a + b) / r
        return (da[0], ring, dc[1], twist, da[1] + dc[0], b_z - n * c / r), (a, v, c)

    (e, u), (t, w) = kinematics(a, b, c), kinematics(ta, tb, tc)
    lam = elastic.E * elastic.nu / (1 + elastic.nu) / (1 - 2 * elastic.nu)
    weights = (2, 2, 2, 1, 1, 1)
    stiff = lam * (e[0] + e[1] + e[2]) * (t[0] + t[1] + t[2])
    stiff += sum(elastic.G * g * x * y for g, x, y in zip(weights, e, t, strict=True))
    heavy = elastic.rho * sum(x * y for x, y in zip(u, w, strict=True))
    shift = (2 * pi * near) ** 2
    forms = []
    for integrand in (stiff, heavy, stiff - shift * heavy):
        form = ng.BilinearForm(space, symmetric=False)
        form += integrand * r * ng.dx(bonus_intorder=4)
        form.Assemble()
        forms.append(form)
    free = np.array([bool(x) for x in space.FreeDofs()])
    K, M = (
        csr_matrix((x, (i, j)), shape=(space.ndof,) * 2)[free][:, free] for i, j, x in (f.mat.COO() for f in forms[:2])
    )
    inverse = forms[2].mat.Inverse(space.FreeDofs(), inverse="umfpack")
    load, answer = forms[2].mat.CreateColVector(), forms[2].mat.CreateColVector()

    def solve(x):
        load.FV().NumPy()[free] = x.ravel()
        answer.data = inverse * load
        return answer.FV().NumPy()[free].copy()

    operator = LinearOperator(K.shape, matvec=solve, dtype=float)
    values, _ = eigsh(K, count, M, sigma=shift, OPinv=operator, which="LM")
    return np.sqrt(np.sort(values)) / (2 * pi), space.ndof


def stemmed_dome(R: float, h: float, stem) -> tuple[list[Piece], list[int], list[Spot]]:
    """Outline of a hemisphere with its stem, counterclockwise from the lower end of the axis; the clamped pieces; sharp corners."""
    a, f = stem.radius, stem.fillet
    ends = dict(stem.roots)

    def side(face: int) -> list[Piece]:  # from the axis to the rim
        radius = R + face * h / 2
        rim = (radius, 0.0)
        if face not in ends:
            return [((0.0, radius), rim, (0.0, 0.0))]
        z = ((radius + face * f) ** 2 - (a + f) ** 2) ** 0.5
        foot = ((a + f) * radius / (radius + face * f), z * radius / (radius + face * f))
        return [
            ((0.0, ends[face]), (a, ends[face]), None),
            ((a, ends[face]), (a, z), None),
            *([((a, z), foot, (a + f, z))] if f else []),
            (foot, rim, (0.0, 0.0)),
        ]

    inner, outer = side(-1), side(1)
    low, high = inner[0][0], outer[0][0]
    loop = [*inner, (inner[-1][1], outer[-1][1], None), *((e, s, c) for s, e, c in outer[::-1]), (high, low, None)]
    clamped = [0] if -1 in ends else []
    if 1 in ends:
        clamped.append(len(loop) - 2)
    sharp = [] if f else [s for part, face in ((inner, -1), (outer, 1)) if face in ends for s in [part[-1][0]]]
    return loop, clamped, sharp
