"""What a training collected, as other programs read it."""

import json

import numpy as np
import pytest
from test_episodes import write_round, write_sums

import lotpilot
from lotpilot import exports


@pytest.fixture
def dataset(tmp_path):
    run = tmp_path / "run"
    run.mkdir()
    (run / "settings.toml").write_text(lotpilot.settings("smoke"))
    write_sums(run)
    rng = np.random.default_rng(0)
    for number, count in enumerate((5, 3)):
        grids = rng.integers(0, 2, (count, 25, 25)).astype(np.uint8)
        write_round(run, number, grids, rng.uniform(0, 1, (count, 2)).astype(np.float32))
    return lotpilot.Dataset(run)


def test_episodes_are_parted_and_their_actions_are_those_of_the_environments(dataset):
    first, second = exports.episodes(dataset)
    assert (len(first.grids), len(second.grids)) == (5, 3)
    np.testing.assert_array_equal(np.concatenate([first.grids, second.grids]), dataset.grids)
    np.testing.assert_array_equal(first.states[:, 0], np.arange(5))
    # As an environment takes them: -1 … 1 is 4.3 … 16.3 m ahead and -6 … 6 m to the left.
    low, high = np.array([4.3, -6.0]), np.array([16.3, 6.0])
    np.testing.assert_allclose(low + 0.5 * (first.actions + 1.0) * (high - low), first.points, atol=1e-5)


def test_imitation_reads_one_trajectory_per_episode(dataset):
    pytest.importorskip("imitation")
    from imitation.data import rollout

    trajectories = exports.to_imitation(dataset)
    assert [len(trajectory) for trajectory in trajectories] == [4, 2]
    transitions = rollout.flatten_trajectories(trajectories)
    np.testing.assert_array_equal(transitions.obs[:4], dataset.grids[:4])
    assert (np.abs(transitions.acts) <= 1).all()


def test_lerobot_finds_every_frame_where_the_format_says(dataset, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    pd = pytest.importorskip("pandas")
    root = tmp_path / "lerobot"
    exports.to_lerobot(dataset, root)
    info = json.loads((root / "meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"]) == ("v3.0", 20)
    assert (info["total_episodes"], info["total_frames"]) == (2, 8)
    episodes = parquet.read_table(root / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [(row["dataset_from_index"], row["dataset_to_index"]) for row in episodes] == [(0, 5), (5, 8)]
    place = {"chunk_index": episodes[0]["data/chunk_index"], "file_index": episodes[0]["data/file_index"]}
    table = parquet.read_table(root / info["data_path"].format(**place))
    assert table.column_names == list(info["features"])
    columns = table.to_pydict()
    grids = np.array(columns["observation.environment_state"]).reshape(-1, 25, 25)
    np.testing.assert_array_equal(grids, dataset.grids)
    np.testing.assert_allclose(columns["action"], dataset.points)
    assert columns["frame_index"] == [0, 1, 2, 3, 4, 0, 1, 2] and columns["index"] == list(range(8))
    np.testing.assert_allclose(columns["timestamp"][:3], [0, 0.05, 0.1])
    assert pd.read_parquet(root / "meta/tasks.parquet").loc[episodes[0]["tasks"][0]]["task_index"] == 0
    stats = json.loads((root / "meta/stats.json").read_text())
    np.testing.assert_allclose(stats["action"]["mean"], dataset.points.mean(0), rtol=1e-5)
    assert stats["action"]["count"] == [8]
    with pytest.raises(FileExistsError):
        exports.to_lerobot(dataset, root)
    (tmp_path / "mine").mkdir()
    with pytest.raises(FileExistsError):
        exports.to_lerobot(dataset, tmp_path / "mine")


def test_lerobot_reads_it(dataset, tmp_path, monkeypatch):
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    reader = pytest.importorskip("lerobot.datasets.lerobot_dataset")
    exports.to_lerobot(dataset, tmp_path / "lerobot")
    found = reader.LeRobotDataset("lotpilot/run", root=tmp_path / "lerobot")
    assert (found.num_episodes, found.num_frames, found.fps) == (2, 8, 20)
    for index, (grid, point) in enumerate(zip(dataset.grids, dataset.points, strict=True)):
        frame = found[index]
        np.testing.assert_array_equal(frame["observation.environment_state"].reshape(25, 25), grid)
        np.testing.assert_allclose(frame["action"], point)
        assert frame["episode_index"] == int(index >= 5)
