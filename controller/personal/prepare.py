"""Building the MPC of configurations before they are needed: `python -m controller.personal.prepare FILE...`

The rendered mass stands in the MPC's C code as a number, so a setting that nobody tried takes a few seconds of the
compiler. Done while the person still walks with the other one, it keeps nobody waiting.
"""

from __future__ import annotations

import sys
from pathlib import Path

from bridge.config.load import load_config
from bridge.errors import SurefootError
from controller.admittance_controller import AdmittanceController


def main(files: list[str]) -> int:
    """Build what each of `files` needs into the cache."""
    for file in files:
        try:
            config = load_config(Path(file))
            AdmittanceController(config.walker, config.admittance, config.mpc, 1.0 / config.controller.rate_hz)
        except SurefootError:
            continue  # whoever runs it will be told
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
