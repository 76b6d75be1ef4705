"""Studies survive what happens to them: kill -9, Ctrl-C, a second runner, changes, damage, a full disk (real processes)."""

import contextlib
import json
import math
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from studies.cli import main
from studies.errors import InputError
from studies.instrument.card import load_card
from studies.sweeps.block import Batch, Cases, Remark
from studies.sweeps.child import Child
from studies.sweeps.export import export_results
from studies.sweeps.opening import claim_store
from studies.sweeps.results import open_results
from studies.sweeps.run import run_study
from studies.sweeps.workers import Pool
from tests.studies.sweeps.processes import environment, rows_of, spec_of

X = 'name = "user.x"\nlow = 0.0\nhigh = 1.0'
PLAIN = """schema = "hrg.study/1"
name = "plain"
card = "free-dome"
sampling = { method = "grid", solver = "full", batch = 1 }
parameter = [{ name = "resonator.thickness_mm", values = [0.8, 0.9, 1.0] }]
quantity = [{ name = "frequency", theory = "rayleigh" }]
"""


def write_slow(folder: Path, cases: int) -> Path:
    """Designs from 0 to 1 in order; the function waits at the first beyond $HRG_TEST_UNTIL, so that no run ends before it is ended."""
    spec = folder / "slow.toml"
    spec.write_text(spec_of("slow", 'method = "grid"\nbatch = 4', f"{X}\ncount = {cases}"))
    return spec


def written(folder: Path, *given: str, **more: float) -> Path:
    """A study as a file."""
    (folder / "spec.toml").write_text(spec_of(*given, **more))
    return folder / "spec.toml"


def wait_for(condition, seconds=600.0):
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until, "waited in vain"
        time.sleep(0.02)


def children_of(pid: int) -> set[int]:
    found = set()
    done = subprocess.run(["ps", "-eo", "pid=,ppid="], capture_output=True, text=True, check=True)
    for line in done.stdout.splitlines():
        child, parent = map(int, line.split())
        if parent == pid:
            found |= {child} | children_of(child)
    return found


def alive(pids: set[int]) -> set[int]:
    """Return which of the processes still run; one that waits to be reaped has ended."""
    left = set()
    for pid in pids:
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
        except FileNotFoundError:
            continue
        left |= {pid} if state != "Z" else set()
    return left


@pytest.mark.slow
def test_many_kills_lose_nothing_kept_and_leave_no_process(tmp_path, functions, start, hrg):
    # a kill loses at most the tasks that were out: two for each of two workers, of at most four batches of four cases
    cases, out = 300, 4 * 16
    slow, log = write_slow(tmp_path, cases), tmp_path / "log"
    log.touch()
    command = ["study", "run", slow, "--out", tmp_path / "out", "--workers", 2, "--allow-python"]
    rng = np.random.default_rng(11)
    kept: dict[int, bytes] = {}
    kills = 0
    while kills < 2:
        goal = len(kept) + int(rng.integers(1, 30))
        process = start(*command, HRG_TEST_LOG=str(log), HRG_TEST_UNTIL=str((goal + out) / cases))
        wait_for(
            lambda process=process, goal=goal: len(rows_of(tmp_path / "out")) >= goal or process.poll() is not None
        )
        assert process.poll() is None, process.communicate()
        family = children_of(process.pid)
        time.sleep(float(rng.uniform(0, 0.1)))
        process.send_signal(signal.SIGKILL)
        process.wait()
        kills += 1
        wait_for(lambda family=family: not alive(family))
        now = {place: numbers for place, _, numbers in rows_of(tmp_path / "out")}
        assert kept.items() <= now.items(), "a kept case was lost or changed"
        kept = now
    assert 0 < len(kept) < cases
    before = Counter(log.read_text().split())
    done = hrg(*command, HRG_TEST_LOG=log)
    assert done.returncode == 0, done.stderr
    after = Counter(log.read_text().split())
    # what was in the store when the last run began is not computed again
    assert len(rows_of(tmp_path / "out")) == cases
    assert sum((after - before).values()) == cases - len(kept) + 1  # and the nominal design
    assert sum(after.values()) - cases - 1 <= kills * out
    whole = hrg("study", "run", slow, "--out", tmp_path / "whole", "--workers", 1, "--allow-python", HRG_TEST_LOG=log)
    assert whole.returncode == 0, whole.stderr
    for folder in ("out", "whole"):
        with contextlib.closing(open_results(tmp_path / folder)) as results:
            export_results(results, tmp_path / folder / "results.csv")
    assert (tmp_path / "out" / "results.csv").read_bytes() == (tmp_path / "whole" / "results.csv").read_bytes()


