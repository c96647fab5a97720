"""DAgger in one file: a network drives, the expert labels what it meets, the network learns.

    pip install ./python torch
    python python/examples/dagger.py

Prints near-collisions per 100 m on lots that were not trained on, after every round.
"""

import argparse
import time

import numpy as np
import torch

import lotpilot
from lotpilot.gym import LotVectorEnv


class Net(torch.nn.Module):
    """Grids [n, 25, 25] → look-ahead points [n, 2], ahead and left in metres."""

    def __init__(self) -> None:
        super().__init__()
        self.layers = torch.nn.Sequential(
            torch.nn.Conv2d(1, 16, 5), torch.nn.ReLU(), torch.nn.MaxPool2d(2),
            torch.nn.Conv2d(16, 32, 3), torch.nn.ReLU(), torch.nn.MaxPool2d(2),
            torch.nn.Flatten(), torch.nn.Linear(32 * 4 * 4, 128), torch.nn.ReLU(), torch.nn.Linear(128, 2),
        )  # fmt: skip

    def forward(self, grids: torch.Tensor) -> torch.Tensor:
        # Around the middle of what points are, in metres.
        return torch.tensor([8.0, 0.0]) + 3.0 * self.layers(grids.unsqueeze(1))

    @torch.no_grad()
    def drive(self, grids: np.ndarray, *_: object) -> np.ndarray:
        """What ``lotpilot.evaluate`` asks."""
        return self(torch.from_numpy(grids).float()).numpy()


def fit(net: Net, grids: np.ndarray, points: np.ndarray, steps: int) -> None:
    """Learns the expert's points."""
    optimizer = torch.optim.Adam(net.parameters(), 1e-3)
    x, y = torch.from_numpy(grids).float(), torch.from_numpy(points)
    for _ in range(steps):
        batch = torch.randint(len(x), (256,))
        loss = torch.nn.functional.smooth_l1_loss(net(x[batch]), y[batch])
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=4, help="rounds after behaviour cloning")
    parser.add_argument("--ticks", type=int, default=400, help="control steps of each car in a round")
    parser.add_argument("--cars", type=int, default=32, help="environments stepped together")
    parser.add_argument("--fit", type=int, default=600, help="training steps in a round")
    asked = parser.parse_args()

    torch.manual_seed(1)
    envs = LotVectorEnv(asked.cars, lots=["lot-a", "train:20"])
    net, seen, labels = Net(), [], []
    observed, _ = envs.reset(seed=1)
    began = time.monotonic()

    def say(what: str) -> None:
        print(f"{time.monotonic() - began:4.0f} s: {what}", flush=True)

    for round in range(asked.rounds + 1):
        for _ in range(asked.ticks):
            expert = envs.expert_actions()
            # An episode that has ended is reset by the next step, which has no label and heeds no action.
            driving = np.isfinite(expert).all(1)
            seen.append(observed[driving])
            labels.append(expert[driving])
            # Behaviour cloning first: there the expert drives.
            observed, *_ = envs.step(expert if round == 0 else net.drive(observed))
        say(f"round {round}: driven, {sum(map(len, seen))} samples")
        fit(net, np.concatenate(seen), np.concatenate(labels), asked.fit)
        say(f"round {round}: learned")
        table = lotpilot.evaluate({f"round {round}": net}, ["test:6"], trials=1, seed=7).summary
        say(f"round {round}: {table['per_100m'][0]:.2f} near-collisions per 100 m")
    torch.save(net.state_dict(), "dagger-lotpilot.pt")
