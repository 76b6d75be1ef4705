"""Contract of results: the same with any workers, on a cluster, in any order; tables with units; a self-contained page."""

import gc
import json
import shutil
import socket
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from studies.errors import InputError, MissingEnvironment
from studies.reports.sweep import study_result
from studies.results.page import render_result
from studies.sweeps.export import export_results
from studies.sweeps.run import run_study
from tests.studies.sweeps.processes import environment, rows_of, spec_of, words_of

SPEC = {
    "card": "hrg-30mm",
    "sampling": {"method": "sobol", "cases": 8, "seed": 1, "batch": 2},
    "parameter": [{"name": "resonator.thickness_mm", "tolerance": 0.005}],
    "quantity": [{"name": "frequency", "theory": "shell"}, {"name": "bryan-factor", "theory": "shell"}],
    "requirement": [{"column": "frequency_n2_Hz", "within": 20.0}],
}


@pytest.fixture(autouse=True)
def without_pictures(monkeypatch):
    """Pictures and sliders have tests of their own."""
    for name in ("mode_blocks", "moving_mode"):
        monkeypatch.setattr(f"studies.reports.scenes.{name}", lambda *_: [])


@pytest.fixture(scope="module")
def results():
    return run_study(SPEC, workers=1)


def test_table_carries_units(results):
    table = results.table()
    assert list(table.columns) == [
        "resonator.thickness_mm", "frequency_n2_Hz", "frequency_n2_Hz_error", "bryan_factor_n2", "status", "remark",
    ]  # fmt: skip
    assert table.attrs["units"]["frequency_n2_Hz"] == "Hz"
    assert len(table) == 8


def test_no_cell_of_an_export_is_a_formula(tmp_path):
    import pandas as pd

    frame = pd.DataFrame({"=1+1": [-1.0], "remark": ["@SUM(A1)"]})
    study = SimpleNamespace(name="one")
    export_results(
        SimpleNamespace(header=list(frame), frames=lambda: [frame], study=study, units={}), tmp_path / "t.csv"
    )
    assert (tmp_path / "t.csv").read_text() == "'=1+1,remark\n-1.0,'@SUM(A1)\n"


def test_parquet_has_the_digits_and_the_units(results, tmp_path):
    """One file, and a data set of parts of three designs, in order; a folder with old parts is refused."""
    import pandas as pd

    parquet = pytest.importorskip("pyarrow.parquet")
    export_results(results, tmp_path / "one.parquet")
    export_results(results, tmp_path / "many", 3)
    table = results.table()
    one, many = pd.read_parquet(tmp_path / "one.parquet"), pd.read_parquet(tmp_path / "many")
    for column in table:
        assert one[column].tolist() == many[column].tolist() == table[column].tolist()
    assert sorted(path.name for path in (tmp_path / "many").iterdir()) == [f"part-0000{k}.parquet" for k in range(3)]
    schema = parquet.read_schema(tmp_path / "many" / "part-00002.parquet")
    assert schema.field("frequency_n2_Hz").metadata == {b"unit": b"Hz"}
    with pytest.raises(InputError, match="no old part"):
        export_results(results, tmp_path / "many", 3)


def test_values_are_those_of_the_solver(results):
    from shell.modes import solve_modes
    from studies.sweeps.parameters import set_parameters

    instrument = set_parameters(results.study.instrument, results.design(3))
    (mode,) = solve_modes(*instrument.at(instrument.reference_temperature), 2, 1, "shell")
    assert results.values[3, 0] == pytest.approx(mode.frequency, rel=1e-12)
    assert results.values[3, 1] == pytest.approx(mode.bryan_factor, rel=1e-10)


def test_page_is_self_contained_and_escapes(results):
    hostile = replace(results, study=replace(results.study, name="<script>alert(1)</script>"))
    page = render_result(study_result(hostile))
    assert "<script>alert" not in page
    assert "https://" not in page.split("<footer")[0]
    for part in ("Influence of the parameters", "Tolerances", "Provenance", "sortable", "thickness (mm)"):
        assert part in page


def test_page_of_a_study_of_which_nothing_is_computed_yet(results):
    from studies.sweeps.results import Results
    from studies.sweeps.store import memory_store

    empty = memory_store()
    empty.describe(results.store.about() | {"cases": 8})
    page = render_result(study_result(Results(results.study, empty)))
    assert "not finished" in page
    assert len(Results(results.study, empty).table()) == 0


