"""Prestress by a base that expands, and Duffing's coefficient, by NGSolve: an independent oracle for shell.prestress, loads, duffing.

Prestress: the axisymmetric equilibrium is solved by Newton's method with the base stretched by ±ε, Green's strain whole; the
mode is one of the tangent stiffness there, and its frequency is differenced. Amplitude: the forces of a mode of finite
amplitude on the waves 0, n and 2n are integrals over azimuths of the first Piola-Kirchhoff stress, without Fourier algebra.

    PYTHONPATH=. python tests/benchmarks/finite_ngsolve.py ["free dome 15 x 0.9" ...]
"""

import sys
import time
from math import cos, hypot, pi, sin

import numpy as np

from shell.duffing import amplitude_shift
from shell.elastic import Elastic
from shell.loads import Loads
from shell.meridian import cylinder, hemisphere
from shell.modes import solve_modes
from shell.prestress import Prestress
from shell.resonator import Resonator
from tests.benchmarks.fourier_ngsolve import Piece, Spot, section

SILICA = Elastic(72.7e9, 0.17, 2203.0)


def dome(R: float, h: float) -> list[Piece]:
    """Outline of a hemisphere: the second piece is its rim."""
    a, b = R - h / 2, R + h / 2
    return [
        ((0.0, a), (a, 0.0), (0.0, 0.0)),
        ((a, 0.0), (b, 0.0), None),
        ((b, 0.0), (0.0, b), (0.0, 0.0)),
        ((0.0, b), (0.0, a), None),
    ]


def cup(R: float, h: float, H: float, bottom: float, clamp: float) -> list[Piece]:
    """Outline of a cup; the first piece is clamped."""
    low, high, a, b = 0.0, bottom, R - h / 2, R + h / 2
    spots: list[Spot] = [(0.0, low), (clamp, low), (b, low), (b, H), (a, H), (a, high), (0.0, high)]
    return [(one, two, None) for one, two in zip(spots, [*spots[1:], spots[0]], strict=True)]


def refined(mesh, corners: list[tuple[Spot, float]], levels: int):
    """The mesh with the elements at sharp corners halved again and again."""
    import ngsolve as ng

    mesh = ng.Mesh(mesh)
    for _ in range(levels):
        for element in mesh.Elements(ng.VOL):
            there = [mesh[v].point for v in element.vertices]
            touches = any(hypot(p[0] - r, p[1] - z) < 1e-9 for p in there for (r, z), _ in corners)
            mesh.SetRefinementFlag(ng.ElementId(element), touches)
        mesh.Refine()
    return mesh


class Waves:
    """Gradients, strains and stresses of waves around the axis on a mesh of the section."""

    def __init__(self, mesh, elastic: Elastic, order: int) -> None:
        import ngsolve as ng

        self.ng, self.elastic, self.order = ng, elastic, order
        self.mesh = mesh
        self.mesh.Curve(order)

    def space(self, n: int):
        """(u_r, u_θ, u_z) of a wave; for n = 0 without u_θ."""
        held = ["clamp|axis"] * 3 if n else ["clamp|axis", "clamp|axis|free", "clamp"]
        ng = self.ng
        return ng.FESpace([ng.H1(self.mesh, order=self.order, dirichlet=name) for name in held])

    def gradient(self, u, n: int, theta: float | None = None):
        """∂_j u_c of a wave ~ cos nθ at an azimuth; where it is absent, the amplitudes of cos and sin."""
        a, b, c = u
        (ar, az), (br, bz), (cr, cz) = ((d[0], d[1]) for d in (self.ng.grad(x) for x in (a, b, c)))
        r = self.ng.x
        C, S = (1.0, 1.0) if theta is None else (cos(n * theta), sin(n * theta))
        return (
            (C * ar, -S * (n * a + b) / r, C * az),
            (S * br, C * (n * b + a) / r, S * bz),
            (C * cr, -S * n * c / r, C * cz),
        )

    def stress(self, E):
        """C : E of symmetric components."""
        E1, nu = self.elastic.E, self.elastic.nu
        lam, G = E1 * nu / (1 + nu) / (1 - 2 * nu), self.elastic.G
        trace = E[0][0] + E[1][1] + E[2][2]
        return [[2 * G * E[i][j] + (lam * trace if i == j else 0.0) for j in range(3)] for i in range(3)]

    def over_section(self, integrand):
        """Its integral over r dr dz."""
        return integrand * self.ng.x * self.ng.dx(bonus_intorder=2 * self.order)

    def matrix(self, space, integrand, scale: float = 1.0):
        form = self.ng.BilinearForm(space)
        form += self.over_section(scale * integrand)
        form.Assemble()
        return form

    def solve(self, matrix, space, load):
        """One linear solution with a residual correction."""
        inverse = matrix.mat.Inverse(space.FreeDofs(), inverse="umfpack")
        x, rest = load.CreateVector(), load.CreateVector()
        x.data = inverse * load
        rest.data = load - matrix.mat * x
        x.data += inverse * rest
        return x


