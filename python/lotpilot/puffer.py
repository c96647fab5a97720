"""Many cars as a native ``PufferEnv`` of PufferLib 3.0: ``pufferlib.vector.make(lotpilot.puffer.LotPufferEnv, …)``."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from pufferlib import PufferEnv

from .core import Arrays, Core, EnvOptions, Floats, Grids

Step = tuple[Grids, Floats, npt.NDArray[np.bool_], npt.NDArray[np.bool_], list[dict[str, Any]]]


class LotPufferEnv(PufferEnv):  # type: ignore[misc]
    """Many cars, each an agent; an episode that has ended is followed by the next at once.

    Observations, rewards and ends are written into PufferLib's buffers. ``infos`` holds one dict for every episode that
    has just ended: the car and the metrics at its end.

    Args:
        num_envs: How many cars.
        buf: PufferLib's buffers; None makes own ones.
        seed: Root of obstacles and noise, until ``reset`` is given another one.
        render_mode: None or ``"rgb_array"``: whether PufferLib's ``eval`` shows what ``render`` returns.
        **options: Fields of ``lotpilot.EnvOptions``. Actions are normalised to -1 … 1 unless ``normalise=False``, and
            one thread steps unless ``threads=`` says otherwise: PufferLib has processes for more.

    Raises:
        TypeError: If there is no such option.
        ValueError: If something is not known by its name, a lot cannot be driven, or more than the grid is asked for:
            native environments have one array of observations.
    """

    def __init__(
        self, num_envs: int = 1, buf: Any = None, seed: int = 1, *, render_mode: str | None = None, **options: Any
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"no render mode {render_mode!r}; there is rgb_array")
        asked = EnvOptions.of({"normalise": True, "threads": 1, "seed": seed, "copy": False, **options})
        if asked.state or asked.view:
            raise ValueError("state, view: PufferLib's native environments observe one array; leave them out")
        self.core = Core(num_envs, asked, "same_step")
        self.single_observation_space = self.core.observation_space()
        self.single_action_space = self.core.action_space()
        self.num_agents = num_envs
        # PufferEnv has none of its own, and pufferl's eval asks every environment for it.
        self.render_mode = render_mode
        super().__init__(buf)

    def reset(self, seed: int | None = None) -> tuple[Grids, list[dict[str, Any]]]:
        """Starts the next episode of every car, or the first ones of a seed."""
        seen = self.core.reset(seeds=None if seed is None else [seed] * self.num_agents)
        self.observations[:] = seen.grids
        # Of the last step of other episodes.
        self.rewards[:], self.terminals[:], self.truncations[:] = 0.0, False, False
        return self.observations, []

    def step(self, actions: npt.ArrayLike) -> Step:
        """Drives one control tick with every car.

        Raises:
            ValueError: If the actions are not n finite pairs.
        """
        seen, rewards, terminated, truncated, last = self.core.step(actions)
        assert isinstance(last, Arrays)
        self.observations[:] = seen.grids
        self.rewards[:] = rewards
        self.terminals[:] = terminated
        self.truncations[:] = truncated
        infos = [self.core.info(last, int(index)) for index in np.flatnonzero(terminated | truncated)]
        return self.observations, self.rewards, self.terminals, self.truncations, infos

    def render(self) -> Grids:
        """The lot around the first car and the grid that it sees: uint8 [500, 1000, 3]."""
        return self.core.cars.picture(0, 500)

    def close(self) -> None:
        """Nothing is open."""
