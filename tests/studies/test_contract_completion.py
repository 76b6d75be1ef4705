"""Shell completion: installed for bash into a home folder, it offers the commands and options that exist."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BASH = shutil.which("bash")


def install(home, shell):
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "HOME": str(home), "SHELL": shell}
    command = [sys.executable, "-c", "from studies.cli import run; run()", "--install-completion"]
    return subprocess.run(command, capture_output=True, text=True, env=environment, cwd=home, timeout=600)


@pytest.mark.slow
@pytest.mark.skipif(BASH is None, reason="no bash on this machine")
def test_bash_completes_commands_and_options(tmp_path):
    done = install(tmp_path, BASH)
    assert done.returncode == 0, done.stderr
    (script,) = tmp_path.glob(".local/share/bash-completion/completions/hrg")

    def complete(*words):
        line = " ".join(f"'{word}'" for word in words)
        code = f"source {script}; COMP_WORDS=({line}); COMP_CWORD={len(words) - 1}; _hrg; printf '%s\\n' \"${{COMPREPLY[@]}}\""
        return subprocess.run([BASH, "-c", code], capture_output=True, text=True, timeout=600).stdout.split()

    assert {"render", "reproduce"} <= set(complete("hrg", "re"))
    assert "--swing-mm" in complete("hrg", "render", "--sw")
    assert {"oblique", "axis", "side"} <= set(complete("hrg", "render", "--view", ""))


def test_an_unknown_shell_is_a_sentence(tmp_path):
    done = install(tmp_path, "/bin/tcsh")
    assert done.returncode != 0
    assert "--shell" in done.stderr
    assert "Traceback" not in done.stderr
    assert "internal fault" not in done.stderr
