"""DAgger whose data are collected by the nodes of a Ray cluster; the network learns where this is started.

    pip install "./python[ray]" torch
    python python/examples/dagger_ray.py --address auto

A node that dies costs what it was collecting: Ray begins that elsewhere, with the same cars and the same result.
"""

import argparse
from pathlib import Path

import numpy as np
import ray
import torch
from dagger import Net, fit

import lotpilot
from lotpilot.gym import LotVectorEnv


def collect(weights: dict[str, torch.Tensor] | None, seed: int, cars: int, ticks: int) -> tuple[np.ndarray, np.ndarray]:
    """What cars of one seed see while a network drives, or the expert, and the expert's labels."""
    torch.set_num_threads(1)
    net = Net()
    if weights is not None:
        net.load_state_dict(weights)
    envs = LotVectorEnv(cars, lots=["lot-a", "train:20"], threads=1)
    observed, _ = envs.reset(seed=seed)
    seen, labels = [], []
    for _ in range(ticks):
        expert = envs.expert_actions()
        # An episode that has ended is reset by the next step, which has no label and heeds no action.
        driving = np.isfinite(expert).all(1)
        seen.append(observed[driving])
        labels.append(expert[driving])
        observed, *_ = envs.step(expert if weights is None else net.drive(observed))
    return np.concatenate(seen), np.concatenate(labels)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--address", help="of the cluster; one is started on this machine if it is not given")
    parser.add_argument("--rounds", type=int, default=4, help="rounds after behaviour cloning")
    parser.add_argument("--tasks", type=int, default=8, help="tasks of a round, each with cars of its own")
    parser.add_argument("--cars", type=int, default=8, help="cars of a task")
    parser.add_argument("--ticks", type=int, default=200, help="control steps of each car")
    parser.add_argument("--fit", type=int, default=600, help="training steps in a round")
    asked = parser.parse_args()

    torch.manual_seed(1)
    # The nodes import dagger.py as well.
    examples = {"working_dir": str(Path(__file__).parent)}
    ray.init(address=asked.address, log_to_driver=False, runtime_env=examples)
    task = ray.remote(collect)
    net, seen, labels = Net(), [], []
    for round in range(asked.rounds + 1):
        weights = ray.put(net.state_dict()) if round > 0 else None
        seeds = [1 + round * asked.tasks + index for index in range(asked.tasks)]
        for grids, points in ray.get([task.remote(weights, seed, asked.cars, asked.ticks) for seed in seeds]):
            seen.append(grids)
            labels.append(points)
        print(f"round {round}: {sum(map(len, seen))} samples", flush=True)
        fit(net, np.concatenate(seen), np.concatenate(labels), asked.fit)
        table = lotpilot.evaluate({f"round {round}": net}, ["test:6"], trials=1, seed=7).summary
        print(f"round {round}: {table['per_100m'][0]:.2f} near-collisions per 100 m", flush=True)