def test_template_over_temperature_gives_table_1_and_2_for_any_card(tmp_path):
    found = run_study("frequency-over-temperature", tmp_path / "out", card="cvg-25mm", workers=1)
    assert found.study.instrument.name == "cvg-25mm"
    assert found.parameter("temperature_degC").tolist() == [-20, -10, 0, 10, 20, 30, 40]
    page = render_result(study_result(found))
    assert "Temperature from frequency" in page
    assert "Coefficients about T0" in page
    found.close()


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def started(file: Path, protocol: str = "tcp", *given: str, workers: int = 2):
    """Run a scheduler of Dask and workers as processes, the scheduler first; it writes its address to a file."""
    common = ["--scheduler-file", str(file), "--no-dashboard", *given]
    commands = (
        ["scheduler", "--host", f"{protocol}://127.0.0.1", "--port", "0", *common],
        *[["worker", "--no-nanny", "--nthreads", "1", *common]] * workers,
    )
    quiet = {"DASK_DISTRIBUTED__LOGGING__DISTRIBUTED": "error", "HRG_TEST_UNTIL": "0.02"}
    processes = [
        subprocess.Popen([sys.executable, "-m", "dask", *words], env=environment(**quiet), stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        for words in commands
    ]  # fmt: skip
    until = time.monotonic() + 120
    while not (file.exists() and file.read_text().endswith("}")) and time.monotonic() < until:
        time.sleep(0.1)
    try:
        yield json.loads(file.read_text())["address"], *processes
    finally:
        for process in reversed(processes):
            process.terminate()
        for process in processes:
            try:
                process.wait(60)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


BRIEF = """
import studies.sweeps.cluster as module
check, module.PATIENCE = module.Cluster.check, 120.0
def brief(self):
    module.PATIENCE = 2.0  # once there are workers
    check(self)
module.Cluster.check = brief
"""


def started_slowly(folder, address, **more):
    """A study of slow cases that does not end, on a cluster, as a process of its own, when its first results are in the store."""
    spec = folder / "study.toml"
    spec.write_text(spec_of("slow", 'method = "grid"\nbatch = 4', 'name = "user.x"\nlow = 0\nhigh = 1\ncount = 3000'))
    words = words_of("study", "run", str(spec), "--out", str(folder / "out"), "--scheduler", address, "--allow-python")
    words[2] = BRIEF + words[2]
    run = subprocess.Popen(
        words, stderr=subprocess.PIPE, text=True, env=environment(HRG_TEST_LOG=str(folder / "log"), **more)
    )
    until = time.monotonic() + 600
    while run.poll() is None and time.monotonic() < until and not rows_of(folder / "out"):
        time.sleep(0.1)
    return run


@pytest.mark.slow
def test_a_study_whose_scheduler_is_lost_is_resumable(tmp_path, functions):
    pytest.importorskip("distributed", reason="the extra 'cluster' (dask[distributed]) is not installed")
    with started(tmp_path / "scheduler.json", workers=1) as (address, scheduler, _):
        run = started_slowly(tmp_path, address)
        scheduler.kill()
        _, said = run.communicate(timeout=600)
    assert run.returncode == 3, said
    assert "resume" in said
    assert "Traceback" not in said
    assert 0 < len(rows_of(tmp_path / "out")) < 3000


@pytest.mark.parametrize(
    ("address", "public"),
    [
        ("tcp://8.8.8.8:8786", True), ("8.8.8.8:8786", True), ("tcp://[2001:4860:4860::8888]:8786", True), ("ws://1.1.1.1:80", True),
        ("tls://8.8.8.8:8786", False), ("tcp://127.0.0.1:8786", False), ("tcp://192.168.1.7:8786", False), ("[::1]:8786", False),
        ("tcp://10.0.0.9:8786", False), ("tcp://8.8.8.8.:8786", True), ("tcp://user@0x08080808:8786", True),
        ("tcp://8.8.8.8", True), ("tcp://[::ffff:8.8.8.8]:8786", True), ("tcp://user@127.0.0.1.:8786", False), ("tcp://nowhere.invalid:8786", False),
    ],
)  # fmt: skip
def test_a_public_scheduler_needs_encryption(address, public):
    from studies.sweeps.cluster import check_private

    with pytest.raises(InputError, match="public address without encryption") if public else nullcontext():
        check_private(address)


def test_a_public_scheduler_is_refused_before_any_work_of_an_interpolated_study_too(tmp_path, refuse):
    """Whoever imitates the scheduler could send objects that run code; an interpolated study once took the address in silence."""
    (tmp_path / "spec.toml").write_text(
        'schema = "hrg.study/1"\nname = "two"\ncard = "free-dome"\nsampling = { solver = "family", method = "grid" }\n'
        'parameter = [{ name = "resonator.radius_mm", values = [15.0, 15.1] }]\nquantity = [{ name = "frequency", theory = "shell" }]\n'
    )
    words = ["study", "run", str(tmp_path / "spec.toml"), "--out", str(tmp_path / "out"), "--scheduler", "tcp://8.8.8.8:8786"]  # fmt: skip
    assert "a public address without encryption" in refuse(words)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("greeting", [b"", b"SSH-2.0-OpenSSH_9.2p1 Debian-2\r\n"], ids=["silent", "ssh"])
def test_a_server_that_is_no_scheduler_is_named(greeting, monkeypatch):
    """A silent one kept the study waiting for ever; the greeting of another was taken for a length that no memory holds."""
    pytest.importorskip("distributed")
    from studies.sweeps import cluster

    def serve():
        with suppress(OSError), ExitStack() as kept:
            while True:
                kept.enter_context(server.accept()[0]).sendall(greeting)

    monkeypatch.setattr(cluster, "GREETING", 2.0)
    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=serve)
        thread.start()
        with pytest.raises(MissingEnvironment, match="this is no Dask scheduler"):
            cluster.Cluster(f"tcp://127.0.0.1:{server.getsockname()[1]}")
        server.shutdown(socket.SHUT_RDWR)
        thread.join()