def double(A, B):
    """A : B."""
    return sum(A[i][j] * B[i][j] for i in range(3) for j in range(3))


def symmetric(F, H):
    """sym(Fᵀ H)."""
    FH = [[sum(F[k][i] * H[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
    return [[(FH[i][j] + FH[j][i]) / 2 for j in range(3)] for i in range(3)]


def unit(H, factor: float = 1.0):
    """1 + H."""
    return [[H[i][j] * factor + (1.0 if i == j else 0.0) for j in range(3)] for i in range(3)]


def green(H):
    """½ (H + Hᵀ + Hᵀ H)."""
    return [[(H[i][j] + H[j][i] + sum(H[k][i] * H[k][j] for k in range(3))) / 2 for j in range(3)] for i in range(3)]


def lowest(waves: Waves, n: int, near: float, H0=None, growth=1.0):
    """ω² and eigenvector (a grid function) of the mode nearest to `near` Hz on an initial gradient H0 of a body that has grown."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.linalg import LinearOperator, eigsh

    ng, space = waves.ng, waves.space(n)
    u, v = space.TnT()
    H, T = waves.gradient(u, n), waves.gradient(v, n)
    zero = [[0.0] * 3 for _ in range(3)]
    F = unit(H0 or zero)
    stiff = double(waves.stress(symmetric(F, H)), symmetric(F, T)) / growth
    if H0:
        S = waves.stress(grown(green(H0), growth))
        stiff += 1 / growth * sum(S[i][j] * H[k][i] * T[k][j] for i in range(3) for j in range(3) for k in range(3))
    heavy = waves.elastic.rho * sum(x * y for x, y in zip(u, v, strict=True))
    K, M = waves.matrix(space, stiff), waves.matrix(space, heavy)
    shifted = waves.matrix(space, stiff - (2 * pi * near) ** 2 * heavy)
    inverse = shifted.mat.Inverse(space.FreeDofs(), inverse="umfpack")
    free = np.array([bool(x) for x in space.FreeDofs()])
    k, m = (
        csr_matrix((x, (i, j)), shape=(space.ndof,) * 2)[free][:, free] for i, j, x in (f.mat.COO() for f in (K, M))
    )
    load, answer = shifted.mat.CreateColVector(), shifted.mat.CreateColVector()

    def solve(x):
        load.FV().NumPy()[:] = 0.0
        load.FV().NumPy()[free] = x.ravel()
        answer.data = inverse * load
        return answer.FV().NumPy()[free].copy()

    operator = LinearOperator(k.shape, matvec=solve, dtype=float)
    _, vectors = eigsh(k, 1, m, sigma=(2 * pi * near) ** 2, OPinv=operator, which="LM")
    mode = ng.GridFunction(space)
    mode.vec.FV().NumPy()[:] = 0.0
    mode.vec.FV().NumPy()[free] = vectors[:, 0]
    x = mode.vec
    y = x.CreateVector()
    y.data = K.mat * x
    z = x.CreateVector()
    z.data = M.mat * x
    return float(ng.InnerProduct(x, y) / ng.InnerProduct(x, z)), mode


def grown(E, growth):
    """Green's strain beyond that of the growth."""
    return [[E[i][j] - ((growth**2 - 1) / 2 if i == j else 0.0) for j in range(3)] for i in range(3)]


def slope_by_difference(
    mesh, elastic: Elastic, n: int, near: float, order: int, uneven: bool, strain: float = 1e-6, axial: float = 0.0
) -> float:
    """D ln f of equilibria at ± strain: by that of the base, or by the growth strain cos² of the polar angle of the body.

    With `axial` (m/s²) instead by ± that acceleration of the base along z.
    """
    waves = Waves(mesh, elastic, order)
    ng, found = waves.ng, []
    for s in (strain, -strain):
        space = waves.space(0)
        u, v = space.TnT()
        H, T = waves.gradient(u, 0), waves.gradient(v, 0)
        growth = 1 + s * ng.y**2 / (ng.x**2 + ng.y**2) if uneven else 1.0
        E, F = grown(green(H), growth), unit(H)
        residual = ng.BilinearForm(space)
        residual += waves.over_section(double(waves.stress(E), symmetric(F, T)) / growth)
        if "clamp" not in waves.mesh.GetBoundaries():  # a spring so soft that it only holds a free body in its place
            residual += waves.over_section(1e-9 * (2 * pi * near) ** 2 * elastic.rho * (u[0] * v[0] + u[2] * v[2]))
        held = ng.GridFunction(space)
        if axial:
            residual += waves.over_section(elastic.rho * axial * s / strain * v[2])
        elif not uneven:
            held.components[0].Set(s * ng.x, definedon=waves.mesh.Boundaries("clamp"))
            held.components[2].Set(s * ng.y, definedon=waves.mesh.Boundaries("clamp"))
        for _ in range(5):
            residual.AssembleLinearization(held.vec)
            r = held.vec.CreateVector()
            residual.Apply(held.vec, r)
            held.vec.data -= residual.mat.Inverse(space.FreeDofs(), inverse="umfpack") * r
        found.append(lowest(waves, n, near, waves.gradient(held.components, 0), growth)[0])
    return (found[0] - found[1]) / (found[0] + found[1]) / (2 * (axial or strain))


def amplitude_by_azimuths(mesh, elastic: Elastic, n: int, near: float, order: int) -> tuple[float, float]:
    """δf/f over w², w the largest displacement (m), and f."""
    waves = Waves(mesh, elastic, order)
    ng = waves.ng
    square, mode = lowest(waves, n, near)
    points = [waves.mesh(r, z) for r, z in ((v.point[0], v.point[1]) for v in waves.mesh.vertices) if r > 0]
    values = np.array([[mode.components[k](p) for k in range(3)] for p in points])
    largest = np.max(np.maximum(np.hypot(values[:, 0], values[:, 2]), abs(values[:, 1])))
    count = 8 * n + 2  # azimuths: exact for the eight waves of a fourth power
    azimuths = 2 * pi * (np.arange(count) + 0.5) / count
    a = 1e-4 / largest * max(p.pnt[0] for p in points)

    def force(space, wave: int, amplitude: float):
        """∫ P : ∇ψ of the mode at an amplitude."""
        v = space.TestFunction()
        form = ng.LinearForm(space)
        for theta in azimuths:
            H = [[amplitude * x for x in row] for row in waves.gradient(mode.components, n, theta)]
            E, F = green(H), unit(H)
            work = double(waves.stress(E), symmetric(F, waves.gradient(v, wave, theta)))
            form += waves.over_section(2 * pi / count * work)
        form.Assemble()
        return form.vec

    mass = 0.0
    for k in range(3):
        mass += pi * elastic.rho * ng.Integrate(mode.components[k] ** 2 * ng.x, waves.mesh, order=2 * order + 4)
    one, two = (float(ng.InnerProduct(force(waves.space(n), n, s * a), mode.vec)) for s in (1.0, 2.0))
    quartic = (two - 2 * one) / (6 * a**3)  # force k a + Γ a³
    change = 0.75 * quartic
    for wave, scale in ((0, 2 * pi), (2 * n, pi)):
        space = waves.space(wave)
        ahead, behind = force(space, wave, a), force(space, wave, -a)
        g = ahead.CreateVector()
        g.data = 0.5 / a**2 * (ahead + behind)
        u, v = space.TnT()
        stiff = double(waves.stress(linear(waves.gradient(u, wave))), linear(waves.gradient(v, wave)))
        heavy = elastic.rho * (u[0] * v[0] + u[2] * v[2] + (u[1] * v[1] if wave else 0.0))
        for shift, share in ((1e-9 if wave == 0 else 0.0, 1.0), (-4.0, 0.5)):
            K = waves.matrix(space, stiff + shift * square * heavy, scale)
            change -= share * float(ng.InnerProduct(g, waves.solve(K, space, g)))
    return change / mass / (2 * square) / largest**2, square**0.5 / (2 * pi)


def linear(H):
    """Sym H."""
    return [[(H[i][j] + H[j][i]) / 2 for j in range(3)] for i in range(3)]


CASES: dict[str, tuple[Resonator, list[Piece], list[int], list[tuple[Spot, float]]]] = {
    "free dome 15 x 0.9": (hemisphere(15e-3, 0.9e-3), dome(15e-3, 0.9e-3), [], []),
    "dome 15 x 0.9, rim clamped": (
        hemisphere(15e-3, 0.9e-3, support="clamped-rim"),
        dome(15e-3, 0.9e-3),
        [1],
        [((14.55e-3, 0.0), 1e-4), ((15.45e-3, 0.0), 1e-4)],
    ),
    "cup 12.5 x 0.6, bottom 1, clamp 3": (
        cylinder(12.5e-3, 0.6e-3, 18e-3, bottom_thickness=1e-3, clamp_radius=3e-3),
        cup(12.5e-3, 0.6e-3, 18e-3, 1e-3, 3e-3),
        [0],
        [((3e-3, 0.0), 1e-4), ((12.2e-3, 1e-3), 1e-4)],
    ),
}


def main() -> None:
    """Print both sides of every case."""
    for name in sys.argv[1:] or CASES:
        resonator, outline, clamped, corners = CASES[name]
        (mode,) = solve_modes(resonator, SILICA, 2, tolerance=1e-6)
        ours, prestress = amplitude_shift(mode).total, Prestress(mode)
        loaded = Loads(mode, SILICA).shift("axial") if clamped else 0.0
        angle = mode.along.position * pi / 2
        field = float(prestress.shares @ np.cos(angle) ** 2)
        print(
            f"{name}: f {mode.frequency:.5f} Hz, per m² {ours:.6e}, base {prestress.by_base:.7f}, field {field:.7f}, axial {loaded:.6e}"
        )
        for order, size in ((4, 0.8e-3), (5, 0.8e-3)):
            start = time.process_time()
            mesh = refined(section(outline, clamped, size, corners), corners, 8)
            near = mode.frequency * 0.99
            theirs, f = amplitude_by_azimuths(mesh, SILICA, 2, near, order)
            base = slope_by_difference(mesh, SILICA, 2, near, order, False) if clamped else 0.0
            field = slope_by_difference(mesh, SILICA, 2, near, order, True) if "cup" not in name else 0.0
            loaded = slope_by_difference(mesh, SILICA, 2, near, order, False, axial=1e4) if clamped else 0.0
            spent = time.process_time() - start
            print(
                f"   NGSolve order {order}: f {f:.5f} Hz, per m² {theirs:.6e}, base {base:.7f}, field {field:.7f}, "
                f"axial {loaded:.6e}, {spent:.0f} s"
            )


if __name__ == "__main__":
    main()
