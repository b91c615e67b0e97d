"""What the number says with which a command ends. This is the one place that says so."""

from __future__ import annotations

from enum import IntEnum
from typing import Final


class ExitCode(IntEnum):
    """Exit codes of `surefoot` and of the processes it starts."""

    DONE = 0
    CHECK_FAILED = 1
    BAD_INPUT = 2
    FAULT = 70  # EX_SOFTWARE of sysexits.h
    INTERRUPTED = 130  # 128 + SIGINT, as shells report it
    READER_GONE = 141  # 128 + SIGPIPE


MEANINGS: Final = {
    ExitCode.DONE: "done",
    ExitCode.CHECK_FAILED: "what was looked at is not well: a process died, data are damaged, a key is unusable",
    ExitCode.BAD_INPUT: "bad input, or an environment that cannot serve; one line on stderr says what",
    ExitCode.FAULT: "a fault of Surefoot itself, with a traceback: please report it",
    ExitCode.INTERRUPTED: "interrupted with Ctrl-C",
    ExitCode.READER_GONE: "whoever read stdout has gone, such as head",
}
