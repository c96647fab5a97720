"""One run, step by step."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from ._native import Cars
from .core import GRID_CELLS, Arrays, Core, EnvOptions, Floats, Grids, check_whole


class Episode:
    """One run on a lot, step by step: what ``cargo xtask evaluate`` drives, with you at the wheel.

    Args:
        lot: A lot as on the command line, which stands for one: ``"lot-b"``, ``"test-hard-7"``.
        direction: ``"forward"`` or ``"reverse"``.
        trial: Which trial of the lot: its obstacles, where trials draw them, and its noise.
        seed: Root of obstacles and noise.
        noise: See ``EnvOptions.noise``.
        action: See ``EnvOptions.action``.
        preset: See ``EnvOptions.preset``.
        config: See ``EnvOptions.config``.
        overrides: See ``EnvOptions.overrides``.

    Raises:
        ValueError: If something is not known by its name, or the lot cannot be driven.

    Example:
        >>> episode = lotpilot.Episode("lot-b")
        >>> while not episode.is_over:
        ...     episode.step(episode.expert_action())
        >>> episode.report()["metrics"]["near_collisions"]
        0
    """

    def __init__(
        self,
        lot: str = "lot-a",
        *,
        direction: str = "forward",
        trial: int = 0,
        seed: int = 1,
        noise: str | float = "paper",
        action: str = "look_ahead",
        preset: str | None = None,
        config: str | os.PathLike[str] | None = None,
        overrides: Sequence[str] = (),
    ) -> None:
        if direction not in ("forward", "reverse"):
            raise ValueError(f"no direction {direction!r}; there are forward and reverse")
        check_whole("trial", trial, below=2**20)
        options = EnvOptions(
            lots=[lot],
            directions=direction,
            noise=noise,
            seed=seed,
            action=action,
            preset=preset,
            config=config,
            overrides=overrides,
            state=True,
            threads=1,
        )
        self._core = Core(1, options, "disabled", digests=True)
        # Counted as it is driven: ``lotpilot.lots`` reads a lot for the default car, which may not fit.
        if self._core.cars.lot_count() != 1:
            raise ValueError(f"{lot!r} stands for several lots; lotpilot.lots names them")
        self._seen: Arrays = self._core.reset(episodes=[trial])
        self._rows: list[npt.NDArray[np.float64]] = [self._seen.info[0]]
        self.place: dict[str, Any] = self._core.place(0)
        """Lot, direction, trial and seed."""
        self.is_over = False
        """Whether the run has ended."""

    @property
    def observation(self) -> Grids:
        """The noisy grid, uint8 [25, 25]: 1 is non-drivable, row 0 farthest ahead, column 0 leftmost."""
        return cast(Grids, self._seen.grids[0])

    @property
    def info(self) -> dict[str, Any]:
        """The car and the metrics so far, see ``docs/python.md``."""
        return self._core.info(self._seen, 0)

    def expert_action(self) -> Floats:
        """What the expert would do now, float32 [2]; NaN after the end. See ``Core.expert_actions``."""
        return cast(Floats, self._core.expert_actions()[0])

    def step(self, action: npt.ArrayLike) -> Grids:
        """Drives one control tick and returns the next observation.

        Args:
            action: Two finite numbers, see ``EnvOptions.action``.

        Raises:
            ValueError: If it is not two finite numbers.
            EpisodeEnded: If the run has ended.
        """
        given = np.asarray(action, np.float32)
        if given.shape != (2,):
            raise ValueError(f"action: the shape is {given.shape}, (2,) is needed")
        self._seen, _, terminated, truncated, _ = self._core.step(given[np.newaxis])
        self._rows.append(self._seen.info[0])
        self.is_over = bool(terminated[0] or truncated[0])
        return self.observation

    def report(self) -> dict[str, Any]:
        """How the run ended (``None`` while it is under way), its metrics and its near-collisions, as in a line of ``runs.jsonl``."""
        report: dict[str, Any] = json.loads(self._core.cars.report(0))
        return report

    def table(self) -> dict[str, npt.NDArray[Any]]:
        """The car and the metrics after every tick so far, the start first: columns of one length."""
        return dict(zip(Cars.INFO, np.stack(self._rows).T, strict=True))

    def digest(self) -> str:
        """SHA-256 of everything seen, decided and driven: two runs with one digest are the same bit for bit."""
        digest = self._core.cars.digest(0)
        assert digest is not None
        return digest

    def picture(self, side_px: int = 500) -> Grids:
        """The lot around the car, and beside it the grid that it sees: uint8 [side_px, 2 * side_px, 3].

        Raises:
            ValueError: If ``side_px`` is not within 25 … 8192.
        """
        check_whole("side_px", side_px, least=GRID_CELLS, below=8193)
        return self._core.cars.picture(0, side_px)
