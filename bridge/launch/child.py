"""First thing a launched process runs: tie its life to the launcher's, then become the node.

    python -m bridge.launch.child LAUNCHER_PID MODULE|FILE.py ARGUMENT...

The kernel kills the process when the launcher is gone, however it went (Linux,
prctl(2), PR_SET_PDEATHSIG, which outlives execve). It is set here and not between fork and
exec by the launcher, where no Python code is safe once the wire has threads.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys

from bridge.errors import ConfigError
from bridge.plugin import is_file, require_place

_PR_SET_PDEATHSIG = 1


def die_with(parent: int) -> None:
    """Have the kernel kill this process when its `parent` dies; exit at once if it is already gone."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, int(signal.SIGKILL), 0, 0, 0)
    if os.getppid() != parent:
        raise SystemExit(1)


if __name__ == "__main__":
    die_with(int(sys.argv[1]))
    try:
        require_place(sys.argv[2])
    except ConfigError as error:
        print(f"surefoot launch.modules: {error}", file=sys.stderr)  # noqa: T201 (the one line a user reads)
        raise SystemExit(error.exit_code) from error
    how = [] if is_file(sys.argv[2]) else ["-P", "-m"]  # a file finds its neighbours, as when it is run by hand
    os.execv(sys.executable, [sys.executable, *how, *sys.argv[2:]])  # noqa: S606 (the launcher's own arguments)
