"""Answers of a trained network with numpy alone: numpy_forward.py FOLDER GRIDS.npy ANSWERS.npy"""

import json
import sys
import tomllib
from pathlib import Path

import numpy as np


def load(folder):
    """model.toml, and the tensors of model.safetensors by name."""
    model = tomllib.loads((Path(folder) / "model.toml").read_text(encoding="utf-8"))
    data = (Path(folder) / "model.safetensors").read_bytes()
    start = 8 + int.from_bytes(data[:8], "little")
    header = json.loads(data[8:start])
    header.pop("__metadata__", None)
    tensors = {}
    for name, about in header.items():
        first, last = about["data_offsets"]
        tensors[name] = np.frombuffer(data[start + first : start + last], "<f4").reshape(about["shape"])
    return model, tensors


def conv2d(x, weight, bias, padding):
    """[batch, in, rows, columns] to [batch, out, rows, columns]."""
    x = np.pad(x, ((0, 0), (0, 0), padding, padding))
    windows = np.lib.stride_tricks.sliding_window_view(x, weight.shape[2:], axis=(2, 3))
    return np.einsum("bircxy,oixy->borc", windows, weight, optimize=True) + bias[:, None, None]


def max_pool(x):
    """Halves rows and columns; an odd last one is left out."""
    batch, channels, rows, columns = x.shape
    x = x[:, :, : rows // 2 * 2, : columns // 2 * 2]
    return x.reshape(batch, channels, rows // 2, 2, columns // 2, 2).max(axis=(3, 5))


def forward(model, tensors, grids):
    """Grids [batch, 25, 25] to the m answers of each [batch, m, 4], and the logarithms of their weights [batch, m]."""
    x = grids[:, None].astype(np.float32)
    for layer in model["layers"]:
        weight, bias = tensors[layer["name"] + ".weight"], tensors[layer["name"] + ".bias"]
        if layer["kind"] == "conv2d":
            y = conv2d(x, weight, bias, tuple(layer["padding"]))
            x = y + x if layer.get("residual") else max_pool(y)
        else:
            x = x.reshape(len(x), -1) @ weight.T + bias
        if layer["activation"] == "relu":
            x = np.maximum(x, 0)
    modes = model["network"]["modes"]
    logits = x[:, 4 * modes :] if modes > 1 else np.zeros((len(x), 1))
    logits = logits - logits.max(axis=1, keepdims=True)
    return x[:, : 4 * modes].reshape(-1, modes, 4), logits - np.log(np.exp(logits).sum(axis=1, keepdims=True))


def answer(model, tensors, grids):
    """Grids [batch, 25, 25] to [batch, 4]: mean u, w and standard deviations of u, w, in image fractions."""
    of_grid, log_weights = forward(model, tensors, grids)
    each = range(len(grids))
    raw = of_grid[each, log_weights.argmax(axis=1)]
    if model["inference"]["mirror_averaging"]:
        of_image, image_log_weights = forward(model, tensors, grids[:, :, ::-1])
        of_image = of_image * [-1, 1, 1, 1] + [1, 0, 0, 0]
        # The likelier of both, and the other's nearest to it.
        image_first = image_log_weights.max(axis=1) > log_weights.max(axis=1)
        raw = np.where(image_first[:, None], of_image[each, image_log_weights.argmax(axis=1)], raw)
        others = np.where(image_first[:, None, None], of_grid, of_image)
        nearest = np.linalg.norm(others[:, :, :2] - raw[:, None, :2], axis=2).argmin(axis=1)
        raw = (raw + others[each, nearest]) / 2
    low, high = model["log_variance_min"], model["log_variance_max"]
    mid, half = (low + high) / 2, (high - low) / 2
    log_variance = mid + half * np.tanh((raw[:, 2:] - mid) / half)
    return np.hstack([raw[:, :2], np.exp(log_variance / 2)])


if __name__ == "__main__":
    folder, grids, answers = sys.argv[1:]
    np.save(answers, answer(*load(folder), np.load(grids)).astype(np.float32))
