"""Emitted C as a library, compiled with every warning an error."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import pytest

CC = shutil.which("cc") or shutil.which("gcc")
FLAGS = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic")


def compile_c(source: str, folder: Path, self_test: str = "") -> ctypes.CDLL:
    """Return the source as a library, after its own test has passed and said `self_test`, where it has one; skip without a compiler."""
    if CC is None:
        pytest.skip("no C compiler on this machine")
    (folder / "m.c").write_text(source, encoding="utf-8")
    if self_test:
        subprocess.run([CC, *FLAGS, "-DHRG_SELF_TEST", "m.c", "-o", "self", "-lm"], cwd=folder, check=True)
        assert self_test in subprocess.run(["./self"], cwd=folder, check=True, capture_output=True, text=True).stdout
    subprocess.run([CC, *FLAGS, "-O1", "-shared", "-fPIC", "m.c", "-o", "m.so", "-lm"], cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "m.so"))
