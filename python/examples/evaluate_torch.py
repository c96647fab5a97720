"""A policy in PyTorch gets the tables of the command line, beside the expert and a planner.

pip install ./python torch
python python/examples/evaluate_torch.py dagger-lotpilot.pt
"""

import argparse

import torch
from dagger import Net

import lotpilot

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("weights", help="what dagger.py saved")
    parser.add_argument("--lots", nargs="+", default=["lot-b", "lot-c"], help="as on the command line")
    parser.add_argument("--trials", type=int, default=2, help="of each lot and direction")
    asked = parser.parse_args()

    net = Net()
    net.load_state_dict(torch.load(asked.weights, weights_only=True))
    drivers = {"mine": net, "expert": "expert", "tentacle": "tuned:tentacle"}
    tables = lotpilot.evaluate(drivers, asked.lots, trials=asked.trials, compare_with="mine")

    columns = ("driver", "lots", "per_100m", "garwood_lower", "garwood_upper", "contacts")
    print(*columns, sep="\t")
    for row in zip(*(tables.summary[column] for column in ("direction", *columns)), strict=True):
        if row[0] == "both":
            print(*(f"{value:.2f}" if isinstance(value, float) else value for value in row[1:]), sep="\t")
    # Any near-collision can be looked at again: its lot, direction and tick are in tables.failures.
