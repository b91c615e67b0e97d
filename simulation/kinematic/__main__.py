"""Write the demo's recording: `python -m simulation.kinematic --out FILE.npz --seed 0`."""

from __future__ import annotations

import argparse
from pathlib import Path

from simulation.kinematic.recording import DEMO, demo, save


def main() -> None:
    """Write the file that the command line names."""
    parser = argparse.ArgumentParser(prog="python -m simulation.kinematic", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("simulation/demo/walk-stumble-fall.npz"))
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    save({DEMO: demo(arguments.seed)}, arguments.out)


if __name__ == "__main__":
    main()
