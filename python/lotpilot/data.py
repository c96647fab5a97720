"""What a training collected, as arrays."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ._native import count_rounds, read_round
from .core import Floats, Grids, check_whole


def load_round(run: str | os.PathLike[str], round: int = 0) -> dict[str, Any]:
    """The samples of one round of a training run, in the order in which they were collected.

    Args:
        run: Folder of the run, as ``runs/train-dagger-default-s1``.
        round: Which round; 0 is behaviour cloning.

    Returns:
        Columns of n samples: ``grids`` uint8 [n, 25, 25]; ``points`` float32 [n, 2], the expert's look-ahead point,
        ahead and left in metres; ``image_fractions`` float32 [n, 2], the same as the network learns it; ``tau_hat``
        float32 [n]; ``noise_augmentations`` uint8 [n, k, 25, 25]; ``is_novice`` bool [n]; and of every sample
        ``episode``, ``tick``, ``time_s``, ``x_m``, ``y_m``, ``heading_rad``, ``speed_mps``, ``steering_rad``,
        ``command_steering_rad``, ``command_speed_mps``. Beside them, ``lots`` and ``directions`` of every episode, and
        ``control_period_s``, a number: the time from tick to tick.

    Raises:
        ValueError: If there is no such round, the run did not collect it, or one of its files is damaged.
    """
    check_whole("round", round, below=2**20)
    return read_round(Path(run), round)


class Dataset:
    """All samples of a training run, oldest round first.

    Args:
        run: Folder of the run.

    Raises:
        ValueError: If it is not a run, holds no round, one is missing or not its own, or a file is damaged.
    """

    def __init__(self, run: str | os.PathLike[str]) -> None:
        folder = Path(run)
        count = count_rounds(folder) if folder.is_dir() else 0
        if count == 0:
            raise ValueError(f"{folder}: there is no round of training data")
        self.rounds: list[dict[str, Any]] = [load_round(folder, index) for index in range(count)]
        """The rounds, see ``load_round``."""
        self.grids: Grids = self._all("grids")
        """What was seen, uint8 [n, 25, 25]."""
        self.points: Floats = self._all("points")
        """Where the expert would have headed, float32 [n, 2]: ahead and left, metres."""

    def __len__(self) -> int:
        return len(self.grids)

    def columns(self) -> dict[str, npt.NDArray[Any]]:
        """Every column of one value per sample, with the round: for pandas and Arrow."""
        flat = [name for name, value in self.rounds[0].items() if isinstance(value, np.ndarray) and value.ndim == 1]
        table = {name: self._all(name) for name in flat}
        table["round"] = np.concatenate([np.full(len(data["grids"]), index) for index, data in enumerate(self.rounds)])
        return table

    def _all(self, name: str) -> npt.NDArray[Any]:
        return np.concatenate([data[name] for data in self.rounds])
