"""Evaluations, lots and settings: the commands of lotpilot, with tables as dicts of columns."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _native
from .core import Floats, Grids, check_whole, given, names, settings_from

Table = dict[str, list[Any]]
"""Columns of one length: what ``pandas.DataFrame`` and ``pyarrow.table`` take."""

Driver = str | Callable[[Grids], npt.ArrayLike]
"""A name as on the command line, or a function of grids: uint8 [n, 25, 25] → [n, 2], ahead and left in metres.

An object with a method ``drive(grids, cars, was_reset)`` is told also which cars they are, int64 [n], and which were
put back on the route since, bool [n]: for drivers that remember."""


@dataclass(frozen=True)
class Evaluation:
    """Results of drivers: the tables of ``cargo xtask evaluate``."""

    summary: Table
    """Drivers by lots, noise and direction: rates with intervals."""
    comparisons: Table
    """Every other driver against one."""
    trainings: Table
    """Several trainings of one method, as one; empty if there are none, or too few trials to judge them by."""
    causes: Table
    """Near-collisions by cause."""
    noise_sweep: Table
    """Drivers against noise."""
    runs: Table
    """Every run."""
    failures: Table
    """Every near-collision."""


def evaluate(
    drivers: Driver | Sequence[Driver] | Mapping[str, Driver],
    lots: str | Sequence[str] | None = None,
    *,
    trials: int | None = None,
    directions: str | None = None,
    noise: str | float | Sequence[str | float] | None = None,
    seed: int | None = None,
    smoothing: str | float | None = None,
    compare_with: str | None = None,
    methods: Mapping[str, Sequence[str]] | None = None,
    preset: str | None = None,
    config: str | os.PathLike[str] | None = None,
    overrides: Sequence[str] = (),
    out: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
) -> Evaluation:
    """Drives drivers on the same trials: same lots, obstacles and noise. What is None is as in the settings.

    Args:
        drivers: One, several, or several by the name that they have in the tables. See ``Driver``; functions are asked
            for all cars of a batch in one call.
        lots: Names as on the command line.
        trials: Trials per lot and direction.
        directions: ``"both"``, ``"forward"`` or ``"reverse"``.
        noise: Level or levels.
        seed: Root of obstacles and noise.
        smoothing: ``"own"``, or a time constant in control ticks for every driver.
        compare_with: Name of the driver that the others are compared with; the first if None.
        methods: Names of drivers that are trainings of one method, three or more, by the name of the method: table
            ``trainings`` judges them together, for other trainings and other lots. Runs that differ by nothing but their
            seed are found without it.
        preset: Settings to start from; those of the first ``run:DIR`` if there is one and neither this nor ``config``
            names others.
        config: TOML file with settings to change.
        overrides: Single settings.
        out: Folder for the files of the evaluation (``runs.jsonl``, ``summary.json`` and so on); none are kept if None.
        overwrite: Whether to delete what an earlier evaluation left in ``out``.

    Raises:
        ValueError: If something is not known by its name, or a function answers with anything but finite points.
        Exception: What a function raises.
    """
    request = Request.of(
        drivers,
        lots,
        trials=trials,
        directions=directions,
        noise=noise,
        seed=seed,
        smoothing=smoothing,
        compare_with=compare_with,
        methods=methods,
        preset=preset,
        config=config,
        overrides=overrides,
    )
    with tempfile.TemporaryDirectory(prefix="lotpilot-") as scratch:
        folder = Path(scratch, "evaluation") if out is None else Path(out)
        request.drive(folder, overwrite=overwrite)
        return _read(folder)


@dataclass(frozen=True)
class Request:
    """An evaluation as it is asked for, here or on another machine: what ``evaluate`` takes, except for its folder."""

    drivers: Sequence[tuple[str, Driver]]
    which: Mapping[str, Any]
    settings: Mapping[str, Any]

    @staticmethod
    def of(
        drivers: Driver | Sequence[Driver] | Mapping[str, Driver],
        lots: str | Sequence[str] | None = None,
        *,
        trials: int | None = None,
        directions: str | None = None,
        noise: str | float | Sequence[str | float] | None = None,
        seed: int | None = None,
        smoothing: str | float | None = None,
        compare_with: str | None = None,
        methods: Mapping[str, Sequence[str]] | None = None,
        preset: str | None = None,
        config: str | os.PathLike[str] | None = None,
        overrides: Sequence[str] = (),
    ) -> Request:
        """See ``evaluate``."""
        check_whole("trials", *given(trials), below=2**32)
        check_whole("seed", *given(seed))
        is_one = isinstance(noise, (str, int, float, np.number))
        levels = None if noise is None else [noise] if is_one else list(noise)
        which = {
            "lots": None if lots is None else names(lots, "lots"),
            "trials": trials,
            "directions": directions,
            "noise": None if levels is None else [str(level) for level in levels],
            "seed": seed,
            "smoothing": None if smoothing is None else str(smoothing),
            "compare_with": compare_with,
            "methods": None if methods is None else [(name, names(of, "methods")) for name, of in methods.items()],
        }
        return Request(_named(drivers), which, settings_from(preset, config, overrides))

    def described(self) -> dict[str, Any]:
        """What it asks for, as plain values; functions by name."""
        drivers = [[name, driver if isinstance(driver, str) else "function"] for name, driver in self.drivers]
        return {"drivers": drivers, **self.which, **self.settings}

    def drive(self, folder: Path, *, overwrite: bool = False, shard: str | None = None) -> None:
        """Writes the files of the evaluation, or of a shard of it."""
        _native.evaluate(self._loaded(), self.which, self.settings, folder, overwrite, shard)

    def merge(self, shards: Sequence[Path], folder: Path) -> Evaluation:
        """Puts shards together."""
        _native.merge(self._loaded(), self.which, self.settings, folder, False, shards)
        return _read(folder)

    def _loaded(self) -> list[tuple[str, Any]]:
        return [(name, one if isinstance(one, str) else _function(name, one)) for name, one in self.drivers]


def _read(folder: Path) -> Evaluation:
    tables = json.loads(_native.read_finished(folder / "summary.json"))
    return Evaluation(
        summary=_table(tables["rows"]),
        comparisons=_table(tables["comparisons"]),
        trainings=_table(tables["trainings"]),
        causes=_table(tables["causes"]),
        noise_sweep=_table(tables["noise_sweep"]),
        runs=_table([_flat(line) for line in _lines(folder / "runs.jsonl")]),
        failures=_table(_lines(folder / "failures.jsonl")),
    )


def generate(
    lots: str | Sequence[str],
    *,
    seed: int = 1,
    count: int = 1,
    out: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
) -> Table:
    """Draws lots, as ``cargo xtask generate`` does.

    Args:
        lots: Names as on the command line.
        seed: Seed of the obstacles.
        count: Drawings of each lot, each with its own obstacles; for lots that draw them for every trial.
        out: Folder for TOML and PNG files; none are written if None.
        overwrite: Whether to replace files of the same name.

    Returns:
        Columns ``name``, ``toml`` (the text), ``path`` (empty without ``out``), ``route_m`` and ``obstacles`` (number).

    Raises:
        ValueError: If nothing is named so, a number is out of range, or a file exists already.
    """
    check_whole("seed", seed)
    check_whole("count", count, least=1, below=2**20)
    folder = None if out is None else Path(out)
    drawn = _native.generate(names(lots, "lots"), seed, count, folder, overwrite)
    columns = ("name", "toml", "path", "route_m", "obstacles")
    return {column: [lot[index] for lot in drawn] for index, column in enumerate(columns)}


def settings(
    preset: str | None = None,
    *,
    config: str | os.PathLike[str] | None = None,
    overrides: Sequence[str] = (),
) -> str:
    """All settings as TOML: preset, then file, then single changes.

    Raises:
        ValueError: Naming what is wrong, and where.
    """
    return _native.settings(settings_from(preset, config, overrides))


def _named(drivers: Driver | Sequence[Driver] | Mapping[str, Driver]) -> list[tuple[str, Driver]]:
    if isinstance(drivers, Mapping):
        named = list(drivers.items())
    else:
        several = [drivers] if isinstance(drivers, str) or not isinstance(drivers, Sequence) else drivers
        named = [(_name(driver), driver) for driver in several]
    if not named:
        raise ValueError("drivers: none are named")
    taken = [name for name, _ in named]
    for name in taken:
        if taken.count(name) > 1:
            raise ValueError(f"drivers: {name!r} is named twice; results are told apart by name, so give a mapping")
    return named


def _name(driver: Driver) -> str:
    return driver if isinstance(driver, str) else getattr(driver, "__name__", type(driver).__name__)


def _function(name: str, driver: Any) -> Callable[..., Floats]:
    remembers = hasattr(driver, "drive")
    if not remembers and not callable(driver):
        raise TypeError(f"driver {name!r} is {driver!r}: neither a name nor a function of grids")

    def drive(grids: Grids, cars: npt.NDArray[np.int64], was_reset: npt.NDArray[np.bool_]) -> Floats:
        answer = driver.drive(grids, cars, was_reset) if remembers else driver(grids)
        points = np.ascontiguousarray(answer, np.float32)
        if points.shape != (len(grids), 2):
            raise ValueError(f"driver {name!r}: answers of shape {points.shape}, {(len(grids), 2)} is needed")
        if not np.isfinite(points).all():
            raise ValueError(f"driver {name!r}: {points[~np.isfinite(points).all(1)][0]} is not a finite point")
        return points

    return drive


def _lines(path: Path) -> list[dict[str, Any]]:
    # Not splitlines(), which also parts at characters that JSON does not escape, such as U+2028.
    return [json.loads(line) for line in _native.read_finished(path).split("\n") if line]


def _flat(run: dict[str, Any]) -> dict[str, Any]:
    return {**{key: value for key, value in run.items() if key not in ("metrics", "events")}, **run["metrics"]}


def _table(rows: list[dict[str, Any]]) -> Table:
    columns = list(dict.fromkeys(column for row in rows for column in row))
    return {column: [row.get(column) for row in rows] for column in columns}
