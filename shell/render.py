"""Mode shapes as pictures, drawn off-screen by pyvista in a child process: VTK ends one without OpenGL (`NoOpenGL` has the remedy)."""

import io
import os
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from dataclasses import fields
from math import pi
from pathlib import Path
from typing import Any, Literal

import numpy as np

from shell.errors import ShellError
from shell.scene import Scene

REMEDY = "no OpenGL on this machine, so no picture could be drawn. On Debian or Ubuntu 'apt install libegl1 libgl1-mesa-dri' installs a software renderer."
PERIOD = 1.2  # s, of a swing
PER_FRAME = 15.0  # seconds that one frame may take before the drawing is given up

View = Literal["oblique", "axis", "side"]
VIEWS = ("oblique", "axis", "side")


class NoOpenGL(RuntimeError):
    """Pictures cannot be drawn on this machine; the message says what to install."""


def render_png(scenes: Scene | Sequence[Scene], view: View = "oblique", width: int = 900, height: int = 700) -> bytes:
    """Return a PNG of scenes side by side on one scale, views "oblique", "axis" (into the open end) or "side"."""
    return _draw(scenes, view, (width, height), [1.0])[0]


def render_animation(
    scenes: Scene | Sequence[Scene], kind: Literal["webp", "gif"], view: View = "oblique", frames: int = 24,
    progress: Callable[[float], None] = lambda part: None,
) -> bytes:  # fmt: skip
    """Return a looping WebP or GIF of one period of the swing; `progress` is told which part is drawn."""
    from PIL import Image

    swings = [float(np.cos(2 * pi * k / frames)) for k in range(frames // 2 + 1)]  # and back again
    pictures = _draw(scenes, view, (640, 520), swings, progress)
    drawn = [Image.open(io.BytesIO(png)).convert("RGB") for png in pictures]
    drawn += drawn[frames - len(drawn) : 0 : -1]
    buffer = io.BytesIO()
    more: dict[str, Any] = {"quality": 80, "method": 4} if kind == "webp" else {"optimize": True}
    duration = round(1000 * PERIOD / frames)
    drawn[0].save(buffer, kind.upper(), save_all=True, append_images=drawn[1:], duration=duration, loop=0, **more)
    return buffer.getvalue()


def can_draw() -> tuple[bool, str]:
    """Tell whether this machine can draw, and the remedy when it cannot."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    none = np.zeros(0, dtype=np.int64)
    scene = Scene(corners, 0 * corners, faces, np.arange(4.0), "", "", none.reshape(0, 0), none, False)
    try:
        render_png(scene, width=64, height=64)
    except NoOpenGL as error:
        return False, str(error)
    return True, ""


def _draw(
    scenes: Scene | Sequence[Scene], view: View, window: tuple[int, int], swings: list[float],
    progress: Callable[[float], None] = lambda part: None,
) -> list[bytes]:  # fmt: skip
    """Have a child process draw one PNG for every swing (-1 ... 1)."""
    together = [scenes] if isinstance(scenes, Scene) else list(scenes)
    if view not in VIEWS:
        raise ShellError(f"a view is one of {', '.join(VIEWS)}, not {view!r}.")
    with tempfile.TemporaryDirectory() as folder:
        job: dict[str, Any] = {"view": view, "window": window, "swings": swings, "count": len(together)}
        for k, scene in enumerate(together):
            job |= {f"{field.name}_{k}": getattr(scene, field.name) for field in fields(Scene)}
        np.savez(Path(folder, "job.npz"), **job)
        done = threading.Event()
        threading.Thread(target=_watch, args=(folder, len(swings), progress, done), daemon=True).start()
        try:
            _run_child(folder, 60 + PER_FRAME * len(swings))
        finally:
            done.set()
        pictures = [Path(folder, f"{k}.png") for k in range(len(swings))]
        if not all(picture.exists() for picture in pictures):
            raise NoOpenGL(REMEDY)
        return [picture.read_bytes() for picture in pictures]


def _watch(folder: str, count: int, progress: Callable[[float], None], done: threading.Event) -> None:
    while not done.wait(0.5):
        progress(len([*Path(folder).glob("*.png")]) / count)


def _run_child(folder: str, seconds: float) -> None:
    job = [sys.executable, "-m", "shell.render", folder]
    listened, held = os.pipe()  # its other end closes when this process ends, however it ends
    try:
        done = subprocess.run(job, stdin=listened, capture_output=True, timeout=seconds, cwd=Path(__file__).parents[1])
    except subprocess.TimeoutExpired:
        raise NoOpenGL(f"drawing took more than {seconds:.0f} s and was stopped; check OpenGL.") from None
    finally:
        os.close(listened)
        os.close(held)
    if done.returncode != 0:
        raise NoOpenGL(REMEDY)


def _end_with_parent(folder: str) -> None:
    """Leave nothing behind when the process that wants the pictures was killed: no work, no folder."""
    os.read(0, 1)  # not sys.stdin, whose lock would be held when the drawing is done
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=_end_with_parent, args=(sys.argv[1],), daemon=True).start()
    from shell.drawing import draw_job

    draw_job(sys.argv[1])
