"""Raw outputs of a trained network with PyTorch: torch_module.py FOLDER GRIDS.npy OUTPUTS.npy"""

import sys
import tomllib
from pathlib import Path

import numpy as np
import torch
from safetensors.torch import load_file
from torch import nn
from torch.nn import functional as F


class LookAheadNet(nn.Module):
    def __init__(self, layers):
        super().__init__()
        self.layers = layers
        for layer in layers:
            outputs, inputs, *kernel = layer["weight_shape"]
            self.add_module(layer["name"], nn.Conv2d(inputs, outputs, kernel) if kernel else nn.Linear(inputs, outputs))

    def forward(self, x):  # [batch, 1, 25, 25], 1 = non-drivable
        for layer in self.layers:
            if layer["kind"] == "conv2d":
                y = self.get_submodule(layer["name"])(F.pad(x, layer["padding"] * 2))
                x = y + x if layer.get("residual") else F.max_pool2d(y, layer["max_pool"])
            else:
                x = self.get_submodule(layer["name"])(x.flatten(1))
            x = F.relu(x) if layer["activation"] == "relu" else x
        return x  # [batch, 4]: u, w, raw log-variances of both; of m modes [batch, 5 m]: m times these, then m logits


if __name__ == "__main__":
    folder, grids, outputs = sys.argv[1:]
    net = LookAheadNet(tomllib.loads((Path(folder) / "model.toml").read_text(encoding="utf-8"))["layers"])
    net.load_state_dict(load_file(Path(folder) / "model.safetensors"))
    with torch.no_grad():
        np.save(outputs, net(torch.from_numpy(np.load(grids)).float()[:, None]).numpy())
