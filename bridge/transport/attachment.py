"""What travels beside every payload: who sent it, when, and as which of theirs.

Layout of rmw_zenoh since ROS 2 Jazzy, little-endian, written by Zenoh's serializer as
`(int64, int64, uint8[16])`: sequence number, source timestamp [ns], length of the
identifier (16, as LEB128), identifier. Source: ros2/rmw_zenoh,
`rmw_zenoh_cpp/src/detail/attachment_helpers.cpp`.
"""

from __future__ import annotations

import struct
from typing import Final

IDENTIFIER_BYTES: Final = 16
_LAYOUT: Final = struct.Struct("<qqB16s")


def pack(sequence: int, stamp_ns: int, source: bytes) -> bytes:
    """Return the attachment of one sample; `source` is the publisher's identifier, 16 bytes."""
    return _LAYOUT.pack(sequence, stamp_ns, IDENTIFIER_BYTES, source)


def unpack(raw: bytes) -> tuple[int, bytes]:
    """Return sequence number and identifier; (-1, b'') if `raw` is not laid out like this."""
    if len(raw) != _LAYOUT.size:
        return -1, b""
    sequence, _stamp, length, source = _LAYOUT.unpack(raw)
    return (sequence, source) if length == IDENTIFIER_BYTES else (-1, b"")
