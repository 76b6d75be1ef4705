"""Mode shapes as pictures: the deformed surface of revolution, drawn off-screen by pyvista.

VTK ends the whole process with a segmentation fault where the system has no OpenGL, so a picture is drawn in a child process.
"""

import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shell.errors import ShellError

Array = NDArray[np.float64]
REMEDY = (
    "no OpenGL on this machine, so no picture could be drawn. On Debian or Ubuntu"
    " 'apt install libegl1 libgl1-mesa-dri' brings a software renderer."
)


class NoOpenGL(RuntimeError):
    """The machine cannot draw; the message says how to mend it."""


@dataclass(frozen=True)
class ModeSurface:
    """The outline of a cross-section and its displacement in one mode.

    Attributes
    ----------
    r, z : (k,) array, m
        Points along the outline, the last joined to the first.
    u_r, u_z, u_theta : (k,) array
        Amplitudes: u_r and u_z go as cos n theta, u_theta as sin n theta.
    harmonic : int
        n.
    """

    r: Array
    z: Array
    u_r: Array
    u_z: Array
    u_theta: Array
    harmonic: int

    def grid(self, scale: float, count: int = 181) -> tuple[Array, Array, Array, Array]:
        """Return x, y, z and the size of the displacement on a grid (count, k + 1), deformed by `scale` (m) at most."""
        size = np.sqrt(self.u_r**2 + self.u_z**2 + self.u_theta**2).max()
        if not size > 0:
            raise ShellError("the mode has no displacement, so there is nothing to draw.")
        theta = np.linspace(0, 2 * np.pi, count)[:, None]
        r, z, u_r, u_z, u_t = (np.append(a, a[0])[None, :] for a in (self.r, self.z, self.u_r, self.u_z, self.u_theta))
        cosine, sine = np.cos(self.harmonic * theta) / size, np.sin(self.harmonic * theta) / size
        radial, around, axial = u_r * cosine, u_t * sine, u_z * cosine
        x = (r + scale * radial) * np.cos(theta) - scale * around * np.sin(theta)
        y = (r + scale * radial) * np.sin(theta) + scale * around * np.cos(theta)
        return x, y, z + scale * axial, np.sqrt(radial**2 + around**2 + axial**2)


def render_png(surface: ModeSurface, width: int = 900, height: int = 700) -> bytes:
    """Return a PNG of the mode: deformed, coloured by displacement, the undeformed shape as a ghost.

    Raises
    ------
    NoOpenGL
        The machine cannot draw.
    """
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder, "mode.npz"), Path(folder, "mode.png")
        fields = {name: getattr(surface, name) for name in ("r", "z", "u_r", "u_z", "u_theta")}
        np.savez(source, harmonic=surface.harmonic, width=width, height=height, **fields)
        _run_child(str(source), str(target))
        if not target.exists():
            raise NoOpenGL(REMEDY)
        return target.read_bytes()


def can_draw() -> tuple[bool, str]:
    """Tell whether this machine can draw, and the remedy when it cannot."""
    ring = np.array([1.0, 1.1, 1.1]), np.array([0.0, 0.0, 0.1])
    still = np.ones(3)
    try:
        render_png(ModeSurface(*ring, still, still, still, 2), 64, 64)
    except NoOpenGL as error:
        return False, str(error)
    return True, ""


def _run_child(*arguments: str) -> None:
    job = [sys.executable, "-m", "shell.render", *arguments]
    try:
        done = subprocess.run(job, capture_output=True, timeout=180, cwd=Path(__file__).parents[1])
    except subprocess.TimeoutExpired:
        raise NoOpenGL(
            "drawing took more than three minutes and was stopped; check the OpenGL of this machine."
        ) from None
    if done.returncode != 0:
        raise NoOpenGL(REMEDY)


def _draw(source: str, target: str) -> None:
    import pyvista as pv

    with np.load(source) as job:
        surface = ModeSurface(*(job[name] for name in ("r", "z", "u_r", "u_z", "u_theta")), int(job["harmonic"]))
        window = [int(job["width"]), int(job["height"])]
    size = float(max(np.ptp(surface.z), 2 * surface.r.max()))
    x, y, z, amount = surface.grid(0.12 * size)
    ghost = pv.StructuredGrid(*surface.grid(0.0)[:3])
    mode = pv.StructuredGrid(x, y, z)
    mode["displacement (of its largest)"] = amount.ravel(order="F")
    plotter = pv.Plotter(off_screen=True, window_size=window)
    plotter.set_background("white")
    plotter.add_mesh(ghost, color="#8a949e", opacity=0.16)
    bar = {"title": "displacement (of its largest)", "color": "black", "fmt": "%.1f"}
    plotter.add_mesh(mode, cmap="cividis", smooth_shading=True, scalar_bar_args=bar, clim=[0, 1])
    plotter.camera_position = [(1.6 * size, -1.6 * size, -1.5 * size), (0, 0, float(surface.z.mean())), (0, 0, 1)]
    plotter.screenshot(target)
    plotter.close()


if __name__ == "__main__":
    _draw(*sys.argv[1:])
