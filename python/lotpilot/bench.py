"""How many control steps per second: ``python -m lotpilot.bench``.

Every row names what a step includes. Rows take turns, so that other load of the machine meets all of them alike, and
the median of the rounds is shown. *Per processor second* is what a step costs wherever it has to wait for a processor;
on a quiet machine, steps/s is that times the threads in use.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import platform
import statistics
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeVar

import gymnasium
import numpy as np

from ._native import RustLoop
from .core import settings_from
from .gym import LotVectorEnv

LOTS = ("lot-a", "lot-b", "lot-c")
TRIALS = 8
AHEAD_M = 6.0

Number = TypeVar("Number", int, float)

Drive = Callable[[float], int]
"""Drives for this many seconds and returns the number of steps."""


def until(seconds: float, step: Callable[[], int]) -> int:
    """Steps until the time is over."""
    steps, end = 0, time.perf_counter() + seconds
    while time.perf_counter() < end:
        steps += step()
    return steps


def vectorised(cars: int, threads: int, *, noise: str = "paper", steered: bool = True) -> Drive:
    """Cars stepped together; steered at the route (as in Rust), or at one point straight ahead."""
    envs = LotVectorEnv(cars, lots=LOTS, trials=TRIALS, noise=noise, threads=threads)
    envs.reset(seed=1)
    straight = np.tile(np.array([8.0, 0.0], np.float32), (cars, 1))

    def step() -> int:
        envs.step(envs.route_points(AHEAD_M) if steered else straight)
        return cars

    return lambda seconds: until(seconds, step)


def one_by_one(name: str, action: Callable[[gymnasium.Env[object, object]], object], **options: object) -> Drive:
    """One environment of Gymnasium without its checks, stepped with a constant action and reset at its ends."""
    env = gymnasium.make(name, disable_env_checker=True, **options)  # type: ignore[arg-type]
    env.reset(seed=1)
    constant = action(env)

    def step() -> int:
        _, _, terminated, truncated, _ = env.step(constant)
        if terminated or truncated:
            env.reset()
        return 1

    return lambda seconds: until(seconds, step)


def highway_env() -> Drive:
    """The racetrack of HighwayEnv, observed as an occupancy grid of as many cells of the same size.

    Cells of road are looked up as well, because our grid shows them. ``cargo xtask bench --peers`` has cells of cars
    alone, on ``racetrack-v1``, and another rate.
    """
    import highway_env

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if hasattr(highway_env, "_register_highway_envs"):
            highway_env._register_highway_envs()
        grid = {
            "type": "OccupancyGrid",
            "features": ["presence", "on_road"],
            "grid_size": [[-6, 6], [-6, 6]],
            "grid_step": [0.48, 0.48],
            "align_to_vehicle_axes": True,
        }
        config = {"observation": grid, "policy_frequency": 5, "simulation_frequency": 15}
        return one_by_one("racetrack-v0", lambda env: np.zeros(env.action_space.shape or ()), config=config)


PARKED = "".join(
    f"  - {{shape: {{name: rectangle, length: 2.0, width: 4.6}}, state: [{2.4 * i}, {y}, 0]}}\n"
    for i in range(20)
    for y in (4.2, -4.2)
)
IR_SIM = f"""
world: {{height: 60, width: 60, step_time: 0.05, sample_time: 0.05, offset: [0, -30], collision_mode: unobstructed}}
robot:
  - kinematics: {{name: acker}}
    shape: {{name: rectangle, length: 4.6, width: 1.8, wheelbase: 2.8}}
    state: [2, 0, 0, 0]
    goal: [50, 0, 0]
    behavior: {{name: dash}}
    vel_max: [1.5, 0.5]
    sensors:
      - {{type: lidar2d, range_min: 0, range_max: 16, angle_range: 3.14, number: 180, noise: false}}
