"""Payloads that are almost right."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from random import Random
from typing import Final

_DOUBLES: Final = tuple(
    struct.pack("<d", value)
    for value in (float("nan"), float("inf"), float("-inf"), -0.0, 5e-324, 1e308, -1e308, 1e6, -1e-3, 1.5, 2.0**53)
)
_LENGTHS: Final = (0, 1, 2, 3, 255, 256, 65_535, 65_536, 2**31 - 1, 2**31, 2**32 - 5, 2**32 - 1)


class Mutator:
    """Makes one broken payload after another from good ones; the same seed gives the same payloads."""

    def __init__(self, good: Sequence[bytes], seed: int) -> None:
        self._good, self._random = good, Random(seed)
        self._ways: Sequence[Callable[[bytearray], None]] = (
            self._flip, self._flip, self._set, self._double, self._double, self._double, self._length, self._length,
            self._cut, self._grow, self._splice, self._swap, self._head, self._stamp,
        )  # fmt: skip

    def next(self) -> bytes:
        """Return the next payload."""
        random = self._random
        if random.random() < 0.02:
            return random.randbytes(int(random.expovariate(1 / 200.0)))
        payload = bytearray(self._good[int(random.random() * len(self._good))])
        while True:
            self._ways[int(random.random() * len(self._ways))](payload)
            if random.random() < 0.6:
                return bytes(payload)

    def _index(self, payload: bytearray) -> int:
        return int(self._random.random() * len(payload))

    def _flip(self, payload: bytearray) -> None:
        if payload:
            payload[self._index(payload)] ^= 1 << int(self._random.random() * 8)

    def _set(self, payload: bytearray) -> None:
        if payload:
            payload[self._index(payload)] = int(self._random.random() * 256)

    def _double(self, payload: bytearray) -> None:
        """A number that is none, or too large, where a float64 may lie: at a multiple of eight behind the head."""
        if len(payload) >= 12:
            at = 4 + (self._index(payload) - 4) // 8 * 8
            at = min(max(at, 4), len(payload) - 8)
            payload[at : at + 8] = _DOUBLES[int(self._random.random() * len(_DOUBLES))]

    def _length(self, payload: bytearray) -> None:
        """A length that is not, where the length of a string or a list may stand."""
        if len(payload) >= 8:
            at = min(4 + self._index(payload) // 4 * 4, len(payload) - 4)
            struct.pack_into("<I", payload, at, _LENGTHS[int(self._random.random() * len(_LENGTHS))])

    def _cut(self, payload: bytearray) -> None:
        if payload:
            del payload[self._index(payload) :]

    def _grow(self, payload: bytearray) -> None:
        at = self._index(payload) if payload else 0
        payload[at:at] = self._random.randbytes(1 + int(self._random.random() * 12))

    def _splice(self, payload: bytearray) -> None:
        other = self._good[int(self._random.random() * len(self._good))]
        at = self._index(payload) if payload else 0
        payload[at:] = other[int(self._random.random() * len(other)) :]

    def _swap(self, payload: bytearray) -> None:
        if len(payload) >= 24:
            a, b = (min(4 + self._index(payload) // 8 * 8, len(payload) - 8) for _ in range(2))
            payload[a : a + 8], payload[b : b + 8] = payload[b : b + 8], payload[a : a + 8]

    def _head(self, payload: bytearray) -> None:
        """Another encapsulation: big-endian, parameter lists, nonsense."""
        if len(payload) >= 2:
            payload[int(self._random.random() * 2)] = int(self._random.random() * 4)

    def _stamp(self, payload: bytearray) -> None:
        if len(payload) >= 12:
            nanosec = int(self._random.random() * 2**32)
            struct.pack_into("<I", payload, 8, nanosec)
