"""What all environments share: options, spaces, and the native core with its arrays."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from ._native import Cars

Floats = npt.NDArray[np.float32]
Grids = npt.NDArray[np.uint8]

GRID_CELLS = 25
"""Cells per side of the grid."""
VIEW_PIXELS = 200
"""Pixels per side of the bird's-eye view."""


@dataclass(frozen=True)
class Reward:
    """Weights of the terms of the reward, which is their sum over one control tick. Costs are subtracted.

    The terms are parts of the metrics of ``docs/methods.md``, section 8. A weight of 0 switches a term off.
    """

    progress: float = 1.0
    """Per metre of progress along the route; none in a tick in which the car was put back on it."""
    near_collision: float = 5.0
    """Cost of a near-collision: something within 0.5 m in the direction of travel."""
    stuck: float = 5.0
    """Cost of being stuck: no progress for ten seconds."""
    contact: float = 5.0
    """Cost of a contact: the body began to touch something."""
    clearance: float = 0.1
    """Cost per metre by which the distance of the body to anything is below 0.5 m at the end of every tick; where the car
    was put back in it, before that."""
    smoothness: float = 0.2
    """Cost per radian by which the road wheels turned in the tick; none in one in which the car was put back."""


@dataclass(frozen=True)
class EnvOptions:
    """What an environment drives, sees and is rewarded for: the keywords of every environment of lotpilot.

    Environment i of n drives the episodes i, i + n, i + 2n, … of its seed. Episode k is trial
    ``k // (lots * directions)`` of each lot in each direction in turn, the very trials of ``cargo xtask evaluate`` with
    that seed: train with another seed than you judge by. Environments that share a seed go through the trials together and
    never drive one twice.
    """

    lots: Sequence[str] = ("lot-a",)
    """Names as on the command line: ``"lot-b"``, ``"train:100"``, ``"test:20:aisles"``, ``"my-map.toml"``."""
    directions: str = "both"
    """``"both"``, ``"forward"`` or ``"reverse"``."""
    trials: int | None = None
    """Trials per lot and direction before they come again; None never repeats one."""
    noise: str | float = "paper"
    """Sensor noise: ``"clean"``, ``"paper"``, ``"hard"``, ``"lot"``, or a multiple of ``"paper"`` up to 10."""
    seed: int = 1
    """Root of obstacles and noise, until ``reset`` is given another one."""
    preset: str | None = None
    """Settings to start from, as ``--preset``; ``"default"`` if None."""
    config: str | os.PathLike[str] | None = None
    """TOML file with settings to change, as ``--config``."""
    overrides: Sequence[str] = ()
    """Single settings, as ``--set``: ``"episode.metrics.events_max=1"`` ends an episode at its first near-collision."""
    action: str = "look_ahead"
    """``"look_ahead"``: a point [ahead, left] of the rear axle in metres, driven by the paper's controller;
    ``"steering"``: [road-wheel angle in radians, speed in m/s], which the car obeys within its limits."""
    normalise: bool = False
    """Whether actions are given within -1 … 1 instead of metres, radians and m/s."""
    state: bool = False
    """Whether speed (m/s) and road-wheel angle (radians, positive to the left) are observed as well."""
    view: bool = False
    """Whether the bird's-eye view in full resolution is observed as well; costs thirty times the step itself."""
    reward: Reward | Mapping[str, float] = field(default_factory=Reward)
    """Weights of the reward; a mapping changes some of the default ones."""
    threads: int | None = None
    """Threads to step with; None takes all cores."""
    copy: bool = True
    """Whether every step returns arrays of its own. If not, a step overwrites what the last one returned."""

    @staticmethod
    def of(options: Mapping[str, Any]) -> EnvOptions:
        """Options by name.

        Raises:
            TypeError: If there is no option of a name.
        """
        known = [option.name for option in fields(EnvOptions)]
        unknown = [name for name in options if name not in known]
        if unknown:
            raise TypeError(f"no option {unknown[0]!r}; there are {', '.join(known)}")
        return EnvOptions(**options)

    def weights(self) -> dict[str, float]:
        """The weights of the reward by term.

        Raises:
            ValueError: If a mapping names a term that does not exist.
        """
        if isinstance(self.reward, Reward):
            return asdict(self.reward)
        weights = asdict(Reward())
        for term, weight in self.reward.items():
            if term not in weights:
                raise ValueError(f"reward: no term {term!r}; there are {', '.join(weights)}")
            weights[term] = float(weight)
        return weights


