"""`hrg derive --dynamics` speaks as promised, and the C that it prints computes what the Python does."""

import ctypes

import numpy as np
import pytest

from studies.cli import main
from tests.compiled import compile_c


def speak(capsys, *words):
    status = main(["derive", "--dynamics", *words])
    return status, capsys.readouterr()


def test_both_languages_agree(tmp_path, capsys):
    space = {}
    exec(speak(capsys, "--code", "python")[1].out, space)
    compiled = compile_c(speak(capsys, "--code", "c")[1].out, tmp_path).averaged_rates
    rng = np.random.default_rng(5)
    for _ in range(20):
        values = rng.uniform(0.2, 2.0, 15)
        rates = (ctypes.c_double * 4)()
        compiled(*(ctypes.c_double(value) for value in values), rates)
        assert list(rates) == pytest.approx(list(space["averaged_rates"](*values)), rel=1e-12)


def test_latex_is_plain_ascii(capsys):
    """Letters that pdflatex does not know end the run of the document that reads the fragment."""
    assert speak(capsys, "--latex")[1].out.isascii()
