"""PPO in one file, in the manner of CleanRL: PyTorch and Gymnasium's vector interface, nothing else.

    pip install ./python torch
    python python/examples/ppo_cleanrl.py --minutes 20

Prints returns as it learns, and near-collisions per 100 m on lots that were not trained on, before and after.
"""

import argparse
import time

import gymnasium
import numpy as np
import torch
from torch import nn
from torch.distributions import Normal

import lotpilot


def layer(module: nn.Module, scale: float = 2**0.5) -> nn.Module:
    nn.init.orthogonal_(module.weight, scale)
    nn.init.zeros_(module.bias)
    return module


class Agent(nn.Module):
    """Grids [n, 25, 25] → actions within about -1 … 1 [n, 2], and values [n]."""

    def __init__(self) -> None:
        super().__init__()
        self.eyes = nn.Sequential(
            layer(nn.Conv2d(1, 16, 5, stride=2)), nn.ReLU(), layer(nn.Conv2d(16, 32, 3, stride=2)), nn.ReLU(),
            nn.Flatten(), layer(nn.Linear(32 * 5 * 5, 128)), nn.ReLU(),
        )  # fmt: skip
        self.mean = layer(nn.Linear(128, 2), 0.01)
        self.value = layer(nn.Linear(128, 1), 1.0)
        # Actions are a share of a patch of 12 m: a spread of 1.3 m.
        self.log_std = nn.Parameter(torch.full((2,), -1.5))

    def forward(self, grids: torch.Tensor) -> tuple[Normal, torch.Tensor]:
        seen = self.eyes(grids.float().unsqueeze(1))
        return Normal(self.mean(seen), self.log_std.exp()), self.value(seen).squeeze(1)


def measure(agent: Agent, low: np.ndarray, high: np.ndarray, name: str) -> None:
    """Drives the mean action on unseen lots."""

    @torch.no_grad()
    def policy(grids: np.ndarray) -> np.ndarray:
        mean = agent(torch.from_numpy(grids))[0].mean.clamp(-1, 1).numpy()
        return low + 0.5 * (mean + 1.0) * (high - low)

    table = lotpilot.evaluate({name: policy}, ["test:6", "lot-b"], trials=1, seed=7).runs
    rate = 100.0 * sum(table["near_collisions"]) / sum(table["driven_m"])
    print(f"{name}: {rate:.2f} near-collisions per 100 m driven", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=20.0, help="time to learn")
    parser.add_argument("--cars", type=int, default=64, help="environments stepped together")
    parser.add_argument("--steps", type=int, default=128, help="actions of each car between two updates")
    parser.add_argument("--repeat", type=int, default=4, help="control ticks that an action is held")
    parser.add_argument("--epochs", type=int, default=5, help="passes over what was driven")
    parser.add_argument("--batch", type=int, default=1024, help="samples of an optimiser step")
    parser.add_argument("--gamma", type=float, default=0.98, help="discount")
    parser.add_argument("--gae", type=float, default=0.95, help="lambda of the advantages")
    parser.add_argument("--clip", type=float, default=0.2, help="change of the policy in one update")
    parser.add_argument("--rate", type=float, default=3e-4, help="learning rate")
    parser.add_argument("--scale", type=float, default=0.2, help="what rewards are multiplied by")
    parser.add_argument("--threads", type=int, default=2, help="threads to drive and to learn with")
    asked = parser.parse_args()

    torch.manual_seed(1)
    torch.set_num_threads(asked.threads)
    envs = gymnasium.make_vec(
        "lotpilot/Lot-v0",
        asked.cars,
        vectorization_mode="vector_entry_point",
        autoreset_mode="SameStep",
        lots=["lot-a", "train:40", "train:20:easy"],
        reward={"near_collision": 10.0, "clearance": 0.2},
        overrides=["episode.metrics.timeout_s=120.0", "episode.metrics.events_max=3"],
        normalise=True,
        threads=asked.threads,
    )
    low, high = envs.unwrapped.core.low, envs.unwrapped.core.high
    agent = Agent()
    optimizer = torch.optim.Adam(agent.parameters(), lr=asked.rate, eps=1e-5)
    measure(agent, low, high, "before")

    shape = (asked.steps, asked.cars)
    grids = torch.zeros((*shape, 25, 25), dtype=torch.uint8)
    actions, log_probs = torch.zeros((*shape, 2)), torch.zeros(shape)
    rewards, values, ends = torch.zeros(shape), torch.zeros(shape), torch.zeros(shape)
    seen, _ = envs.reset(seed=1)
    returns, running, ended = [], np.zeros(asked.cars), 0
    began, update = time.monotonic(), 0
    while time.monotonic() - began < 60.0 * asked.minutes:
        for step in range(asked.steps):
            grids[step] = torch.from_numpy(seen)
            with torch.no_grad():
                distribution, values[step] = agent(grids[step])
            actions[step] = distribution.sample()
            log_probs[step] = distribution.log_prob(actions[step]).sum(1)
            held, later, done = np.zeros(asked.cars), np.zeros(asked.cars), np.zeros(asked.cars, bool)
            for _ in range(asked.repeat):
                seen, reward, terminated, truncated, infos = envs.step(actions[step].clamp(-1, 1).numpy())
                held += np.where(done, 0.0, reward)
                # An episode that ran out of time would have gone on for all that the policy knows.
                late = np.flatnonzero(truncated & ~done)
                if len(late):
                    last = torch.from_numpy(np.stack([infos["final_obs"][car] for car in late]))
                    with torch.no_grad():
                        later[late] = asked.gamma * agent(last)[1].numpy()
                done |= terminated | truncated
            running += held
            returns.extend(running[done])
            running[done] = 0.0
            rewards[step] = torch.from_numpy(asked.scale * held + later)
            ends[step] = torch.from_numpy(done)
        with torch.no_grad():
            after = agent(torch.from_numpy(seen))[1]
        advantages = torch.zeros(shape)
        advantage = torch.zeros(asked.cars)
        for step in reversed(range(asked.steps)):
            goes_on = 1.0 - ends[step]
            surprise = rewards[step] + asked.gamma * goes_on * after - values[step]
            advantage = surprise + asked.gamma * asked.gae * goes_on * advantage
            advantages[step], after = advantage, values[step]

        flat = [part.flatten(0, 1) for part in (grids, actions, log_probs, advantages, advantages + values)]
        for _ in range(asked.epochs):
            for batch in torch.randperm(len(flat[0])).split(asked.batch):
                grid, action, old, advantage_of, target = (part[batch] for part in flat)
                distribution, value = agent(grid)
                ratio = (distribution.log_prob(action).sum(1) - old).exp()
                advantage_of = (advantage_of - advantage_of.mean()) / (advantage_of.std() + 1e-8)
                clipped = ratio.clamp(1.0 - asked.clip, 1.0 + asked.clip)
                gain = torch.minimum(ratio * advantage_of, clipped * advantage_of).mean()
                loss = 0.5 * (value - target).square().mean() - gain
                optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
                optimizer.step()
        update += 1
        if update % 10 == 0:
            ticks = update * asked.steps * asked.cars * asked.repeat
            took = time.monotonic() - began
            mean = np.mean(returns[-200:]) if returns else np.nan
            print(f"{took:5.0f} s, {ticks} ticks, {ticks / took:.0f} per second, return {mean:.1f}", flush=True)
    measure(agent, low, high, "after")
    torch.save(agent.state_dict(), "ppo-cleanrl-lotpilot.pt")
