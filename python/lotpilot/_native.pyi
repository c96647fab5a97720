from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from .core import Arrays

class EpisodeEnded(RuntimeError): ...

class Cars:
    INFO: ClassVar[list[str]]
    def __init__(
        self,
        count: int,
        *,
        lots: Sequence[str],
        directions: str,
        trials: int | None,
        noise: str,
        settings: Mapping[str, Any],
        seed: int,
        action: str,
        autoreset: str,
        reward: Mapping[str, float],
        threads: int | None,
        digests: bool,
    ) -> None: ...
    def action_bounds(self) -> list[list[float]]: ...
    def state_bounds(self) -> list[list[float]]: ...
    def control_period_s(self) -> float: ...
    def reset(
        self, mask: Sequence[bool], seeds: Sequence[int] | None, numbers: Sequence[int] | None, seen: Arrays
    ) -> None: ...
    def step(
        self,
        actions: npt.NDArray[np.float32],
        seen: Arrays,
        rewards: npt.NDArray[np.float64],
        terminated: npt.NDArray[np.bool_],
        truncated: npt.NDArray[np.bool_],
        last: Arrays | None,
    ) -> None: ...
    def expert_actions(self) -> npt.NDArray[np.float32]: ...
    def route_points(self, ahead_m: float) -> npt.NDArray[np.float32]: ...
    def places(self) -> list[tuple[str, str, int, int]]: ...
    def report(self, index: int) -> str: ...
    def digest(self, index: int) -> str | None: ...
    def picture(self, index: int, side_px: int) -> npt.NDArray[np.uint8]: ...

class Lot:
    def __init__(self, name: str, *, direction: str = "forward", trial: int = 0, seed: int = 1) -> None: ...
    @property
    def name(self) -> str: ...
    @property
    def length_m(self) -> float: ...
    @property
    def route(self) -> npt.NDArray[np.float32]: ...
    @property
    def boundary(self) -> npt.NDArray[np.float32]: ...
    @property
    def islands(self) -> list[npt.NDArray[np.float32]]: ...
    @property
    def obstacles(self) -> list[npt.NDArray[np.float32]]: ...
    def distances_m(self, points: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]: ...
    def to_toml(self) -> str: ...
    def picture(self, pixels_per_metre: float | None = None) -> npt.NDArray[np.uint8]: ...

def lots(names: Sequence[str]) -> list[str]: ...
def drivers() -> list[tuple[str, str]]: ...
def settings(from_: Mapping[str, Any], /) -> str: ...
def generate(
    names: Sequence[str], seed: int, count: int, out: PathLike[str] | None, overwrite: bool
) -> list[tuple[str, str, str, float, int]]: ...
def evaluate(
    drivers: Sequence[tuple[str, str | Callable[..., npt.NDArray[np.float32]]]],
    trials: Mapping[str, Any],
    settings: Mapping[str, Any],
    out: PathLike[str],
    overwrite: bool,
    shard: str | None,
) -> None: ...
def merge(
    drivers: Sequence[tuple[str, str | Callable[..., npt.NDArray[np.float32]]]],
    trials: Mapping[str, Any],
    settings: Mapping[str, Any],
    out: PathLike[str],
    overwrite: bool,
    shards: Sequence[PathLike[str]],
) -> None: ...
def read_round(run: PathLike[str], round: int) -> dict[str, Any]: ...

class RustLoop:
    def __init__(
        self,
        count: int,
        lots: Sequence[str],
        trials: int,
        noise: str,
        settings: Mapping[str, Any],
        ahead_m: float,
        threads: int,
        tick_by_tick: bool,
    ) -> None: ...
    def drive(self, seconds: float) -> int: ...

def drive_digest(
    driver: str, lots: Sequence[str], directions: str, noise: str, settings: Mapping[str, Any], seed: int, number: int
) -> str: ...