obstacle:
{PARKED}"""


def ir_sim() -> Drive:
    """A car that heads for a goal between two rows of parked cars in IR-SIM, as ``cargo xtask bench --peers`` does."""
    with tempfile.TemporaryDirectory(prefix="lotpilot-") as scratch, contextlib.redirect_stdout(io.StringIO()):
        # It lists the windows that it cannot open and the packages that it does without.
        os.environ.setdefault("MPLBACKEND", "Agg")
        import irsim

        world = Path(scratch, "world.yaml")
        world.write_text(IR_SIM, encoding="utf-8")
        env = irsim.make(str(world), display=False, log_level="ERROR")

    def step() -> int:
        env.step()
        if env.done():
            env.reset()
        return 1

    return lambda seconds: until(seconds, step)


def peers() -> Iterable[tuple[str, Drive]]:
    """Other simulators, where they are installed."""
    for name, make in [
        ("HighwayEnv racetrack, one env: clean 25×25 grid, other cars, 3 physics steps", highway_env),
        ("IR-SIM, one car between 40 parked: scan of 180 rays, collisions, 1 physics step", ir_sim),
    ]:
        try:
            yield name, make()
        except ImportError:
            print(f"not installed: {name.partition(',')[0]}", file=sys.stderr)


def rows(cars: int, threads: int) -> list[tuple[str, Drive]]:
    """What is measured, Rust first."""
    tick_by_tick, car_by_car = (
        RustLoop(cars, LOTS, TRIALS, "paper", settings_from(None, None, ()), AHEAD_M, threads, together)
        for together in (True, False)
    )
    straight = np.array([8.0, 0.0], np.float32)
    return [
        (f"Rust, {cars} cars tick by tick: noisy 25×25 grid, 5 physics steps, metrics", tick_by_tick.drive),
        (f"Rust, {cars} cars, each 16 ticks at a time: no driver can answer for all of them", car_by_car.drive),
        (f"VectorEnv, {cars} cars: the same with rewards, info and resets", vectorised(cars, threads)),
        (f"VectorEnv, {cars} cars: straight on, mostly near-collisions", vectorised(cars, threads, steered=False)),
        (f"VectorEnv, {cars} cars: the route again, clean grid", vectorised(cars, threads, noise="clean")),
        ("Env, one car: straight on", one_by_one("lotpilot/Lot-v0", lambda _: straight, lots=LOTS, trials=TRIALS)),
        *peers(),
    ]


def processor() -> str:
    """Its name, where the system tells."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as cpuinfo:
            names = [line.partition(":")[2].strip() for line in cpuinfo if line.startswith("model name")]
    except OSError:
        names = []
    return names[0] if names else platform.processor() or "unknown processor"


def _within(number: type[Number], least: Number, most: Number) -> Callable[[str], Number]:
    """A number of an argument, refused by argparse if it is out of range."""

    def read(text: str) -> Number:
        value = number(text)
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text} is not within {least} … {most}")
        return value

    read.__name__ = number.__name__
    return read


def main() -> None:
    """Prints the table."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    parser = argparse.ArgumentParser(prog="python -m lotpilot.bench", description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--cars", type=_within(int, 1, 65_536), default=128, help="environments stepped together [default: 128]"
    )
    parser.add_argument(
        "--threads", type=_within(int, 1, 1024), default=cores, help="threads to step with [default: all cores]"
    )
    parser.add_argument(
        "--seconds", type=_within(float, 0.01, 3600.0), default=1.0, help="of each measurement [default: 1]"
    )
    parser.add_argument("--rounds", type=_within(int, 1, 1000), default=5, help="measurements of each row [default: 5]")
    asked = parser.parse_args()
    table = rows(asked.cars, asked.threads)
    measured: dict[str, list[tuple[float, float]]] = {name: [] for name, _ in table}
    for _ in range(asked.rounds):
        for name, drive in table:
            started, used = time.perf_counter(), time.process_time()
            steps = drive(asked.seconds)
            measured[name].append(
                (steps / (time.perf_counter() - started), steps / max(time.process_time() - used, 1e-9))
            )
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    print(f"{processor()}, {asked.threads} of {cores} cores{load}; Python {platform.python_version()}\n")
    print("|  steps/s | of Rust | per processor second | of Rust | a step |\n|---:|---:|---:|---:|:---|")
    medians = {
        name: [statistics.median(rates) for rates in zip(*pairs, strict=True)] for name, pairs in measured.items()
    }
    rust = next(iter(medians.values()))
    for name, rates in medians.items():
        cells = [f"{rate:8.0f} | {100 * rate / of_rust:5.0f} %" for rate, of_rust in zip(rates, rust, strict=True)]
        print("|", " | ".join(cells), "|", name, "|")


if __name__ == "__main__":
    main()