@pytest.mark.slow
def test_two_workers_with_certificates_give_the_same_bits_and_the_end_of_its_last_worker_is_said(
    tmp_path, results, functions, monkeypatch
):
    """Certificates as `openssl` makes them; the client takes them from Dask's own configuration."""
    pytest.importorskip("distributed", reason="the extra 'cluster' (dask[distributed]) is not installed")
    if shutil.which("openssl") is None:
        pytest.skip("openssl is not installed")
    key, cert = tmp_path / "key.pem", tmp_path / "cert.pem"
    ask = f"openssl req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=localhost -addext subjectAltName=IP:127.0.0.1 -keyout {key} -out {cert}"
    subprocess.run(ask.split(), check=True, capture_output=True)
    monkeypatch.setattr("studies.sweeps.cluster.PATIENCE", 120.0)
    given = ["--tls-ca-file", str(cert), "--tls-cert", str(cert), "--tls-key", str(key)]
    with started(tmp_path / "scheduler.json", "tls", *given) as (address, _, *workers):
        with pytest.raises(MissingEnvironment, match=r"distributed\.comm\.tls"):
            run_study(SPEC, scheduler=address)
        import dask

        tls = {"ca-file": str(cert), "client.cert": str(cert), "client.key": str(key)}
        with dask.config.set({f"distributed.comm.tls.{name}": path for name, path in tls.items()}):
            again = run_study(SPEC, scheduler=address)
        assert again.values.tobytes() == results.values.tobytes()
        spelled = {name.upper().replace("-", "_").replace(".", "__"): path for name, path in tls.items()}
        run = started_slowly(
            tmp_path, address, **{f"DASK_DISTRIBUTED__COMM__TLS__{name}": path for name, path in spelled.items()}
        )
        for worker in workers:
            worker.terminate()
        _, said = run.communicate(timeout=600)
    assert run.returncode == 3, said
    assert "the last worker has ended" in said
    assert "no worker is left" in said
    assert "Traceback" not in said


def test_missing_dask_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "dask", None)
    with pytest.raises(MissingEnvironment, match=r"hrg-workbench\[cluster\]"):
        run_study(SPEC, scheduler="tcp://127.0.0.1:1")


@pytest.mark.slow
@pytest.mark.parametrize("protocol", ["tcp", "tls"])
def test_no_scheduler_is_said(protocol, monkeypatch):
    pytest.importorskip("distributed", reason="the extra 'cluster' (dask[distributed]) is not installed")
    for wait in ("GREETING", "PATIENCE"):
        monkeypatch.setattr(f"studies.sweeps.cluster.{wait}", 1.0)
    with pytest.raises(MissingEnvironment, match="certificates" if protocol == "tls" else "no scheduler"):
        run_study(SPEC, scheduler=f"{protocol}://127.0.0.1:{free_port()}")
    distributed = sys.modules["distributed"]
    left = [one.status for one in gc.get_objects() if issubclass(type(one), distributed.Client)]
    assert set(left) <= {"closed"}, "collected while another client starts, it would wait for that one's lock"


@pytest.mark.slow
def test_a_store_that_is_forgotten_is_closed():
    from studies.sweeps.store import memory_store

    store = memory_store()
    file = store.file.file
    del store
    gc.collect()
    assert file.closed
