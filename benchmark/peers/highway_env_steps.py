"""Control steps per second of HighwayEnv, one process, no rendering."""

import time
import warnings

warnings.filterwarnings("ignore")
import gymnasium
import highway_env  # noqa: F401  (registers the environments)

GRID = {
    "observation": {
        "type": "OccupancyGrid", "features": ["presence"], "grid_size": [[-6, 6], [-6, 6]], "grid_step": [0.48, 0.48],
        "as_image": False, "align_to_vehicle_axes": True,
    }
}
for name, config in [("racetrack-v1", GRID), ("parking-v0", {})]:
    env = gymnasium.make(name, config=config)
    env.reset(seed=1)
    steps, began = 0, time.perf_counter()
    while time.perf_counter() - began < 10:
        _, _, done, cut, _ = env.step(0 * env.action_space.sample())
        steps += 1
        if done or cut:
            env.reset()
    print(f"{name}: {steps / (time.perf_counter() - began):.0f} steps/s")
