"""Environments for Gymnasium: ``gymnasium.make("lotpilot/Lot-v0")``, and many of them natively as a ``VectorEnv``.

Actions, observations, rewards and what is told beside them: ``lotpilot.EnvOptions``, ``docs/python.md``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.error import DependencyNotInstalled, ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from .core import Arrays, Core, EnvOptions, Floats, Grids, check_whole, given, refuse_option, row

PICTURE_PX = 500
"""Height of a picture, pixels; it is twice as wide."""
FRAMES_PER_S = 20
"""One picture per control tick, which lasts 50 ms by default."""


class LotEnv(gymnasium.Env[Any, Floats]):
    """One car on a parking lot.

    An episode is terminated at the end of the route, or after too many near-collisions
    (``episode.metrics.events_max``), and truncated after too long (``episode.metrics.timeout_s``). A near-collision
    stops the car and puts it back on the route within the step that it happens in.

    ``reset(seed=s)`` starts the first episode of seed s; further resets continue from there.
    ``reset(options={"episode": k})`` starts the k-th (``EnvOptions``). ``info`` holds the car and the metrics so far,
    and after ``reset`` also the names of lot, direction, trial and seed.

    Args:
        render_mode: None, ``"rgb_array"`` or ``"human"`` (needs pygame).
        **options: Fields of ``EnvOptions``.

    Raises:
        TypeError: If there is no such option.
        ValueError: If something is not known by its name, or a lot cannot be driven.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": FRAMES_PER_S}

    def __init__(self, render_mode: str | None = None, **options: Any) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"no render mode {render_mode!r}; there are {self.metadata['render_modes']}")
        self.core = Core(1, EnvOptions.of({"threads": 1, **options}), "disabled")
        self.metadata = {**self.metadata, "render_fps": self.core.frames_per_s}
        self.action_space = cast(gymnasium.Space[Floats], self.core.action_space())
        self.observation_space = self.core.observation_space()
        self.render_mode = render_mode
        self._window: Any = None
        self._is_started = False

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Starts the next episode, or the first one of a seed, or that of ``options={"episode": 7}``.

        Raises:
            ValueError: If the options are those of several cars.
        """
        refuse_option(options, "episodes", "episode")
        check_whole("seed", *given(seed))
        super().reset(seed=None if seed is None else int(seed))
        episode = (options or {}).get("episode")
        seen = self.core.reset(seeds=None if seed is None else [seed], episodes=None if episode is None else [episode])
        self._is_started = True
        if self.render_mode == "human":
            self.render()
        return _first(seen.observation()), {**self.core.info(seen, 0), **self.core.place(0)}

    def step(self, action: npt.ArrayLike) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Drives one control tick.

        Raises:
            ValueError: If the action is not two finite numbers.
            EpisodeEnded: If the episode has ended.
        """
        pair = np.asarray(action, np.float32)
        if pair.shape != (2,):
            raise ValueError(f"action: the shape is {pair.shape}, (2,) is needed")
        seen, rewards, terminated, truncated, _ = self.core.step(pair[np.newaxis])
        if self.render_mode == "human":
            self.render()
        info = self.core.info(seen, 0)
        return _first(seen.observation()), float(rewards[0]), bool(terminated[0]), bool(truncated[0]), info

    def expert_action(self) -> Floats:
        """What the expert would do now, float32 [2], see ``Core.expert_actions``."""
        return cast(Floats, self.core.expert_actions()[0])

    def render(self) -> Any:
        """The lot around the car and the grid that it sees: uint8 [500, 1000, 3], or a window."""
        if not self._is_started:
            raise ResetNeeded("render() needs an episode; call reset() first")
        if self.render_mode is None:
            gymnasium.logger.warn('render() shows nothing without render_mode="rgb_array" or "human"')
            return None
        picture = self.core.cars.picture(0, PICTURE_PX)
        if self.render_mode == "human":
            self._window = self._window or _Window(picture, self.metadata["render_fps"])
            self._window.show(picture)
            return None
        return picture

    def close(self) -> None:
        """Closes the window."""
        if self._window is not None:
            self._window.close()
            self._window = None