def test_a_closed_pool_leaves_no_thread():
    """One that is left reads pipes that the end of the interpreter closes, and an interrupt ends in a traceback."""
    pool, before = Pool(2), set(threading.enumerate())
    started = [pool.submit(time.sleep, 0.1) for _ in range(9)]
    started[0].result()
    pool.close()
    assert set(threading.enumerate()) <= before


@pytest.mark.slow
def test_second_runner_is_refused_and_interrupt_is_resumable(tmp_path, functions, start, hrg):
    slow, log = write_slow(tmp_path, 400), tmp_path / "log"
    command = ["study", "run", slow, "--out", tmp_path / "out", "--workers", 2, "--allow-python"]
    first = start(*command, HRG_TEST_LOG=str(log), HRG_TEST_UNTIL="0.5")
    wait_for(lambda: len(rows_of(tmp_path / "out")) > 3)
    second = hrg(*command, HRG_TEST_LOG=log)
    assert second.returncode == 2
    assert f"process {first.pid}" in second.stderr
    state = json.loads(hrg("study", "status", tmp_path / "out", "--json").stdout)
    assert state["state"] == "running"
    family = children_of(first.pid)
    first.send_signal(signal.SIGINT)
    _, said = first.communicate(timeout=600)
    assert first.returncode == 130
    assert "resume" in said
    assert "Traceback" not in said
    wait_for(lambda: not alive(family))
    state = json.loads(hrg("study", "status", tmp_path / "out", "--json").stdout)
    assert state["state"] == "unfinished"
    assert 0 < state["done"] < 400


@pytest.mark.slow
def test_failures_keep_their_reason_and_do_not_stop_the_rest(tmp_path, functions, hrg):
    spec = tmp_path / "moody.toml"
    values = 'name = "user.x"\nvalues = [0, 1, 2, 3, 4, 5, 6]'
    spec.write_text(spec_of("moody", 'method = "grid"', values, limit=3.0))
    done = hrg("study", "run", spec, "--out", tmp_path / "out", "--workers", 2, "--allow-python", "--json")
    assert done.returncode == 4, done.stderr
    found = json.loads(done.stdout)
    assert (found["cases"], found["done"], found["failed"]) == (7, 7, 5)
    reasons = " ".join(entry["reason"] for entry in found["reasons"])
    for part in ("one is not welcome", "time limit of 3 s", "ended its process", "not a finite number", "not a number"):
        assert part in reasons
    assert [status for _, status, _ in sorted(rows_of(tmp_path / "out"))] == ["ok", *["failed"] * 5, "ok"]
    words = ("--workers", 1, "--allow-python", "--report", tmp_path / "run.html")
    again = hrg("study", "run", spec, "--out", tmp_path / "out", *words)
    assert again.returncode == 4
    page = hrg("study", "report", tmp_path / "out")
    assert page.returncode == 0, page.stderr
    for written in (tmp_path / "run.html", tmp_path / "out" / "report.html"):
        assert "one is not welcome" in (shown := written.read_text())
        assert "Provenance" in shown


@pytest.mark.slow
def test_a_function_that_was_killed_is_tried_again_and_its_case_is_lost_and_not_failed(
    tmp_path, functions, monkeypatch
):
    """As the kernel does when memory runs out: once is chance; twice, the next run tries again."""
    monkeypatch.chdir(tmp_path)
    spec = written(tmp_path, "unlucky", 'method = "grid"', 'name = "user.x"\nvalues = [0, 1, 2]')
    with contextlib.closing(run_study(spec, tmp_path / "out", workers=1, allow_python=True)) as results:
        assert results.store.counts() == {"ok": 2, "lost": 1}
        assert "SIGTERM" in results.remark(2)
        assert results.values[1, 0] == 1.0


@pytest.mark.slow
def test_a_design_that_kills_its_worker_is_found_and_the_rest_is_computed(tmp_path, functions, hrg):
    spec = written(
        tmp_path, "murderer", 'method = "grid"\nbatch = 4', 'name = "user.x"\nvalues = [0, 1, 2, 3, 4, 5, 6, 7]'
    )
    done = hrg("study", "run", spec, "--out", tmp_path / "out", "--workers", 2, "--allow-python", "--json")
    assert done.returncode == 4, done.stderr
    found = json.loads(done.stdout)
    assert (found["done"], found["failed"]) == (8, 1)
    assert "worker process ended" in found["reasons"][0]["reason"]
    assert [place for place, status, _ in rows_of(tmp_path / "out") if status == "lost"] == [3]


