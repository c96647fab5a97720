"""PPO of Stable-Baselines3 learns to drive from the grid alone.

    pip install "./python[sb3]"
    python python/examples/ppo.py --steps 1000000

Prints near-collisions per 100 m on lots that were not trained on, before and after.
"""

import argparse

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor

import lotpilot
from lotpilot.sb3 import LotVecEnv

UNSEEN = ["test:6", "lot-b"]


def measure(model: PPO, envs: LotVecEnv, name: str) -> None:
    """Drives the policy on unseen lots."""
    low, high = envs.core.low, envs.core.high

    def policy(grids: np.ndarray) -> np.ndarray:
        actions, _ = model.predict(grids, deterministic=True)
        return low + 0.5 * (actions + 1.0) * (high - low)

    # Enough near-collisions to tell; a policy that knows nothing would have thousands.
    limits = ["episode.metrics.timeout_s=300.0", "episode.metrics.events_max=30"]
    table = lotpilot.evaluate({name: policy}, UNSEEN, trials=1, seed=7, overrides=limits).summary
    for lots, direction, rate, route_m in zip(
        table["lots"], table["direction"], table["per_100m"], table["reference_m"], strict=True
    ):
        if direction == "both":
            print(f"{name}, {lots}: {rate:.2f} near-collisions per 100 m ({route_m:.0f} m)")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=1_000_000, help="control steps to learn from")
    parser.add_argument("--cars", type=int, default=64, help="environments stepped together")
    asked = parser.parse_args()

    envs = LotVecEnv(
        asked.cars,
        lots=["lot-a", "train:40", "train:20:easy"],
        reward={"near_collision": 10.0, "clearance": 0.2},
        # Short episodes visit more lots; the first three near-collisions of a drive teach enough.
        overrides=["episode.metrics.timeout_s=120.0", "episode.metrics.events_max=3"],
    )
    model = PPO(
        "MlpPolicy",
        VecMonitor(envs),
        n_steps=128,
        batch_size=1024,
        n_epochs=5,
        gamma=0.98,
        learning_rate=3e-4,
        # Actions are a share of a patch of 12 m: a spread of 6 m explores nothing but walls.
        policy_kwargs={"log_std_init": -1.5, "net_arch": [256, 128]},
        device="cpu",
        verbose=1,
        seed=1,
    )
    measure(model, envs, "before")
    model.learn(asked.steps, log_interval=20)
    measure(model, envs, "after")
    model.save("ppo-lotpilot")