def settings_from(
    preset: str | None, config: str | os.PathLike[str] | None, overrides: Sequence[str]
) -> dict[str, Any]:
    """Settings as the native half takes them."""
    return {"preset": preset, "config": config, "overrides": names(overrides, "overrides")}


def names(given: str | Sequence[str], what: str) -> list[str]:
    """One name or several.

    Raises:
        TypeError: If something else is given.
    """
    several = [given] if isinstance(given, str) else list(given)
    for name in several:
        if not isinstance(name, str):
            raise TypeError(f"{what}: {name!r} is not a string")
    return several


class Arrays:
    """What n environments observe: the native core writes into these."""

    def __init__(self, count: int, options: EnvOptions) -> None:
        self.grids: Grids = np.zeros((count, GRID_CELLS, GRID_CELLS), np.uint8)
        """Occupancy: 1 is a non-drivable cell, row 0 farthest ahead, column 0 leftmost."""
        self.states: Floats | None = np.zeros((count, 2), np.float32) if options.state else None
        """Speed and road-wheel angle."""
        self.views: Grids | None = np.zeros((count, VIEW_PIXELS, VIEW_PIXELS), np.uint8) if options.view else None
        """The view that the grid is made of, but where the sensor drops a frame: the grid of the tick before is repeated
        then, and the view is that of the tick."""
        self.info: npt.NDArray[np.float64] = np.zeros((count, len(Cars.INFO)))
        """Columns ``Cars.INFO``."""

    def observation(self) -> Any:
        """As the observation space has it, all environments together."""
        if self.states is None and self.views is None:
            return self.grids
        observed: dict[str, Any] = {"grid": self.grids}
        if self.states is not None:
            observed["state"] = self.states
        if self.views is not None:
            observed["view"] = self.views
        return observed


COUNTS = ("near_collisions", "contacts", "stuck", "event", "episode_number")
"""Which of the values that environments tell besides their observation are counts."""


