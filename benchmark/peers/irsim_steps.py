"""Control steps per second of IR-SIM: one Ackermann car, a lane of parked cars, a laser scan, no display."""

import contextlib
import os
import sys
import tempfile
import time

os.environ["MPLBACKEND"] = "Agg"
with contextlib.redirect_stdout(sys.stderr):  # it lists the windows that it cannot open
    import irsim

WORLD = """
world: {height: 60, width: 60, step_time: 0.05, sample_time: 0.05, offset: [0, -30], collision_mode: 'unobstructed'}
robot:
  - kinematics: {name: 'acker'}
    shape: {name: 'rectangle', length: 4.6, width: 1.8, wheelbase: 2.8}
    state: [2, 0, 0, 0]
    goal: [50, 0, 0]
    behavior: {name: 'dash'}
    vel_max: [1.5, 0.5]
    sensors:
      - {type: 'lidar2d', range_min: 0, range_max: 16, angle_range: 3.14, number: 180, noise: false}
obstacle:
"""
for i in range(20):
    for y in (4.2, -4.2):
        WORLD += f"  - {{shape: {{name: 'rectangle', length: 2.0, width: 4.6}}, state: [{2.4 * i}, {y}, 0]}}\n"
with tempfile.NamedTemporaryFile("w", suffix=".yaml", delete=False) as file:
    file.write(WORLD)
with contextlib.redirect_stdout(sys.stderr):  # and the packages that it does without
    env = irsim.make(file.name, display=False, log_level="ERROR")
steps, began = 0, time.perf_counter()
while time.perf_counter() - began < 10:
    env.step()
    steps += 1
    if env.done():
        env.reset()
print(f"irsim: {steps / (time.perf_counter() - began):.0f} steps/s")
os.unlink(file.name)
