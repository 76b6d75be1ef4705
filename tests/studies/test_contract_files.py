"""Files in and out: devices, pipes and links stay what they are; what cannot be a file is named in a sentence."""

import os
import subprocess
import sys
import threading
import time

import pytest

from studies.cli import main
from studies.errors import InputError
from studies.files.reading import read_bytes
from studies.files.writing import check_folder, write_text


def test_a_link_is_followed_and_stays_a_link(tmp_path):
    (tmp_path / "real.txt").write_text("old")
    (tmp_path / "link.txt").symlink_to(tmp_path / "real.txt")
    (tmp_path / "dangling.txt").symlink_to(tmp_path / "new.txt")
    for name in ("link.txt", "dangling.txt"):
        write_text(tmp_path / name, "new")
        assert (tmp_path / name).is_symlink()
    assert (tmp_path / "real.txt").read_text() == (tmp_path / "new.txt").read_text() == "new"


def test_a_pipe_is_written_into_and_stays_a_pipe(tmp_path):
    pipe, got = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: got.append(pipe.read_text()))
    reader.start()
    write_text(pipe, "hello")
    reader.join(timeout=600)
    assert got == ["hello"]
    assert pipe.is_fifo()
    assert os.listdir(tmp_path) == ["pipe"]


def test_a_device_is_written_into_and_stays_a_device():
    before = os.stat("/dev/null").st_rdev
    write_text("/dev/null", "nothing")
    assert os.stat("/dev/null").st_rdev == before != 0


@pytest.mark.parametrize("name", ["loop", "x" * 300 + ".txt", "a\0b.txt", "folder"])
def test_what_cannot_be_written_is_named(tmp_path, name):
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match=r"cannot be written|is a folder|zero byte"):
        write_text(str(tmp_path / name), "x")
    assert sorted(os.listdir(tmp_path)) == ["folder", "loop"]


def test_a_folder_that_is_not_there_is_named_and_not_made(tmp_path):
    for write in (lambda path: write_text(path / "page.html", "x"), lambda path: check_folder(path / "out")):
        with pytest.raises(InputError, match=r"no folder '.*misspelt'"):
            write(tmp_path / "misspelt")
    assert os.listdir(tmp_path) == []


def test_devices_pipes_and_giants_are_not_read(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in ("/dev/zero", tmp_path / "pipe"):
        with pytest.raises(InputError, match="is a device or a pipe"):
            read_bytes(path)
    with (tmp_path / "giant.csv").open("wb") as file:
        file.truncate(3 * 1024**3)
    with pytest.raises(InputError, match="has 3,221 MB"):
        read_bytes(tmp_path / "giant.csv")
    with pytest.raises(InputError, match="cannot be the name of a file"):
        read_bytes("a\0b")


def test_a_hundred_thousand_columns_are_refused_quickly(tmp_path, refuse):
    names = ",".join(["time_s", *(f"c{k}" for k in range(100_000))])
    (tmp_path / "wide.csv").write_text(names + "\n" + ",".join(["1"] * 100_001) + "\n")
    assert "unknown column 'c0'" in refuse(["fit", "bias", str(tmp_path / "wide.csv")])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shell", "status", "said"),
    [
        ("hrg cards --json >&-", 3, "standard output is closed"),
        ("hrg effects > /dev/full", 3, "No space left on device"),
        ("PYTHONIOENCODING=ascii hrg cards hrg-30mm > {folder}/out.txt", 0, ""),
        ("cd {folder}/gone && rmdir {folder}/gone && hrg modes free-dome --theory rayleigh > /dev/null", 0, ""),
    ],
)
def test_closed_full_and_plain_terminals(tmp_path, shell, status, said):
    if "/dev/full" in shell and not os.path.exists("/dev/full"):
        pytest.skip("no /dev/full on this system")
    (tmp_path / "gone").mkdir()
    code = "import sys; from studies.cli import run; sys.argv = ['hrg', *sys.argv[1:]]; run()"
    command = shell.replace("hrg ", f'{sys.executable} -c "{code}" ').replace("{folder}", str(tmp_path))
    environment = {**os.environ, "PYTHONPATH": os.getcwd()}
    done = subprocess.run(
        ["sh", "-c", command], capture_output=True, text=True, env=environment, timeout=600, check=False
    )
    assert done.returncode == status, done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_a_request_to_end_counts_as_ctrl_c(tmp_path):
    """SIGTERM during a long study: 130, what was computed is kept, and it can be resumed."""
    (tmp_path / "study.toml").write_text(
        'schema = "hrg.study/1"\nname = "long"\ncard = "free-dome"\n[sampling]\nmethod = "sobol"\ncases = 4096\n'
        'solver = "full"\n[[parameter]]\nname = "resonator.thickness_mm"\nlow = 0.8\nhigh = 1.0\n[[quantity]]\n'
        'name = "frequency"\n'
    )
    code = "import sys; from studies.cli import run; sys.argv = ['hrg', *sys.argv[1:]]; run()"
    words = ["study", "run", str(tmp_path / "study.toml"), "--out", str(tmp_path / "out"), "--workers", "1"]
    environment = {**os.environ, "PYTHONPATH": os.getcwd()}
    process = subprocess.Popen([sys.executable, "-c", code, *words], stderr=subprocess.PIPE, text=True, env=environment)
    while not (tmp_path / "out" / "study.store").exists():
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.05)
    time.sleep(0.3)
    process.terminate()
    _, said = process.communicate(timeout=600)
    assert process.returncode == 130, said
    assert "Traceback" not in said


