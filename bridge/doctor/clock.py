"""Whether this machine's clock is held by another: what the kernel itself says (adjtimex(2)), whoever does it."""

from __future__ import annotations

import ctypes
import shutil
import struct
import sys
from collections.abc import Iterator
from typing import Final, NamedTuple

from bridge.config.bridge import BridgeConfig, is_loopback
from bridge.doctor.finding import Finding, Level, Patient

CLOCK: Final = "clock"
FUTURE_MS: Final = 50.0  # a stamp farther ahead is refused
_UNSYNCHRONISED: Final = 0x0040  # STA_UNSYNC
_TIMEX: Final = struct.Struct("@I4xllll i")  # the beginning of struct timex on 64-bit Linux


class Held(NamedTuple):
    """What the kernel says of its clock."""

    synchronised: bool
    error_ms: float  # it is at most this far off, as its keeper believes


def check_clock(patient: Patient) -> Iterator[Finding]:
    """Whether the clock is synchronised, which several machines need and one does not."""
    yield judge_clock(kernel_clock(), several=several_machines(patient.config.bridge))


def several_machines(config: BridgeConfig) -> bool:
    """Return whether a configuration is one of several machines."""
    places = (*config.endpoints.values(), *config.connect, *config.router.listen, *config.router.connect)
    return not all(map(is_loopback, places))


def kernel_clock() -> Held | None:
    """Return what the kernel says; None where it cannot be asked."""
    if sys.platform != "linux" or struct.calcsize("P") != 8:
        return None
    room = ctypes.create_string_buffer(512)  # struct timex, all zeros: read only
    if ctypes.CDLL(None, use_errno=True).adjtimex(room) < 0:
        return None
    _modes, _offset, _frequency, error_us, _estimated_us, status = _TIMEX.unpack_from(room)
    return Held(not status & _UNSYNCHRONISED, error_us / 1000.0)


def judge_clock(held: Held | None, *, several: bool) -> Finding:
    """Return the finding for what the kernel says, None: nothing, and one machine or several."""
    if held is None:
        level = Level.WARNING if several else Level.NOTE
        return Finding(CLOCK, level, "the system does not say whether its clock is synchronised", "timedatectl")
    if held.synchronised and held.error_ms <= FUTURE_MS:
        return Finding(CLOCK, Level.GOOD, f"synchronised, at most {held.error_ms:.1f} ms off")
    what = "is not synchronised"
    if held.synchronised:
        what = f"is synchronised, but may be {held.error_ms:.0f} ms off; limit {FUTURE_MS:.0f}"
    if not several:
        return Finding(CLOCK, Level.NOTE, f"{what}, which one machine alone does not need", mend_clock())
    text = f"{what}: messages between machines will look too old or too new"
    return Finding(CLOCK, Level.WARNING, text, mend_clock())


def mend_clock() -> str:
    """Return the command that has the clock synchronised."""
    if shutil.which("chronyc"):
        return "sudo systemctl enable --now chrony && chronyc tracking"
    return "sudo timedatectl set-ntp true, or: sudo apt install chrony"
