"""A thin film on the faces (coating or electrodes): its frequency shift, its own loss, and the loss by heat flow to the wall.

The film follows the strain of the face. Its stiffness in plane stress and its mass move the frequency, to first order in t/h, by

    δω²/ω² = ∫ t [σ_f : ε - ω² ρ_f u²] dA / ω² ∫ ρ u² dV;

a film of the wall's own material is a thicker wall (Hadamard's formula). Its own loss counts with its energy,

    1/Q = φ t ∫ σ_f : ε dA / ∫ σ : ε dV,

and because it warms otherwise than the wall beneath it, θ_f - θ_s = T (α_s tr σ_s/C_s - α_f tr σ_f/C_f), heat crosses the
interface: with κ = √(iω C/k), a = k_f κ_f tanh(κ_f t) of the film and b = k_s κ_s of the wall (thick against 1/|κ_s|),

    1/Q = ∫ (θ_f - θ_s)² dA / (T ω ∫ σ : ε dV) · Re[a b/(a + b)]

(the one-dimensional heat equation in both, exactly; Fejer et al., Phys. Rev. D 70 (2004) 082003 treat the same heat flow).
"""

from dataclasses import dataclass

import numpy as np

from shell.damping.faces import FreeFaces, Vibration, shell_faces
from shell.damping.heat import Heat
from shell.errors import ShellError, mm
from shell.modes import Mode
from shell.quadrature import Array
from shell.solution import plane_energies, total

THICKEST = 0.05  # film over wall up to which it follows the face and leaves the mode as it is


@dataclass(frozen=True)
class Film:
    """A film on the faces of the shell."""

    thickness: float  # m
    E: float  # E, nu: Young's modulus (Pa) and Poisson ratio
    nu: float
    loss: float = 0.0  # its own loss angle φ
    heat: Heat | None = None  # what it does with heat; None leaves its thermoelastic loss out
    faces: tuple[str, ...] = ("inner", "outer")  # the faces that carry it
    span: tuple[float, float] = (0.0, 1.0)  # part of the meridian that carries it, 0 ... 1 of the arc length
    coverage: float = 1.0  # covered share of that part (a pattern finer than the mode's wavelength)
    rho: float = 0.0  # density, kg/m³, for its effect on a frequency

    def __post_init__(self) -> None:
        if not (self.thickness >= 0 and self.loss >= 0):
            raise ShellError("a film's thickness and loss must be 0 or positive.")
        if not (self.E > 0 and -1 < self.nu < 0.5):
            raise ShellError("a film's modulus must be positive and its Poisson ratio between -1 and 0.5.")
        if not 0 <= self.coverage <= 1 or not 0 <= self.span[0] < self.span[1] <= 1:
            raise ShellError("a film covers a share 0 ... 1 of a part of the meridian [from, to] within 0 ... 1.")
        unknown = set(self.faces) - {"inner", "outer"}
        if unknown or not self.faces:
            raise ShellError(f"a film lies on inner, outer or both faces, not {', '.join(sorted(unknown)) or 'none'}.")

    def carries(self, face: FreeFaces) -> Array:
        """Covered share at the points of a face."""
        there = (face.position >= self.span[0]) & (face.position <= self.span[1])
        return np.asarray(self.coverage * there * (face.kind in self.faces))


def check_film(film: Film, wall: float) -> None:
    """Refuse a film that is not thin compared with the thinnest wall (m)."""
    if film.thickness >= wall:
        raise ShellError(f"the film ({mm(film.thickness)}) is thicker than the wall ({mm(wall)}): is it in nm?")
    if film.thickness > THICKEST * wall:
        raise ShellError(f"the film ({mm(film.thickness)}) is more than {100 * THICKEST:.0f} % of the wall ({mm(wall)}): the mode would change; model it as a wall of its own.")  # fmt: skip


def film_energies(film: Film, face: FreeFaces) -> tuple[Array, Array]:
    """σ_f : ε of the film per volume of film, plane stress, at the points of a face (J/m³): of stretch and of twist."""
    return plane_energies(np.array(film.E), np.array(film.nu), *face.strain[[0, 1, 3]])


def film_shift(mode: Mode, film: Film) -> float:
    """Relative change of a mode's frequency by a film's stiffness and mass; stem and root stay bare."""
    check_film(film, min(value for _, value in mode.resonator.thickness))
    eigenvalue, changed = mode.solution.eigenvalue, 0.0
    for face in shell_faces(mode.solution, mode.resonator):
        heavy = eigenvalue * film.rho * np.sum(face.moved**2, axis=0)
        changed += face.integrate(film.carries(face) * (sum(film_energies(film, face)) - heavy))
    return film.thickness * changed / (2 * eigenvalue * total(mode.solution.kinetic))


def film_internal_loss(film: Film, vibration: Vibration) -> float:
    """1/Q of the film's own loss."""
    energy = sum(face.integrate(film.carries(face) * sum(film_energies(film, face))) for face in vibration.faces)
    return film.loss * film.thickness * energy / vibration.strain_energy


def film_thermoelastic_loss(film: Film, vibration: Vibration, wall: Heat, temperature: float) -> float:
    """1/Q from heat flow between film and wall (formula above), at a temperature (K)."""
    if film.heat is None or film.thickness == 0:
        return 0.0
    inside, omega, gap = film.heat, float(vibration.omega(temperature)), 0.0
    own = inside.expansion * film.E / (1 - film.nu) / inside.capacity
    for face in vibration.faces:
        beneath = wall.expansion * face.E / (1 - face.nu) / wall.capacity
        gap += face.integrate(film.carries(face) * ((own - beneath) * face.stretch) ** 2)
    return temperature * gap * exchange(film.thickness, inside, wall, omega) / (omega * vibration.strain_energy)


def exchange(thickness: float, film: Heat, wall: Heat, omega: float) -> float:
    """Re[a b/(a + b)] of film and wall, W/(m² K)."""
    kappa = np.sqrt(1j * omega * film.capacity / film.conductivity)
    a = film.conductivity * kappa * np.tanh(kappa * thickness)
    b = np.sqrt(1j * omega * wall.capacity * wall.conductivity)
    return float(np.real(a * b / (a + b)))


def thickness_power(film: Film, wall: Heat, omega: float) -> float:
    """Power of the film thickness in the thermoelastic loss: 2 for a film thin enough to be isothermal."""
    if film.heat is None:
        raise ShellError("a film without heat constants has no thermoelastic loss.")
    step = 1e-3
    more, less = (exchange(film.thickness * (1 + side * step), film.heat, wall, omega) for side in (1, -1))
    return float(np.log(more / less) / np.log((1 + step) / (1 - step)))
