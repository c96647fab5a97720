"""What a training collected, in the formats of other programs."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .core import GRID_CELLS, Floats, Grids
from .data import Dataset

TASK = "drive to the end of the route"
"""What LeRobot is told that all episodes are about."""


@dataclass(frozen=True)
class Labelled:
    """The samples of one episode, in their order."""

    grids: Grids
    """What was seen, uint8 [n, 25, 25]."""
    states: Floats
    """Speed in m/s and road-wheel angle in radians, float32 [n, 2]."""
    points: Floats
    """Where the expert would have headed, float32 [n, 2]: ahead and left, metres."""
    actions: Floats
    """The same as the normalised actions of the environments, where -1 … 1 is what is seen."""


def episodes(dataset: Dataset) -> Iterator[Labelled]:
    """The episodes of all rounds, oldest first."""
    for data in dataset.rounds:
        # Image fractions count from the upper left corner: to the right, and towards the car.
        right, near = data["image_fractions"].T
        actions = np.stack([1.0 - 2.0 * near, 1.0 - 2.0 * right], axis=1).astype(np.float32)
        states = np.stack([data["speed_mps"], data["steering_rad"]], axis=1)
        for number in np.unique(data["episode"]):
            own = np.flatnonzero(data["episode"] == number)
            own = own[np.argsort(data["tick"][own], kind="stable")]
            yield Labelled(data["grids"][own], states[own], data["points"][own], actions[own])


def to_imitation(dataset: Dataset) -> list[Any]:
    """Demonstrations for ``imitation``: one ``Trajectory`` per episode.

    Observations are grids, actions the expert's points, normalised as in ``lotpilot.sb3.LotVecEnv``, also where the
    novice drove. A trajectory ends with an observation, so the last label of an episode is left out. Samples that a
    training did not keep are gaps, which behaviour cloning and DAgger do not mind.

    Raises:
        ImportError: If ``imitation`` is not installed.
    """
    from imitation.data.types import Trajectory

    return [
        Trajectory(obs=episode.grids, acts=episode.actions[:-1], infos=None, terminal=True)
        for episode in episodes(dataset)
        if len(episode.grids) > 1
    ]


def to_lerobot(dataset: Dataset, folder: str | os.PathLike[str]) -> None:
    """Writes a data set in the LeRobot format v3.0, for the policies that learn from a state of the surroundings.

    ``observation.environment_state``: the grid row by row, float32 [625], 1 is non-drivable; ``observation.state``:
    speed in m/s and road-wheel angle in radians; ``action``: the expert's point, ahead and left in metres. Frames
    are a control period apart by their ``timestamp``, as the format wants it; samples that a training did not keep, and
    the time that a car needs after a near-collision, are left out of it.

    Args:
        dataset: What was collected.
        folder: Must not exist.

    Raises:
        FileExistsError: If the folder exists.
        ValueError: If a second is no whole number of control periods: the format knows whole frames per second only.
        ImportError: If pandas or pyarrow is not installed: ``pip install "lotpilot[lerobot]"``.
    """
    import pandas as pd
    import pyarrow as pa
    from pyarrow import parquet

    exact = 1.0 / dataset.rounds[0]["control_period_s"]
    frames_per_s = round(exact)
    if abs(exact - frames_per_s) > 1e-3:
        raise ValueError(f"{exact:.3f} frames per second: LeRobot knows whole numbers only; collect with another control period")
    root = Path(folder)
    root.mkdir(parents=True)
    (root / "meta/episodes/chunk-000").mkdir(parents=True)
    (root / "data/chunk-000").mkdir(parents=True)
    features = {
        "observation.environment_state": _feature("float32", [f"{row},{col}" for row, col in np.ndindex(25, 25)]),
        "observation.state": _feature("float32", ["speed_mps", "steering_rad"]),
        "action": _feature("float32", ["ahead_m", "left_m"]),
        "timestamp": _feature("float32"),
        **{name: _feature("int64") for name in ("frame_index", "episode_index", "index", "task_index")},
    }
    schema = pa.schema([(name, _arrow(pa, feature)) for name, feature in features.items()])
    first, rows = 0, []
    statistics = {name: _Statistics() for name, feature in features.items() if feature["dtype"] == "float32"}
    with parquet.ParquetWriter(root / "data/chunk-000/file-000.parquet", schema) as writer:
        for number, episode in enumerate(episodes(dataset)):
            n = len(episode.grids)
            frame = np.arange(n)
            columns: dict[str, npt.NDArray[Any]] = {
                "observation.environment_state": episode.grids.reshape(n, GRID_CELLS**2).astype(np.float32),
                "observation.state": episode.states,
                "action": episode.points,
                "timestamp": (frame / frames_per_s).astype(np.float32),
                "frame_index": frame,
                "episode_index": np.full(n, number),
                "index": first + frame,
                "task_index": np.zeros(n, np.int64),
            }
            arrays = [_column(pa, columns[field.name], field.type) for field in schema]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))
            for name, statistic in statistics.items():
                statistic.add(columns[name].reshape(n, -1))
            place = {"data/chunk_index": 0, "data/file_index": 0, "meta/episodes/chunk_index": 0}
            place |= {"meta/episodes/file_index": 0, "dataset_from_index": first, "dataset_to_index": first + n}
            rows.append({"episode_index": number, "tasks": [TASK], "length": n, **place})
            first += n
    parquet.write_table(pa.Table.from_pylist(rows), root / "meta/episodes/chunk-000/file-000.parquet")
    pd.DataFrame({"task_index": [0]}, index=[TASK]).to_parquet(root / "meta/tasks.parquet")
    info = {
        "codebase_version": "v3.0",
        "robot_type": "lotpilot",
        "total_episodes": len(rows),
        "total_frames": first,
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": frames_per_s,
        "splits": {"train": f"0:{len(rows)}"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": None,
        "features": features,
    }
    _write_json(root / "meta/info.json", info)
    _write_json(root / "meta/stats.json", {name: statistic.values() for name, statistic in statistics.items()})


def _feature(dtype: str, names: list[str] | None = None) -> dict[str, Any]:
    return {"dtype": dtype, "shape": [1 if names is None else len(names)], "names": names}


def _arrow(pa: Any, feature: Mapping[str, Any]) -> Any:
    scalar = {"float32": pa.float32(), "int64": pa.int64()}[feature["dtype"]]
    return scalar if feature["names"] is None else pa.list_(scalar, feature["shape"][0])


def _column(pa: Any, values: npt.NDArray[Any], of: Any) -> Any:
    if values.ndim == 1:
        return pa.array(values, of)
    return pa.FixedSizeListArray.from_arrays(pa.array(values.ravel(), of.value_type), values.shape[1])


class _Statistics:
    """What LeRobot's normalisation asks for, dimension by dimension."""

    def __init__(self) -> None:
        self._parts: list[npt.NDArray[Any]] = []

    def add(self, rows: npt.NDArray[Any]) -> None:
        # Grids hold zeros and ones: a byte is enough, and so is memory.
        self._parts.append(rows.astype(np.uint8) if np.isin(rows, (0.0, 1.0)).all() else rows)

    def values(self) -> dict[str, list[float]]:
        rows = np.concatenate(self._parts)
        quantiles = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
        found = {
            "min": rows.min(0),
            "max": rows.max(0),
            "mean": rows.mean(0, dtype=np.float64),
            "std": rows.std(0, dtype=np.float64),
            "count": np.array([len(rows)]),
            **dict(zip(quantiles, np.quantile(rows, list(quantiles.values()), axis=0, method="nearest"), strict=True)),
        }
        return {name: value.tolist() for name, value in found.items()}


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=4), encoding="utf-8")
