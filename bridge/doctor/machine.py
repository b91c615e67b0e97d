"""Cores, permission to run in real time, and room on the disk."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from bridge.doctor.finding import Finding, Level, Patient

CORES: Final = "cores"
REALTIME: Final = "realtime"
DISK: Final = "disk"
ENOUGH_CORES: Final = 4  # one for each process of the usual system
FEW_MB, NO_MB = 1000, 50  # an hour of a recording with pictures; what logs alone need
_USUAL_PRIORITY: Final = 20
_TRY: Final = "import os, sys; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(int(sys.argv[1])))"
_LIMITS: Final = 'echo "$USER - rtprio {0}" | sudo tee /etc/security/limits.d/surefoot.conf   # then log in again'


def check_cores(patient: Patient) -> Iterator[Finding]:
    """Whether there are as many cores as processes."""
    yield judge_cores(len(os.sched_getaffinity(0)), len(patient.config.launch.roles))


def judge_cores(cores: int, processes: int) -> Finding:
    """Return the finding for `processes` on `cores` that they may use."""
    if cores >= min(processes, ENOUGH_CORES):
        return Finding(CORES, Level.GOOD, f"{cores} for {processes} processes")
    level = Level.WARNING if cores < 2 else Level.NOTE
    text = f"{cores} for {processes} processes: they will wait for each other when all have something to do"
    return Finding(CORES, level, text, "measure: surefoot latency; run some roles on another machine (--roles)")


def check_realtime(patient: Patient) -> Iterator[Finding]:
    """Whether the controller may run under SCHED_FIFO, as `controller.realtime_priority` asks."""
    priority = patient.config.controller.realtime_priority
    yield judge_realtime(priority, try_realtime(priority or _USUAL_PRIORITY))


def try_realtime(priority: int) -> str:
    """Try SCHED_FIFO at `priority` in a process of its own; return why it is refused, '' if it is not."""
    done = subprocess.run(  # noqa: S603 (ourselves)
        [sys.executable, "-c", _TRY, str(priority)], capture_output=True, text=True, timeout=20, check=False
    )
    if done.returncode == 0:
        return ""
    return done.stderr.strip().splitlines()[-1] if done.stderr.strip() else f"exit code {done.returncode}"


def judge_realtime(priority: int, refused: str) -> Finding:
    """Return the finding for a configured `priority` (0: none) and why SCHED_FIFO was `refused`, '' if not."""
    mend = _LIMITS.format(max(priority, _USUAL_PRIORITY))
    if not refused:
        said = f"SCHED_FIFO {priority} is permitted" if priority else "SCHED_FIFO is permitted, and not asked for"
        how = "" if priority else f"on a busy machine: --set controller.realtime_priority={_USUAL_PRIORITY}"
        return Finding(REALTIME, Level.GOOD, said, how)
    if priority:
        text = f"controller.realtime_priority = {priority} is not permitted: the loop runs as an ordinary process"
        return Finding(REALTIME, Level.WARNING, f"{text} ({refused})", mend)
    return Finding(REALTIME, Level.NOTE, "SCHED_FIFO is not permitted, and not asked for", mend)


def check_disk(patient: Patient) -> Iterator[Finding]:
    """Whether logs and recordings can be written."""
    yield judge_disk(Path(patient.config.launch.log_dir))


def judge_disk(folder: Path) -> Finding:
    """Return the finding for `folder`, which need not be there yet."""
    there = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    if not there.is_dir():
        return Finding(DISK, Level.BROKEN, f"{there}: is a file where a folder is needed", f"mv {there} {there}.old")
    try:
        with tempfile.TemporaryFile(dir=there):
            pass
    except OSError as error:
        return Finding(DISK, Level.BROKEN, f"{there}: cannot be written: {error.strerror}", f"sudo chown $USER {there}")
    return judge_room(there, shutil.disk_usage(there).free // 1_000_000)


def judge_room(folder: Path, free_mb: int) -> Finding:
    """Return the finding for a writable `folder` with `free_mb` left."""
    if free_mb >= FEW_MB:
        return Finding(DISK, Level.GOOD, f"{folder}: can be written, {free_mb / 1000:.0f} GB free")
    level = Level.BROKEN if free_mb < NO_MB else Level.WARNING
    text = f"{folder}: {free_mb} MB free, {FEW_MB} are wanted"
    return Finding(DISK, level, text, f"du -xh {folder} | sort -h | tail")