class Core:
    """n environments with their spaces. Every adapter has one."""

    def __init__(self, count: int, options: EnvOptions, autoreset: str, *, digests: bool = False) -> None:
        self.options = options
        self.count = count
        self.autoreset = autoreset
        check_whole("seed", options.seed)
        check_whole("trials", *given(options.trials), below=2**32)
        check_whole("threads", *given(options.threads))
        check_whole("environments", count)
        self.cars = Cars(
            count,
            lots=names(options.lots, "lots"),
            directions=options.directions,
            trials=options.trials,
            noise=str(options.noise),
            settings=settings_from(options.preset, options.config, options.overrides),
            seed=options.seed,
            action=options.action,
            autoreset=autoreset,
            reward=options.weights(),
            threads=options.threads,
            digests=digests,
        )
        self.low, self.high = (np.array(bound, np.float32) for bound in self.cars.action_bounds())
        self._reused = None if options.copy else self._fresh()

    @property
    def control_period_s(self) -> float:
        """Simulated time of a step, seconds; longer with a near-collision, which ends at rest on the route."""
        return self.cars.control_period_s()

    @property
    def frames_per_s(self) -> int:
        """Pictures per second that show a drive as fast as it is: one of every step."""
        return max(1, round(1.0 / self.control_period_s))

    def action_space(self) -> spaces.Box:
        """The action space of one environment: metres, or radians and m/s, or -1 … 1."""
        if self.options.normalise:
            return spaces.Box(-1.0, 1.0, (2,), np.float32)
        return spaces.Box(self.low, self.high, dtype=np.float32)

    def observation_space(self) -> spaces.Space[Any]:
        """The observation space of one environment."""
        grid = spaces.Box(0, 1, (GRID_CELLS, GRID_CELLS), np.uint8)
        if not (self.options.state or self.options.view):
            return grid
        parts: dict[str, spaces.Space[Any]] = {"grid": grid}
        if self.options.state:
            low, high = (np.array(bound, np.float32) for bound in self.cars.state_bounds())
            parts["state"] = spaces.Box(low, high, dtype=np.float32)
        if self.options.view:
            parts["view"] = spaces.Box(0, 1, (VIEW_PIXELS, VIEW_PIXELS), np.uint8)
        return spaces.Dict(parts)

    def reset(
        self,
        mask: npt.NDArray[np.bool_] | None = None,
        *,
        seeds: Sequence[int | None] | None = None,
        episodes: Sequence[int | None] | None = None,
    ) -> Arrays:
        """Starts the next episodes of the environments in ``mask``, of all if it is None.

        Where ``seeds`` has one, it is the first episode of that seed; where ``episodes`` has one, that one.
        """
        chosen = np.ones(self.count, bool) if mask is None else np.asarray(mask, bool)
        seen = self._arrays()[0]
        if seeds is not None:
            check_whole("seed", *given(*seeds))
            seeds = [None if seed is None else int(seed) for seed in seeds]
        if episodes is not None:
            check_whole("episode", *given(*episodes))
            episodes = [None if episode is None else int(episode) for episode in episodes]
        self.cars.reset(chosen.tolist(), seeds, episodes, seen)
        return seen

    def step(
        self, actions: npt.ArrayLike
    ) -> tuple[Arrays, npt.NDArray[np.float64], npt.NDArray[np.bool_], npt.NDArray[np.bool_], Arrays | None]:
        """Drives one control tick: what is seen, rewards, terminated, truncated, and under ``same_step`` what ended
        episodes saw last.

        Raises:
            ValueError: If the actions are not n finite pairs.
            EpisodeEnded: If autoreset is off and an episode has ended.
        """
        arrays = self._arrays()
        self.cars.step(self._actions(actions), *arrays)
        return arrays

    def expert_actions(self) -> Floats:
        """What the expert would do now, float32 [n, 2], as actions are given; NaN where the episode has ended.

        The expert sees the clean scene. It remembers its last answer: asked at every tick, it answers as the driver
        ``expert`` does.
        """
        answers = self.cars.expert_actions()
        if self.options.normalise:
            answers = (2.0 * (answers - self.low) / (self.high - self.low) - 1.0).astype(np.float32)
        return answers

    def infos(self, seen: Arrays) -> dict[str, npt.NDArray[Any]]:
        """What is told besides the observation, by name: arrays [n]."""
        columns = dict(zip(Cars.INFO, seen.info.T.copy(), strict=True))
        for name in COUNTS:
            columns[name] = columns[name].astype(np.int64)
        return columns

    def info(self, seen: Arrays, index: int) -> dict[str, Any]:
        """The same of one environment."""
        values = dict(zip(Cars.INFO, seen.info[index].tolist(), strict=True))
        for name in COUNTS:
            values[name] = int(values[name])
        return values

    def place(self, index: int) -> dict[str, Any]:
        """What the command line names an environment's episode by: lot, direction, trial and seed."""
        return dict(zip(("lot", "direction", "trial", "seed"), self.cars.places()[index], strict=True))

    def _actions(self, actions: npt.ArrayLike) -> Floats:
        given = np.ascontiguousarray(actions, np.float32)
        if given.shape != (self.count, 2):
            raise ValueError(f"actions: the shape is {given.shape}, {(self.count, 2)} is needed")
        if self.options.normalise:
            given = self.low + (0.5 * given + 0.5) * (self.high - self.low)
        return given

    def _arrays(
        self,
    ) -> tuple[Arrays, npt.NDArray[np.float64], npt.NDArray[np.bool_], npt.NDArray[np.bool_], Arrays | None]:
        return self._fresh() if self._reused is None else self._reused

    def _fresh(
        self,
    ) -> tuple[Arrays, npt.NDArray[np.float64], npt.NDArray[np.bool_], npt.NDArray[np.bool_], Arrays | None]:
        last = Arrays(self.count, self.options) if self.autoreset == "same_step" else None
        seen = Arrays(self.count, self.options)
        return seen, np.zeros(self.count), np.zeros(self.count, bool), np.zeros(self.count, bool), last


def row(observation: Any, index: int) -> Any:
    """What one car saw, copied out of what all of them did."""
    if isinstance(observation, dict):
        return {name: part[index].copy() for name, part in observation.items()}
    return observation[index].copy()


def given(*numbers: int | None) -> list[int]:
    """Those that are not None, which is in the settings or by default."""
    return [number for number in numbers if number is not None]


def check_whole(what: str, *numbers: int, least: int = 0, below: int = 2**63) -> None:
    """Refuses what is no whole number or out of range.

    Raises:
        ValueError: Naming what it is.
    """
    for number in numbers:
        if not isinstance(number, (int, np.integer)) or not least <= number < below:
            raise ValueError(f"{what}: {number!r} is not a whole number within {least} … {below - 1}")


def refuse_option(options: Mapping[str, Any] | None, name: str, right: str) -> None:
    """Refuses an option of ``reset`` that other environments have, and that would be ignored.

    Raises:
        ValueError: Naming the right one.
    """
    if name in (options or {}):
        raise ValueError(f"there is no reset option {name!r} here; it is {right!r}")
