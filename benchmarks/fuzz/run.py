"""One decoder under fire."""

from __future__ import annotations

import gc
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

from benchmarks.fuzz.mutations import Mutator
from benchmarks.fuzz.reference import Malformed, parse, wrong
from bridge.codec import decode
from bridge.errors import InvalidMessage
from bridge.topics import TWIST, Topic

GROWTH_LIMIT_KB: Final = 2_048
KEPT: Final = 5  # examples of what should not be


@dataclass
class Finding:
    """What came of it."""

    key: str
    payloads: int = 0
    refused: int = 0
    accepted: int = 0
    crashes: list[str] = field(default_factory=list)
    accepted_invalid: dict[str, int] = field(default_factory=dict)  # by reason
    examples: list[str] = field(default_factory=list)
    microseconds: float = 0.0  # per payload, mutation and reference included
    growth_kb: int = 0  # of the resident set, from a tenth of the payloads to the end

    @property
    def failed(self) -> bool:
        return bool(self.crashes or self.accepted_invalid or self.growth_kb > GROWTH_LIMIT_KB)

    def as_json(self) -> dict[str, Any]:
        return asdict(self)

    def line(self) -> str:
        return (
            f"{'FAIL' if self.failed else 'ok  '} {self.key:16s} {self.payloads:9d} payloads, {self.refused} refused, "
            f"{self.accepted} accepted, {len(self.crashes)} crashes, {self.accepted_invalid or 'none'} accepted but "
            f"invalid, memory {self.growth_kb:+d} kB, {self.microseconds:.0f} us each"
            + "".join(f"\n     ! {text}" for text in (*self.crashes, *self.examples))
        )


def fuzz(topic: Topic, good: Sequence[bytes], count: int, seed: int) -> Finding:
    """Give the decoder of `topic` `count` mutations of the `good` payloads."""
    mutator, found = Mutator(good, seed), Finding(topic.key)
    began_s = time.perf_counter()
    before_kb = 0
    for number in range(count):
        if number == count // 10:
            before_kb = resident_kb()
        payload = mutator.next()
        found.payloads += 1
        try:
            decode(topic, payload, number).check()
        except InvalidMessage:
            found.refused += 1
        except Exception as error:  # noqa: BLE001 (whatever it is, it is what is looked for)
            _keep(found.crashes, f"{type(error).__name__}: {error} from {payload.hex()}")
        else:
            found.accepted += 1
            _judge(found, topic, payload)
    found.growth_kb = resident_kb() - before_kb
    found.microseconds = (time.perf_counter() - began_s) / max(count, 1) * 1e6
    return found


def _judge(found: Finding, topic: Topic, payload: bytes) -> None:
    """Hold an accepted message against the reference."""
    reason = "cmd_vel is not read" if topic is TWIST else ""
    if not reason:
        try:
            reason = wrong(topic.ros_type, parse(topic.ros_type, payload))
        except Malformed as error:
            reason = f"malformed: {error}"
    if reason:
        found.accepted_invalid[reason] = found.accepted_invalid.get(reason, 0) + 1
        if found.accepted_invalid[reason] == 1:
            _keep(found.examples, f"{reason}: {payload[:160].hex()}...")


def _keep(examples: list[str], text: str) -> None:
    if len(examples) < KEPT:
        examples.append(text)


def resident_kb() -> int:
    """Return the resident set of this process [kB]."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4
