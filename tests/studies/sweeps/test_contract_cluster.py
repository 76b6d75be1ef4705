"""What `--scheduler` trusts: nothing public without encryption; with certificates the same values as here."""

import shutil
import subprocess

import pytest

from studies.cli import main
from studies.sweeps.results import open_results

STUDY = """schema = "hrg.study/1"
name = "two"
card = "free-dome"
[sampling]
solver = "{solver}"
method = "grid"
[[parameter]]
name = "resonator.radius_mm"
values = [15.0, 15.1]
[[quantity]]
name = "frequency"
theory = "shell"
"""


@pytest.fixture(params=["full", "family"])
def spec(request, tmp_path):
    path = tmp_path / f"{request.param}.toml"
    path.write_text(STUDY.format(solver=request.param))
    return path


@pytest.mark.parametrize(
    "address", ["tcp://8.8.8.8:8786", "8.8.8.8:8786", "ws://8.8.8.8:80", "tcp://[2606:4700::1]:8786"]
)
def test_a_public_address_without_encryption_is_refused_before_any_work(spec, address, refuse, tmp_path):
    """Whoever imitates the scheduler could send objects that run code; an interpolated study once took the address in silence."""
    said = refuse(["study", "run", str(spec), "--out", str(tmp_path / "out"), "--scheduler", address])
    assert "a public address without encryption" in said
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl to make a certificate")
def test_a_cluster_with_certificates_gives_the_values_of_this_machine(tmp_path, capsys):
    dask, distributed = pytest.importorskip("dask"), pytest.importorskip("distributed")
    cert, key, spec = (str(tmp_path / name) for name in ("cert.pem", "key.pem", "full.toml"))
    make = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=test"]
    subprocess.run([*make, "-keyout", key, "-out", cert], check=True, capture_output=True)
    (tmp_path / "full.toml").write_text(STUDY.format(solver="full"))
    both = {
        f"tls_{who}_{what}": path
        for who in ("client", "scheduler", "worker")
        for what, path in (("cert", cert), ("key", key))
    }
    security = distributed.Security(tls_ca_file=cert, require_encryption=True, **both)
    tls = "distributed.comm.tls"
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, security=security, dashboard_address=None
    ) as cluster:
        words = ["study", "run", spec, "--quiet", "--scheduler", cluster.scheduler_address, "--out"]
        assert main([*words, str(tmp_path / "none")]) == 3
        assert "encryption needs certificates" in capsys.readouterr().err
        with dask.config.set({f"{tls}.ca-file": cert, f"{tls}.client.cert": cert, f"{tls}.client.key": key}):
            assert main([*words, str(tmp_path / "there")]) == 0
    assert main(["study", "run", spec, "--quiet", "--workers", "1", "--out", str(tmp_path / "here")]) == 0
    there, here = (open_results(tmp_path / name).to_frame() for name in ("there", "here"))
    assert there.equals(here)
