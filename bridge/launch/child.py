"""First thing a launched process runs: tie its life to the launcher's, then become the node.

    python -m bridge.launch.child LAUNCHER_PID MODULE ARGUMENT...

The kernel kills the process when the launcher is gone, however it went (Linux,
prctl(2), PR_SET_PDEATHSIG, which outlives execve). It is set here and not between fork and
exec by the launcher, where no Python code is safe once the wire has threads.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys

_PR_SET_PDEATHSIG = 1


def die_with(parent: int) -> None:
    """Have the kernel kill this process when its `parent` dies; exit at once if it is already gone."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, int(signal.SIGKILL), 0, 0, 0)
    if os.getppid() != parent:
        raise SystemExit(1)


if __name__ == "__main__":
    die_with(int(sys.argv[1]))
    os.execv(sys.executable, [sys.executable, "-P", "-m", *sys.argv[2:]])  # noqa: S606 (the launcher's own arguments)