def test_python_needs_to_be_allowed_and_must_exist(tmp_path, functions, hrg):
    spec = written(tmp_path, "square", 'method = "grid"', 'name = "user.x"\nvalues = [1, 2]')
    refused = hrg("study", "run", spec, "--out", tmp_path / "out")
    assert refused.returncode == 2
    assert "--allow-python" in refused.stderr
    assert not (tmp_path / "out").exists()
    spec.write_text(spec.read_text().replace("functions.py:square", "functions.py:cube"))
    missing = hrg("study", "run", spec, "--out", tmp_path / "out", "--allow-python")
    assert missing.returncode == 2
    assert "cube" in missing.stderr


@pytest.mark.slow
def test_changed_spec_card_or_function_is_refused_with_what_changed(tmp_path, functions):
    spec = tmp_path / "square.toml"
    text = spec_of("square", 'method = "grid"', 'name = "user.x"\nvalues = [1, 2]')

    def run():
        run_study(spec, tmp_path / "out", workers=1, allow_python=True).close()

    spec.write_text(text)
    run()
    for old, new, part in (
        ("[1, 2]", "[1, 3]", "parameter[1].values[2]: 2 -> 3"),
        ('"hrg-30mm"', '"cvg-25mm"', "card.material.name"),
        ("time_limit_s = 30.0", "time_limit_s = 3.0", "time_limit_s: 30.0 -> 3.0"),
    ):
        spec.write_text(text.replace(old, new))
        with pytest.raises(InputError) as caught:
            run()
        assert part in str(caught.value)
    spec.write_text(text + '\n[[requirement]]\ncolumn = "square"\nhigh = 2.0\n')
    run()  # asks nothing new of the solver
    functions.write_text(functions.read_text() + "\n# another function\n")
    with pytest.raises(InputError, match="functions"):
        run()


@pytest.mark.parametrize(
    "spoil",
    [lambda whole: b"this is no store" * 400, lambda whole: whole[:100] + bytes([whole[100] ^ 1]) + whole[101:]],
    ids=["garbage", "what the study is"],
)
def test_a_store_that_is_damaged_is_refused_and_mended_by_a_run(spoil, tmp_path, functions):
    """Without the block that says what the study is, all cases are there: such a store once stayed refused for ever."""
    spec = written(tmp_path, "square", 'method = "grid"', 'name = "user.x"\nlow = 0\nhigh = 1\ncount = 40')
    run_study(spec, tmp_path / "out", workers=1, allow_python=True).close()
    store = tmp_path / "out" / "study.store"
    store.write_bytes(spoil(store.read_bytes()))
    with pytest.raises(InputError, match="damaged"):
        open_results(tmp_path / "out")
    with pytest.warns(UserWarning, match="damaged in 1 place; .* computed again"):
        results = run_study(spec, tmp_path / "out", workers=1, allow_python=True)
    assert results.column("square").tolist() == [x**2 for x in np.linspace(0, 1, 40).tolist()]
    results.close()


@pytest.mark.slow
def test_a_torn_store_holds_what_was_whole(tmp_path, functions, capsys, ask):
    spec = written(tmp_path, "square", 'method = "grid"', 'name = "user.x"\nlow = 0\nhigh = 1\ncount = 400')
    run_study(spec, tmp_path / "out", workers=1, allow_python=True).close()
    path = tmp_path / "out" / "study.store"
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with contextlib.closing(open_results(tmp_path / "out")) as results:
        done = len(results)
        assert 0 < done < 400
    said = ask(["study", "export", str(tmp_path / "out")])
    assert (said["rows"], said["done"], said["cases"]) == (done, done, 400)
    assert main(["study", "export", str(tmp_path / "out")]) == 0
    assert f"{done} of 400 cases are done" in (said := capsys.readouterr().err)
    assert "the end of the last run is missing" in said
    assert main(["study", "status", str(tmp_path / "out")]) == 0
    assert "it was killed, or the file was truncated" in capsys.readouterr().err
    assert main(["study", "export", str(tmp_path / "out"), "--out", str(tmp_path / "out")]) == 2
    assert "this is the folder of the study" in capsys.readouterr().err
    with contextlib.closing(run_study(spec, tmp_path / "out", workers=1, allow_python=True)) as results:
        assert results.column("square").tolist() == [x**2 for x in np.linspace(0, 1, 400).tolist()]
    path.write_bytes(b"")
    with pytest.raises(InputError, match="or the file was truncated"):
        open_results(tmp_path / "out").study  # noqa: B018


