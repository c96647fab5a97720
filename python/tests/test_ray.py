"""lotpilot.ray on a local cluster: the bytes of one process, though a node dies half-way."""

import os
import subprocess
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import lotpilot

ray = pytest.importorskip("ray")
from ray.cluster_utils import Cluster  # noqa: E402

import lotpilot.ray  # noqa: E402

LOTS = os.environ.get("LOTPILOT_RAY_LOTS", "test:24:easy")
SHARDS = int(os.environ.get("LOTPILOT_RAY_SHARDS", "12"))
# These say who wrote the run, and when.
DIFFER = {"manifest.toml", "sha256sums", "wall_time.jsonl", ".lock"}


def files(folder):
    found = (path for path in folder.rglob("*") if path.is_file() and path.name not in DIFFER)
    return {str(path.relative_to(folder)): path.read_bytes() for path in found}


@pytest.fixture
def cluster():
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    nodes = [cluster.add_node(num_cpus=1) for _ in range(2)]
    cluster.wait_for_nodes()
    ray.init(address=cluster.address, log_to_driver=False)
    yield cluster, nodes
    ray.shutdown()
    cluster.shutdown()


def test_a_node_dies_and_the_tables_are_those_of_one_process(cluster, tmp_path):
    cluster, nodes = cluster

    def straight(grids):  # in here, as the nodes know nothing of this file
        return np.tile([8.0, 0.0], (len(grids), 1))

    drivers = {"tentacle": "tentacle", "straight": straight}
    options = {"trials": 1, "noise": ["clean", 1.5], "overrides": ["episode.metrics.events_max=10"]}
    one = time.monotonic()
    tables = lotpilot.evaluate(drivers, LOTS, out=tmp_path / "one", **options)
    one = time.monotonic() - one
    expected = files(tmp_path / "one")
    out, folder = tmp_path / "ray", tmp_path / "ray.shards"
    killed = []

    def done():
        return sum(path.name.isdigit() for path in folder.glob("*"))

    def kill():
        while done() < SHARDS // 2:
            time.sleep(0.02)
        cluster.remove_node(nodes[1], allow_graceful=False)
        killed.append(done())

    killer = threading.Thread(target=kill)
    killer.start()
    began = time.monotonic()
    found = lotpilot.ray.evaluate(drivers, LOTS, shards=SHARDS, out=out, **options)
    took = time.monotonic() - began
    killer.join()
    assert killed[0] < SHARDS
    print(f"one process {one:.1f} s; three nodes, of which one died after {killed[0]} of {SHARDS} shards, {took:.1f} s")
    assert found == tables
    assert files(out) == expected
    # Ray notices a dead node some seconds later.
    until = time.monotonic() + 60
    while (alive := sum(node["Alive"] for node in ray.nodes())) > 2 and time.monotonic() < until:
        time.sleep(0.2)
    assert alive == 2

    # Shards that are there are not driven again.
    out.rename(tmp_path / "first")
    before = (folder / "3/runs.jsonl").stat().st_mtime_ns
    lotpilot.ray.evaluate(drivers, LOTS, shards=SHARDS, out=out, **options)
    assert files(out) == expected and (folder / "3/runs.jsonl").stat().st_mtime_ns == before
    with pytest.raises(FileExistsError, match="exists already"):
        lotpilot.ray.evaluate(drivers, LOTS, shards=SHARDS, out=out, **options)
    out.rename(tmp_path / "second")
    with pytest.raises(FileExistsError, match="other arguments"):
        lotpilot.ray.evaluate("expert", shards=SHARDS, out=out)

    def straight(grids):
        return np.tile([7.0, 0.0], (len(grids), 1))

    with pytest.warns(UserWarning, match="pickled differently"):
        lotpilot.ray.evaluate({**drivers, "straight": straight}, LOTS, shards=SHARDS, out=out, **options)


