"""Control steps per second of Tactics2D: its parking environment, one process, no window."""

import os
import time
import warnings

warnings.filterwarnings("ignore")
os.environ.update(SDL_VIDEODRIVER="dummy", SDL_AUDIODRIVER="dummy", PYGAME_HIDE_SUPPORT_PROMPT="1", MPLBACKEND="Agg")
import numpy as np
import tactics2d
from tactics2d.envs import ParkingEnv

env = ParkingEnv(type_proportion=1.0, render_mode="rgb_array")  # type_proportion 1: bays, not spaces along a kerb
env.reset(seed=1)
steps, began = 0, time.perf_counter()
while time.perf_counter() - began < 10:
    action = np.array([0.1 * np.sin(steps / 20), 0.5 * np.cos(steps / 30)], dtype=np.float32)
    _, _, done, cut, _ = env.step(action)
    steps += 1
    if done or cut:
        env.reset()
print(f"tactics2d {tactics2d.__version__}: {steps / (time.perf_counter() - began):.0f} steps/s")
