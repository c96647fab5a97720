"""Samples per second of PyTorch on the network of lotpilot, at its best on CPUs: channels last, fused Adam.

python torch_training.py NETWORK BATCH STEPS    (run with mimalloc preloaded, if it is installed)

A step is what a step of lotpilot is: forward, the weighted β-NLL, backward, clipping, Adam. Data lie in memory.
"""

import sys
import time

import torch
from torch import nn
from torch.nn import functional as F

NETWORKS = {"compact": (16, 3, 32, 3, 256, 0.0, 0.2), "paper": (32, 5, 64, 2, 1000, 0.25, 0.5)}


class LookAheadNet(nn.Module):
    def __init__(self, name):
        super().__init__()
        c1, k1, c2, k2, hidden, self.p1, self.p2 = NETWORKS[name]
        self.pad1, self.pad2 = [((k - 1) // 2, k // 2) * 2 for k in (k1, k2)]
        self.conv1, self.conv2 = nn.Conv2d(1, c1, k1), nn.Conv2d(c1, c2, k2)
        self.fc1, self.fc2 = nn.Linear(36 * c2, hidden), nn.Linear(hidden, 4)

    def forward(self, x):
        x = F.relu(F.max_pool2d(self.conv1(F.pad(x, self.pad1)), 2))
        x = F.relu(F.max_pool2d(self.conv2(F.pad(x, self.pad2)), 2)).flatten(1)
        x = F.dropout(x, self.p1, self.training) if self.p1 > 0 else x
        x = F.dropout(F.relu(self.fc1(x)), self.p2, self.training)
        return self.fc2(x)


def loss(out, label, weight, beta=0.5):
    mid, half = -4.6, 4.6
    s = mid + half * torch.tanh((out[:, 2:] - mid) / half)
    misfit = weight * (label - out[:, :2]) ** 2 * torch.exp(-s)
    return (0.5 * (misfit + s) * torch.exp(beta * s.detach())).mean()


def main():
    name, batch, steps = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    torch.manual_seed(1)
    torch.set_num_threads(2)
    torch.set_flush_denormal(True)
    net = LookAheadNet(name).to(memory_format=torch.channels_last)
    optimiser = torch.optim.Adam(net.parameters(), lr=1e-4, fused=True)
    grids = (torch.rand(8192, 1, 25, 25) < 0.5).float()
    labels, weights = torch.rand(8192, 2), torch.ones(8192, 1)
    began, since = None, 0
    for step in range(steps + 20):
        if step == 20:  # warmed up
            began = time.perf_counter()
        rows = torch.randint(0, 8192, (batch,))
        x = grids[rows].contiguous(memory_format=torch.channels_last)
        optimiser.zero_grad(set_to_none=True)
        loss(net(x), labels[rows], weights[rows]).backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 5.0)
        optimiser.step()
        since += step >= 20
    seconds = time.perf_counter() - began
    print(f"torch {torch.__version__} {name} batch {batch} steps {steps}: {batch * since / seconds:.0f} samples/s")


main()
