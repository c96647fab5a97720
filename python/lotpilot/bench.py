"""How many control steps per second: ``python -m lotpilot.bench``.

Every row names what a step includes. Rows take turns, so that other load of the machine meets all of them alike, and
the median of the rounds is shown.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import time
from collections.abc import Callable, Iterable
from itertools import cycle, islice

import gymnasium
import numpy as np

from . import __name__ as package
from ._native import rust_rate
from .core import settings_from
from .gym import LotVectorEnv

LOTS = ("lot-a", "lot-b", "lot-c")
TRIALS = 8
AHEAD_M = 6.0

Rate = Callable[[float], float]
"""Steps per second, measured for so many seconds."""


def vectorised(cars: int, threads: int, *, noise: str = "paper", steered: bool = True) -> Rate:
    """Cars stepped together; steered at the route (as in Rust), or at one point straight ahead."""
    envs = LotVectorEnv(cars, lots=LOTS, trials=TRIALS, noise=noise, threads=threads)
    envs.reset(seed=1)
    straight = np.tile(np.array([8.0, 0.0], np.float32), (cars, 1))

    def rate(seconds: float) -> float:
        steps, started = 0, time.perf_counter()
        while (elapsed := time.perf_counter() - started) < seconds:
            for _ in range(50):
                envs.step(envs.route_points(AHEAD_M) if steered else straight)
            steps += 50 * cars
        return steps / elapsed if steps else 0.0

    rate(0.2)
    return rate


def in_rust(cars: int, threads: int) -> Rate:
    """The same episodes and the same driver without Python."""

    def rate(seconds: float) -> float:
        return rust_rate(cars, LOTS, "paper", settings_from(None, None, ()), AHEAD_M, threads, seconds)

    return rate


def one_by_one(name: str, **options: object) -> Rate:
    """One environment of Gymnasium, stepped with a constant action and reset at its ends."""
    env = gymnasium.make(name, **options)  # type: ignore[arg-type]
    env.reset(seed=1)
    low, high = env.action_space.low, env.action_space.high  # type: ignore[attr-defined]
    action = np.array([8.0, 0.0], np.float32) if name.startswith(package) else 0.5 * (low + high)

    def rate(seconds: float) -> float:
        steps, started = 0, time.perf_counter()
        while (elapsed := time.perf_counter() - started) < seconds:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
            steps += 1
        return steps / elapsed

    rate(0.2)
    return rate


def peers() -> Iterable[tuple[str, Rate]]:
    """Other simulators, where they are installed."""
    try:
        import highway_env
    except ImportError:
        return
    if hasattr(highway_env, "_register_highway_envs"):
        highway_env._register_highway_envs()
    grid = {
        "observation": {"type": "OccupancyGrid", "features": ["presence", "on_road"], "grid_size": [[-18, 18], [-18, 18]],
                        "grid_step": [3, 3], "as_image": False, "align_to_vehicle_axes": True},
        "policy_frequency": 5, "simulation_frequency": 15,
    }  # fmt: skip
    yield (
        "HighwayEnv racetrack, one env: 12×12 grid, other cars, 3 physics steps",
        one_by_one("racetrack-v0", config=grid),
    )


def rows(cars: int, threads: int) -> list[tuple[str, Rate]]:
    """What is measured."""
    return [
        (f"Rust alone, {cars} cars in lock-step: noisy grid, 5 physics steps, metrics", in_rust(cars, threads)),
        (f"VectorEnv, {cars} cars, the same driver and resets", vectorised(cars, threads)),
        (
            f"VectorEnv, {cars} cars, one point straight ahead: mostly near-collisions",
            vectorised(cars, threads, steered=False),
        ),
        (f"VectorEnv, {cars} cars, the same driver, clean grid", vectorised(cars, threads, noise="clean")),
        ("Env, one car, a point straight ahead", one_by_one("lotpilot/Lot-v0", lots=LOTS, trials=TRIALS)),
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


def main() -> None:
    """Prints the table."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    parser = argparse.ArgumentParser(prog=f"python -m {package}.bench", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cars", type=int, default=128, help="environments stepped together [default: 128]")
    parser.add_argument("--threads", type=int, default=cores, help="threads to step with [default: all cores]")
    parser.add_argument("--seconds", type=float, default=1.0, help="of each measurement [default: 1]")
    parser.add_argument("--rounds", type=int, default=5, help="measurements of each row [default: 5]")
    asked = parser.parse_args()
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    print(f"{processor()}, {asked.threads} of {cores} cores{load}; Python {platform.python_version()}")
    measured: dict[str, list[float]] = {}
    table = rows(asked.cars, asked.threads)
    for name, rate in islice(cycle(table), asked.rounds * len(table)):
        measured.setdefault(name, []).append(rate(asked.seconds))
    rust = statistics.median(next(iter(measured.values())))
    print("\n|  steps/s | of Rust | a step |\n|---:|---:|:---|")
    for name, rates in measured.items():
        median = statistics.median(rates)
        print(f"| {median:8.0f} | {100 * median / rust:5.0f} % | {name} |")


if __name__ == "__main__":
    main()
