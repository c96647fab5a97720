"""lotpilot: a closed-loop simulator of parking lots with a learning harness.

================================  ==============================================================
``Lot``, ``lots``, ``generate``   lots to look at, and to write down
``Episode``                       one run, step by step, for notebooks
``evaluate``, ``drivers``         drivers, also functions in Python, on the same trials: tables
``settings``                      what all of it is done with, as the command line prints it
``Dataset``, ``load_round``       what a training collected, as arrays
``EnvOptions``, ``Reward``        what the environments are made of
``lotpilot.gym``                  ``gymnasium.make("lotpilot/Lot-v0")`` and a native ``VectorEnv``
``lotpilot.sb3``                  a ``VecEnv`` for Stable-Baselines3 and imitation
``lotpilot.puffer``               a ``PufferEnv`` for PufferLib
``lotpilot.exports``              what a training collected, for imitation and LeRobot
``lotpilot.ray``                  evaluations, reproductions and lots on a Ray cluster
``python -m lotpilot.bench``      how fast it is on this machine
================================  ==============================================================

Lots, drivers, noise, settings and seeds have the names of the command line, and the same seed gives the same bytes.
Lengths are metres, angles radians, times seconds; in the frame of the car, ahead and left count from the rear axle.
"""

import gymnasium

from ._native import EpisodeEnded, Lot, drivers, lots
from .core import EnvOptions, Reward
from .data import Dataset, load_round
from .episode import Episode
from .tables import Evaluation, evaluate, generate, settings

__all__ = [
    "Dataset",
    "EnvOptions",
    "Episode",
    "EpisodeEnded",
    "Evaluation",
    "Lot",
    "Reward",
    "drivers",
    "evaluate",
    "generate",
    "load_round",
    "lots",
    "settings",
]

gymnasium.register(
    id="lotpilot/Lot-v0",
    entry_point="lotpilot.gym:LotEnv",
    vector_entry_point="lotpilot.gym:LotVectorEnv",
)