@pytest.mark.parametrize(
    ("work", "words"),
    [
        ("studies.cli.study.run_study", "study run dimension-tolerance"),
        ("studies.cli.optimise.find_best", "optimise dome-8khz"),
        ("studies.fleet.run.run_lot", "fleet {lot}"),
    ],
)
def test_every_command_that_can_be_resumed_says_so_when_it_is_interrupted(tmp_path, monkeypatch, capsys, work, words):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    (tmp_path / "lot" / "A").mkdir(parents=True)
    monkeypatch.setattr(work, interrupt)
    assert main([*words.format(lot=tmp_path / "lot").split(), "--out", str(tmp_path / "out"), "--quiet"]) == 130
    assert f"interrupted; {tmp_path / 'out'} keeps the finished " in (said := capsys.readouterr().err)
    assert "run the same command again to resume" in said


def test_a_request_to_end_that_falls_into_a_callback_is_not_lost():
    """What is raised in a weak reference's callback, as imports have them, is dropped by the interpreter."""
    script = (
        "import os, signal, sys, time, weakref, studies.cli\n"
        "class A: pass\n"
        "def work():\n"
        "    a = A()\n"
        "    r = weakref.ref(a, lambda _: (os.kill(os.getpid(), signal.SIGTERM), time.sleep(0.01)))\n"
        "    del a\n"
        "    time.sleep(20)\n"
        "studies.cli.main = work\n"
        "studies.cli.run()\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 130
    assert done.stderr == "hrg: interrupted.\n"


@pytest.mark.slow
def test_a_request_to_end_that_is_swallowed_comes_again_but_leaves_clearing_up_alone():
    """Compiled modules clear errors that they do not expect; what clears up after an interruption takes its time."""
    script = (
        "import os, signal, time, studies.cli\n"
        "signal.signal(signal.SIGINT, signal.SIG_DFL)  # a job in the background ignores it\n"
        "def work():\n"
        "    try:\n"
        "        os.kill(os.getpid(), signal.SIGINT)\n"
        "        time.sleep(0.01)\n"
        "    except KeyboardInterrupt:\n"
        "        pass\n"
        "    try:\n"
        "        time.sleep(20)\n"
        "    finally:\n"
        "        time.sleep(1.5)\n"
        "        print('cleared up')\n"
        "studies.cli.main = work\n"
        "studies.cli.run()\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=600, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "cleared up\n", "hrg: interrupted.\n")


def test_an_interruption_that_a_compiled_module_renames_is_one_still(monkeypatch, capsys):
    def fail():
        raise ImportError("initialization failed") from KeyboardInterrupt()

    monkeypatch.setattr("studies.cli.doctor.doctor", fail)
    assert main(["doctor"]) == 130
    assert capsys.readouterr().err == "hrg: interrupted.\n"
