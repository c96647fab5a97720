"""lotpilot.ray on a local cluster: the bytes of one process, though a node dies half-way."""

import os
import subprocess
import threading
import time
from pathlib import Path

import pytest

ray = pytest.importorskip("ray")
from ray.cluster_utils import Cluster  # noqa: E402

import lotpilot.ray  # noqa: E402

ROOT = Path(__file__).parents[2]
PROGRAM = Path(os.environ.get("LOTPILOT_PROGRAM") or ROOT / "target/debug/xtask")
LOTS = os.environ.get("LOTPILOT_RAY_LOTS", "test:24:easy")
SHARDS = int(os.environ.get("LOTPILOT_RAY_SHARDS", "12"))
# These say who wrote the run, and when.
DIFFER = {"manifest.toml", "report.html", "report.md", "sha256sums", "wall_time.jsonl", ".lock"}

pytestmark = pytest.mark.skipif(not PROGRAM.is_file(), reason=f"{PROGRAM} is not built")


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
    arguments = ["--driver", "tentacle", "cvm", "--lots", LOTS, "--noise", "clean,1.5"]
    # Into the same folder one after the other: reports name it.
    out = tmp_path / "run"
    one = time.monotonic()
    subprocess.run([PROGRAM, "--quiet", "evaluate", *arguments, "--out", out], check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
    one = time.monotonic() - one
    expected = files(out)
    out.rename(tmp_path / "one")
    killed = []

    def kill():
        folder = tmp_path / "run.shards"
        while sum(path.suffix == "" for path in folder.glob("[0-9]*")) < SHARDS // 2:
            time.sleep(0.02)
        cluster.remove_node(nodes[1], allow_graceful=False)
        killed.append(len(list(folder.glob("[0-9]*"))))

    killer = threading.Thread(target=kill)
    killer.start()
    began = time.monotonic()
    found = lotpilot.ray.evaluate(arguments, shards=SHARDS, out=out, program=PROGRAM)
    print(f"one process {one:.1f} s, three nodes of which one died after {SHARDS // 2} of {SHARDS} shards {time.monotonic() - began:.1f} s")
    killer.join()
    assert killed and killed[0] < SHARDS
    assert files(found) == expected
    assert sum(node["Alive"] for node in ray.nodes()) == 2

    # Shards that are there are not driven again.
    out.rename(tmp_path / "first")
    shard = tmp_path / "run.shards/3/runs.jsonl"
    before = shard.stat().st_mtime_ns
    lotpilot.ray.evaluate(arguments, shards=SHARDS, out=out, program=PROGRAM)
    assert files(out) == expected and shard.stat().st_mtime_ns == before
    with pytest.raises(FileExistsError, match="exists already"):
        lotpilot.ray.evaluate(arguments, shards=SHARDS, out=out, program=PROGRAM)
    out.rename(tmp_path / "second")
    with pytest.raises(FileExistsError, match="other arguments"):
        lotpilot.ray.evaluate(["--driver", "expert"], shards=SHARDS, out=out, program=PROGRAM)


def test_what_cannot_be_driven_is_one_clear_error(cluster, tmp_path):
    with pytest.raises(lotpilot.ray.ShardError, match='no lot "lot-z"'):
        lotpilot.ray.evaluate(["--driver", "expert", "--lots", "lot-z"], shards=2, out=tmp_path / "a", program=PROGRAM)
    assert 'no lot "lot-z"' in (tmp_path / "a.shards/failures.txt").read_text(encoding="utf-8")
    with pytest.raises(lotpilot.ray.ShardError, match="there is no such program"):
        lotpilot.ray.evaluate(["--driver", "expert"], shards=2, out=tmp_path / "b", program=tmp_path / "nothing")
    with pytest.raises(ValueError, match="--shard is not for shards"):
        lotpilot.ray.evaluate(["--shard", "1/2"], shards=2, out=tmp_path / "c", program=PROGRAM)


def test_generate_writes_the_files_of_one_process(cluster, tmp_path):
    arguments = ["--lots", "train:6:easy"]
    subprocess.run([PROGRAM, "--quiet", "generate", *arguments, "--out", tmp_path / "one"], check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
    lotpilot.ray.generate(arguments, shards=3, out=tmp_path / "ray", program=PROGRAM)
    assert files(tmp_path / "ray") == files(tmp_path / "one") != {}
