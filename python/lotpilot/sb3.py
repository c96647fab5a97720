"""Many cars as a ``VecEnv`` of Stable-Baselines3, for its algorithms and for ``imitation``."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from stable_baselines3.common.vec_env import VecEnv

from .core import Core, EnvOptions, Floats, Grids, refuse_option, row


class LotVecEnv(VecEnv):
    """Many cars, stepped natively and in parallel; an episode that has ended is followed by the next at once.

    ``infos`` is a dict per environment: the car and the metrics so far; at an episode's end they are those of its end,
    with ``terminal_observation`` and ``TimeLimit.truncated``.

    Args:
        num_envs: How many.
        render_mode: None or ``"rgb_array"``.
        **options: Fields of ``lotpilot.EnvOptions``. Actions are normalised to -1 … 1 unless ``normalise=False``: what
            SB3's Gaussian policies assume.

    Raises:
        TypeError: If there is no such option.
        ValueError: If something is not known by its name, a lot cannot be driven, or ``copy=False`` is asked for: SB3
            stores what a step returned after the next one, which would have overwritten it.
    """

    def __init__(self, num_envs: int, *, render_mode: str | None = None, **options: Any) -> None:
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"no render mode {render_mode!r}; there is rgb_array")
        asked = EnvOptions.of({"normalise": True, **options})
        if not asked.copy:
            raise ValueError("copy: SB3 stores what a step returned after the next one, which would overwrite it; leave it out")
        self.core = Core(num_envs, asked, "same_step")
        self.render_mode = render_mode
        self._actions: npt.NDArray[Any] | None = None
        self._attributes: list[dict[str, Any]] = [{} for _ in range(num_envs)]
        super().__init__(num_envs, self.core.observation_space(), self.core.action_space())
        # Without it, ``VecVideoRecorder`` plays thirty pictures per second, half as fast again as they were driven.
        self.metadata = {**self.metadata, "render_fps": self.core.frames_per_s}

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """The seed of the next ``reset``: one for all, who share its trials."""
        self._seeds = [seed] * self.num_envs
        return self._seeds

    def reset(self) -> Any:
        """Starts the next episode of every car, or the first one of a seed, or those that ``set_options`` has named:
        ``{"episode": 7}``, or such a dict for each.

        Raises:
            ValueError: If the options are those of ``LotVectorEnv``.
        """
        for options in self._options:
            refuse_option(options, "episodes", "episode")
        episodes = [options.get("episode") for options in self._options]
        seen = self.core.reset(seeds=self._seeds, episodes=episodes)
        self._reset_seeds()
        self._reset_options()
        self.reset_infos = [self.core.info(seen, index) for index in range(self.num_envs)]
        return seen.observation()

    def step_async(self, actions: npt.NDArray[Any]) -> None:
        """Takes the actions of the next ``step_wait``."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, Floats, npt.NDArray[np.bool_], list[dict[str, Any]]]:
        """Drives one control tick with every car.

        Raises:
            ValueError: If the actions are not n finite pairs.
        """
        if self._actions is None:
            raise RuntimeError("step_wait() comes after step_async()")
        seen, rewards, terminated, truncated, last = self.core.step(self._actions)
        self._actions = None
        assert last is not None
        dones = terminated | truncated
        infos = [self.core.info(last if dones[index] else seen, index) for index in range(self.num_envs)]
        for index in np.flatnonzero(dones):
            infos[index]["terminal_observation"] = row(last.observation(), int(index))
            infos[index]["TimeLimit.truncated"] = bool(truncated[index])
        return seen.observation(), rewards.astype(np.float32), dones, infos

    def expert_actions(self) -> Floats:
        """What the expert would do now, float32 [n, 2], as actions are given."""
        return self.core.expert_actions()

    def close(self) -> None:
        """Nothing is open."""

    def get_images(self) -> Sequence[Grids | None]:
        """A picture of every environment."""
        return [self.core.cars.picture(index, 500) for index in range(self.num_envs)]

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of some environments."""
        chosen = self._get_indices(indices)
        own = self._attributes
        return [own[i][attr_name] if attr_name in own[i] else getattr(self, attr_name) for i in chosen]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Sets an attribute of some environments."""
        for index in self._get_indices(indices):
            self._attributes[index][attr_name] = value

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Answers of a method for some environments: ``expert_action`` is the only one."""
        if method_name != "expert_action":
            raise AttributeError(f"no method {method_name!r}; there is expert_action")
        actions = self.expert_actions()
        return [actions[index] for index in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type[Any], indices: Any = None) -> list[bool]:
        """None is."""
        chosen: Iterable[int] = self._get_indices(indices)
        return [False for _ in chosen]
