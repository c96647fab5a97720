"""Behaviour cloning and DAgger of ``imitation``, with the expert that sees the clean scene.

    python -m venv imitation && imitation/bin/pip install ./python -r python/examples/imitation.txt
    imitation/bin/python python/examples/imitation_dagger.py

Prints near-collisions per 100 m on lots that were not trained on, after each. imitation 1.0.1 asks for older versions
of its neighbours, hence an environment of its own.
"""

import argparse
import tempfile

import numpy as np
import torch
from imitation.algorithms.bc import BC
from imitation.algorithms.dagger import SimpleDAggerTrainer
from imitation.data import rollout
from stable_baselines3.common.policies import ActorCriticPolicy, BasePolicy

import lotpilot
from lotpilot.sb3 import LotVecEnv


class Expert(BasePolicy):
    """Answers for the cars as they stand, whatever of them is observed."""

    def __init__(self, envs: LotVecEnv) -> None:
        super().__init__(envs.observation_space, envs.action_space)
        self.envs = envs

    def _predict(self, observation: torch.Tensor, deterministic: bool = False) -> torch.Tensor:
        return torch.from_numpy(self.envs.expert_actions())


def measure(name: str, policy: BasePolicy, envs: LotVecEnv) -> None:
    """Drives the policy on unseen lots."""
    low, high = envs.core.low, envs.core.high

    def drive(grids: np.ndarray) -> np.ndarray:
        actions, _ = policy.predict(grids, deterministic=True)
        return low + 0.5 * (actions + 1.0) * (high - low)

    table = lotpilot.evaluate({name: drive}, ["test:6", "lot-b"], trials=1, seed=7).runs
    rate = 100.0 * sum(table["near_collisions"]) / sum(table["driven_m"])
    print(f"{name}: {rate:.2f} near-collisions per 100 m driven", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cars", type=int, default=16, help="environments stepped together")
    parser.add_argument("--steps", type=int, default=20_000, help="control steps that the expert drives")
    parser.add_argument("--dagger", type=int, default=40_000, help="control steps of DAgger")
    parser.add_argument("--epochs", type=int, default=4, help="passes over the data, each time that is learned")
    asked = parser.parse_args()

    rng = np.random.default_rng(1)
    # DAgger takes whole episodes: short ones, on many lots.
    envs = LotVecEnv(asked.cars, lots=["lot-a", "train:20"], overrides=["episode.metrics.timeout_s=30.0"])
    expert = Expert(envs)

    enough = rollout.make_sample_until(min_timesteps=asked.steps)
    demonstrations = rollout.rollout(expert, envs, enough, rng=rng, unwrap=False)
    network = ActorCriticPolicy(envs.observation_space, envs.action_space, lambda _: 1e-3, net_arch=[256, 128])
    cloning = BC(
        observation_space=envs.observation_space,
        action_space=envs.action_space,
        demonstrations=rollout.flatten_trajectories(demonstrations),
        policy=network,
        batch_size=256,
        rng=rng,
        device="cpu",
    )
    measure("untrained", cloning.policy, envs)
    cloning.train(n_epochs=asked.epochs, progress_bar=False, log_interval=10**9)
    measure("behaviour cloning", cloning.policy, envs)

    with tempfile.TemporaryDirectory() as scratch:
        dagger = SimpleDAggerTrainer(
            venv=envs,
            scratch_dir=scratch,
            expert_policy=expert,
            expert_trajs=demonstrations,
            bc_trainer=cloning,
            rng=rng,
        )
        dagger.train(
            total_timesteps=asked.dagger,
            rollout_round_min_episodes=1,
            rollout_round_min_timesteps=asked.dagger // 4,
            bc_train_kwargs={"n_epochs": asked.epochs, "progress_bar": False, "log_interval": 10**9},
        )
    measure("DAgger", dagger.policy, envs)