@pytest.mark.slow
def test_a_script_without_a_guard_is_told_and_keeps_no_result(tmp_path, functions):
    """Spawned workers run the script again and die: no NaN is stored as finished."""
    spec = tmp_path / "plain.toml"
    spec.write_text(PLAIN)
    script = tmp_path / "script.py"
    script.write_text(
        f"from studies.sweeps.run import run_study\nrun_study({str(spec)!r}, {str(tmp_path / 'out')!r}, workers=2)\n"
    )
    words = [sys.executable, str(script)]
    refused = subprocess.run(words, capture_output=True, text=True, timeout=600, env=environment(), check=False)
    assert refused.returncode != 0
    assert "MissingEnvironment" in refused.stderr
    assert "workers=1" in refused.stderr
    assert rows_of(tmp_path / "out") == []


@pytest.mark.slow
def test_failed_cases_are_computed_again_when_asked(tmp_path, functions, hrg):
    spec = written(tmp_path, "square", 'method = "grid"', 'name = "user.x"\nvalues = [1, 2, 3]')
    run = ("study", "run", spec, "--out", tmp_path / "out", "--workers", 1, "--allow-python", "--json")
    assert hrg(*run).returncode == 0
    nothing = np.full((1, 1), math.nan)
    with closing(claim_store(tmp_path / "out")) as store:
        store.begin_run({})
        batch = Batch(np.array([2]), np.array([[3.0]]))
        store.add(Cases(batch, nothing, nothing, 0.1, (Remark("failed", "a passing fault", [0]),)))
    assert json.loads(hrg(*run).stdout)["failed"] == 1
    assert json.loads(hrg(*run, "--retry-failed").stdout)["failed"] == 0


@pytest.mark.slow
def test_modules_of_the_working_directory_are_not_run_by_workers(tmp_path, monkeypatch):
    (tmp_path / "signal.py").write_text("open('was_run', 'w').write('x')\nraise SystemExit('mine')\n")
    monkeypatch.chdir(tmp_path)
    spec = tmp_path / "spec.toml"
    spec.write_text(PLAIN)
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "hrg.py").write_text("from studies.cli import run\n\nif __name__ == '__main__':\n    run()\n")
    words = [
        sys.executable, str(tmp_path / "bin" / "hrg.py"), "study", "run", str(spec), "--out", str(tmp_path / "out"),
    ]  # fmt: skip
    done = subprocess.run([*words, "--workers", "2"], capture_output=True, text=True, env=environment(), check=False)
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "was_run").exists()


@pytest.mark.slow
def test_other_versions_on_resuming_are_said(tmp_path, functions, hrg):
    spec = written(tmp_path, "square", 'method = "grid"', 'name = "user.x"\nvalues = [1, 2, 3]')
    run = ("study", "run", spec, "--out", tmp_path / "out", "--workers", 1, "--allow-python")
    assert "computed with" not in hrg(*run).stderr
    with closing(claim_store(tmp_path / "out")) as store:
        store.begin_run(json.loads(json.dumps(store.runs[-1]["provenance"]).replace(np.__version__, "1.0.0")))
    assert f"numpy 1.0.0 then, {np.__version__} now" in hrg(*run).stderr


@pytest.mark.slow
def test_too_much_memory_fails_its_case(tmp_path, hrg):
    """A function that asks for 64 GB fails."""
    body = "def glutton(instrument, parameters):\n    return len(bytearray(64 * 1024**3))\n"
    (tmp_path / "functions.py").write_text(body)
    spec = written(tmp_path, "glutton", 'method = "grid"', 'name = "user.x"\nvalues = [2, 3]')
    done = hrg("study", "run", spec, "--out", tmp_path / "out", "--workers", 1, "--allow-python", "--json")
    found = json.loads(done.stdout)
    assert found["failed"] == 2, done.stdout
    assert "MemoryError" in found["reasons"][0]["reason"]


def test_an_interrupt_ends_the_process_of_a_function_in_silence(tmp_path, capfd):
    """Ctrl-C reaches it too, and nobody may read its last answer."""
    body = "import time\ndef nap(instrument, parameters):\n    time.sleep(0.3)\n    return 1\n"
    (tmp_path / "functions.py").write_text(body)
    child = Child(f"{tmp_path / 'functions.py'}:nap")
    instrument = load_card("free-dome")
    request = {"content": instrument.content, "path": instrument.path, "parameters": {}}
    child.pipe.send_bytes(json.dumps(request).encode())
    child.process.send_signal(signal.SIGINT)
    child.pipe.close()
    assert child.process.wait(60) == 0
    child.kill()
    assert capfd.readouterr().err == ""
