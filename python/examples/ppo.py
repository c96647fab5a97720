"""PPO of Stable-Baselines3 learns to drive from the grid alone.

    pip install "./python[sb3]"
    python python/examples/ppo.py --minutes 30

Prints near-collisions per 100 m and the share of the route driven on lots that were not trained on, before and after.
"""

import argparse
import time

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.vec_env import VecEnvWrapper, VecMonitor, VecNormalize

import lotpilot
from lotpilot.sb3 import LotVecEnv

UNSEEN = ["test:6", "lot-b"]
REPEAT = 4


class Repeat(VecEnvWrapper):
    """Holds every action for ``REPEAT`` control ticks: what a steering wheel can follow, and a longer view ahead."""

    def reset(self):
        return self.venv.reset()

    def step_wait(self):
        seen, total, dones, infos = self.venv.step_wait()
        for _ in range(REPEAT - 1):
            self.venv.step_async(self.actions)
            seen, rewards, now, later = self.venv.step_wait()
            # Rewards of an episode that has begun since are not part of the one that ended.
            total += np.where(dones, 0.0, rewards)
            infos = [old if ended else new for old, new, ended in zip(infos, later, dones, strict=True)]
            dones = dones | now
        return seen, total, dones, infos

    def step_async(self, actions):
        self.actions = actions
        self.venv.step_async(actions)


class Eyes(BaseFeaturesExtractor):
    """Two small convolutions: what is seen may be anywhere in the grid."""

    def __init__(self, space):
        super().__init__(space, 128)
        self.layers = torch.nn.Sequential(
            torch.nn.Conv2d(1, 16, 5, stride=2), torch.nn.ReLU(),
            torch.nn.Conv2d(16, 32, 3, stride=2), torch.nn.ReLU(),
            torch.nn.Flatten(), torch.nn.Linear(32 * 5 * 5, 128), torch.nn.ReLU(),
        )  # fmt: skip

    def forward(self, grids):
        return self.layers(grids.unsqueeze(1))


class Until(BaseCallback):
    """Ends the training when its time is over."""

    def __init__(self, minutes):
        super().__init__()
        self.end = time.monotonic() + 60.0 * minutes

    def _on_step(self):
        return time.monotonic() < self.end


def measure(model: PPO, envs: LotVecEnv, name: str) -> None:
    """Drives the policy on unseen lots."""
    low, high = envs.core.low, envs.core.high

    def policy(grids: np.ndarray) -> np.ndarray:
        actions, _ = model.predict(grids, deterministic=True)
        return low + 0.5 * (actions + 1.0) * (high - low)

    # Enough near-collisions to tell; a policy that knows nothing would have thousands.
    limits = ["episode.metrics.timeout_s=300.0", "episode.metrics.events_max=30"]
    table = lotpilot.evaluate({name: policy}, UNSEEN, trials=1, seed=7, overrides=limits).runs
    driven, route = np.array(table["driven_m"]), np.array(table["reference_m"])
    ended = table["ending"].count("reached_end")
    print(
        f"{name}: {100 * sum(table['near_collisions']) / driven.sum():.2f} near-collisions per 100 m driven, "
        f"{100 * np.minimum(driven, route).sum() / route.sum():.0f} % of {route.sum():.0f} m of route, "
        f"{ended} of {len(route)} runs to the end",
        flush=True,
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=25.0, help="time to learn")
    parser.add_argument("--cars", type=int, default=64, help="environments stepped together")
    parser.add_argument("--threads", type=int, default=2, help="threads to drive and to learn with")
    asked = parser.parse_args()

    torch.set_num_threads(asked.threads)
    envs = LotVecEnv(
        asked.cars,
        lots=["lot-a", "train:40", "train:20:easy"],
        reward={"near_collision": 10.0, "clearance": 0.2},
        # Short episodes visit more lots; the first three near-collisions of a drive teach enough.
        overrides=["episode.metrics.timeout_s=120.0", "episode.metrics.events_max=3"],
        threads=asked.threads,
    )
    model = PPO(
        "MlpPolicy",
        VecNormalize(VecMonitor(Repeat(envs)), norm_obs=False),
        n_steps=64,
        batch_size=512,
        n_epochs=5,
        gamma=0.98,
        learning_rate=4e-4,
        # Actions are a share of a patch of 12 m: a spread of 6 m explores nothing but walls.
        policy_kwargs={"log_std_init": -1.5, "features_extractor_class": Eyes, "net_arch": [64]},
        device="cpu",
        verbose=1,
        seed=1,
    )
    measure(model, envs, "before")
    model.learn(10**9, callback=Until(asked.minutes), log_interval=20)
    print(f"{REPEAT * model.num_timesteps} control steps, {time.process_time():.0f} s of processor time")
    measure(model, envs, "after")
    model.save("ppo-lotpilot")