def test_what_cannot_be_driven_is_one_clear_error(cluster, tmp_path, monkeypatch):
    def broken(grids):
        raise KeyError("weights")

    def drive(driver, out, lots="lot-b", **options):
        return lotpilot.ray.evaluate(driver, lots, trials=1, shards=2, out=tmp_path / out, **options)

    with pytest.raises(lotpilot.ray.ShardError, match='"lot-z" is not a lot'):
        drive("expert", "a", lots="lot-z")
    assert '"lot-z" is not a lot' in (tmp_path / "a.shards/failures.txt").read_text(encoding="utf-8")
    with pytest.raises(lotpilot.ray.ShardError, match="KeyError: 'weights'"):
        drive({"broken": broken}, "b")
    for wrong, part in [
        ({"cpus": 0}, "cpus: 0 is not"),
        ({"retries": 2**70}, "retries"),
        ({"cpus": 2.5}, "cpus: 2.5 is not"),
    ]:
        with pytest.raises(ValueError, match=part):
            drive("expert", "c", **wrong)
    with pytest.raises(TypeError, match="overwrite"):
        drive("expert", "d", overwrite=True)
    # A node without the wheel, and one with another.
    with monkeypatch.context() as other:
        other.setattr(lotpilot.ray, "_digest", lambda: "another")
        with pytest.raises(lotpilot.ray.ShardError, match="another lotpilot than the caller; install the same wheel"):
            drive("expert", "e")
    (tmp_path / "lotpilot.py").write_text("raise ImportError('not installed')")
    monkeypatch.setattr(lotpilot.ray, "_environment", lambda cpus: {"PYTHONPATH": str(tmp_path)})
    with pytest.raises(lotpilot.ray.ShardError, match=r"has no lotpilot .*; install the same wheel on every node"):
        drive("expert", "f")


def test_generate_leaves_what_else_is_in_its_folder(cluster, tmp_path, monkeypatch):
    """It took a ``failures.txt`` for its own: deleted it, and added to it."""
    out = tmp_path / "lots"
    out.mkdir()
    (out / "failures.txt").write_text("of the caller")
    with monkeypatch.context() as other:
        other.setattr(lotpilot.ray, "_digest", lambda: "another")
        with pytest.raises(lotpilot.ray.ShardError, match="another lotpilot"):
            lotpilot.ray.generate("train:2:easy", shards=2, out=out)
    reasons = tmp_path / "lots.shards" / "failures.txt"
    assert "another lotpilot" in reasons.read_text(encoding="utf-8")
    lotpilot.ray.generate("train:2:easy", shards=2, out=out)
    assert (out / "failures.txt").read_text() == "of the caller" and not reasons.exists()


def test_generate_writes_the_files_of_one_process(cluster, tmp_path):
    one = lotpilot.generate("train:6:easy", out=tmp_path / "one")
    found = lotpilot.ray.generate("train:6:easy", shards=4, out=tmp_path / "ray")
    assert files(tmp_path / "ray") == files(tmp_path / "one") != {}
    assert {name: found[name] for name in ("name", "route_m", "obstacles")} == {
        name: one[name] for name in ("name", "route_m", "obstacles")
    }


def test_a_reproduction_comes_to_the_files_of_one_process(cluster, tmp_path, monkeypatch):
    program = Path(__file__).parents[2] / "target/debug/xtask"
    if not program.exists():
        pytest.skip("cargo build -p xtask makes the program that nodes are sent")
    monkeypatch.chdir(tmp_path)
    command = [program, "--quiet", "reproduce", "--preset", "smoke", "--out"]
    subprocess.run([*command, "run"], check=True, capture_output=True)
    expected = files(tmp_path / "run")
    Path("run").rename("one")
    found = lotpilot.ray.reproduce("--preset", "smoke", shards=3, out="run", program=program)
    assert "DAgger has fewer near-collisions" in found
    assert files(tmp_path / "run") == expected
    assert len(expected) > 200
    with pytest.raises(FileExistsError, match="exists already"):
        lotpilot.ray.reproduce("--preset", "smoke", shards=3, out="run", program=program)
    with pytest.raises(FileExistsError, match="other arguments"):
        Path("run").rename("ray")
        lotpilot.ray.reproduce("--preset", "paper", shards=3, out="run", program=program)
    # What was misspelt may be called right; files are looked for from here.
    with pytest.raises(lotpilot.ray.ShardError, match="papier"):
        lotpilot.ray.reproduce("--preset", "papier", shards=2, out="wrong", program=program)
    Path("mine.toml").write_text("dagger.eta = 7.0\n")
    with pytest.raises(lotpilot.ray.ShardError, match=r"dagger\.eta"):
        lotpilot.ray.reproduce("--config", "mine.toml", shards=2, out="wrong", program=program)
    Path("other").mkdir()
    with pytest.raises(FileExistsError, match="exists already"):
        lotpilot.ray.reproduce(shards=2, out="other", program=program)
    with pytest.raises(FileNotFoundError, match="cargo build -p xtask"):
        lotpilot.ray.reproduce(shards=2, out="new", program="no/xtask")
    with pytest.raises(ValueError, match="below the working folder"):
        lotpilot.ray.reproduce(shards=2, out=tmp_path.parent / "elsewhere", program=program)