class LotVectorEnv(VectorEnv[Any, Floats, npt.NDArray[Any]]):
    """Many cars, stepped natively and in parallel.

    Environment i of n drives the episodes i, i + n, … (``EnvOptions``). ``reset(seed=s)`` gives all of them the seed s:
    they share its trials and drive none twice. ``reset(seed=[…])`` gives each its own; where it is None they continue.
    ``reset(options={"reset_mask": mask})`` resets some. ``infos`` holds an array per name; under
    ``SAME_STEP`` also ``final_obs`` and ``final_info``.

    Args:
        num_envs: How many.
        autoreset_mode: When an episode that has ended is followed by the next.
        render_mode: None or ``"rgb_array"``.
        **options: Fields of ``EnvOptions``.

    Raises:
        TypeError: If there is no such option.
        ValueError: If something is not known by its name, or a lot cannot be driven.
    """

    metadata: dict[str, Any] = {
        "render_modes": ["rgb_array"],
        "render_fps": FRAMES_PER_S,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        mode = AutoresetMode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": mode}
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"no render mode {render_mode!r}; there is rgb_array")
        self.core = Core(num_envs, EnvOptions.of(options), _AUTORESET[mode])
        self.metadata = {**self.metadata, "render_fps": self.core.frames_per_s}
        self.num_envs = num_envs
        self.render_mode = render_mode
        self.single_action_space = self.core.action_space()
        self.single_observation_space = self.core.observation_space()
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._all = np.ones(num_envs, bool)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | npt.NDArray[np.integer[Any]] | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Starts the next episodes, or the first ones of a seed, or those of ``options={"episodes": [7, …]}``.

        Raises:
            ValueError: If the options are those of a single car.
        """
        refuse_option(options, "episode", "episodes")
        if isinstance(seed, np.ndarray):
            seed = seed.tolist()
        seeds = _seeds(seed, self.num_envs)
        super().reset(seed=int(seed) if isinstance(seed, (int, np.integer)) else None)
        mask = (options or {}).get("reset_mask")
        seen = self.core.reset(mask, seeds=seeds, episodes=(options or {}).get("episodes"))
        return seen.observation(), self._infos(seen)

    def step(
        self, actions: npt.ArrayLike
    ) -> tuple[Any, npt.NDArray[np.float64], npt.NDArray[np.bool_], npt.NDArray[np.bool_], dict[str, Any]]:
        """Drives one control tick with every car; those whose episode has ended are reset, as the mode says.

        Raises:
            ValueError: If the actions are not n finite pairs.
            EpisodeEnded: If the mode is ``DISABLED`` and an episode has ended.
        """
        seen, rewards, terminated, truncated, last = self.core.step(actions)
        infos = self._infos(seen)
        if last is not None:
            ended = terminated | truncated
            if ended.any():
                final = np.full(self.num_envs, None, object)
                for index in np.flatnonzero(ended):
                    final[index] = row(last.observation(), int(index))
                infos.update(final_obs=final, _final_obs=ended, final_info=self._infos(last, ended), _final_info=ended)
        return seen.observation(), rewards, terminated, truncated, infos

    def expert_actions(self) -> Floats:
        """What the expert would do now, float32 [n, 2], see ``Core.expert_actions``."""
        return self.core.expert_actions()

    def route_points(self, ahead_m: float = 6.0) -> Floats:
        """Where the route is ``ahead_m`` further on: float32 [n, 2], ahead and left in metres. For oracles."""
        return self.core.cars.route_points(ahead_m)

    def render(self) -> tuple[Grids, ...] | None:
        """A picture of every environment, uint8 [500, 1000, 3]."""
        if self.render_mode is None:
            return None
        return tuple(self.core.cars.picture(index, PICTURE_PX) for index in range(self.num_envs))

    def _infos(self, seen: Arrays, present: npt.NDArray[np.bool_] | None = None) -> dict[str, Any]:
        mask = self._all if present is None else present
        infos: dict[str, Any] = self.core.infos(seen)
        infos.update([(f"_{name}", mask) for name in infos])
        return infos


_AUTORESET = {
    AutoresetMode.NEXT_STEP: "next_step",
    AutoresetMode.SAME_STEP: "same_step",
    AutoresetMode.DISABLED: "disabled",
}


def _seeds(seed: Any, count: int) -> list[int | None] | None:
    """The seed of each environment, if one is given for all of them or for each.

    Raises:
        ValueError: If one is no whole number or out of range.
    """
    if seed is None:
        return None
    seeds = list(seed) if isinstance(seed, Sequence) else [seed] * count
    check_whole("seed", *given(*seeds))
    return seeds


def _first(observation: Any) -> Any:
    if isinstance(observation, dict):
        return {name: part[0] for name, part in observation.items()}
    return observation[0]


class _Window:
    """Pictures as they come, at the speed of a real car."""

    def __init__(self, picture: Grids, frames_per_s: int) -> None:
        self._frames_per_s = frames_per_s
        try:
            import pygame
        except ImportError as error:
            raise DependencyNotInstalled('render_mode="human" needs pygame: pip install "lotpilot[human]"') from error
        self._pygame = pygame
        pygame.display.init()
        self._screen = pygame.display.set_mode((picture.shape[1], picture.shape[0]))
        pygame.display.set_caption("lotpilot")
        self._clock = pygame.time.Clock()

    def show(self, picture: Grids) -> None:
        self._pygame.event.pump()
        self._screen.blit(self._pygame.surfarray.make_surface(picture.swapaxes(0, 1)), (0, 0))
        self._pygame.display.flip()
        self._clock.tick(self._frames_per_s)

    def close(self) -> None:
        self._pygame.display.quit()
