"""Reads the boxes of an MP4 (ISO/IEC 14496-12), on its own account."""

from __future__ import annotations

FOLDERS = ("moov", "trak", "mdia", "minf", "stbl")


def boxes_of(film: bytes) -> dict[str, bytes]:
    """Content of every box by name; of equal names the last."""
    found: dict[str, bytes] = {}
    while film:
        size, name = int.from_bytes(film[:4], "big"), film[4:8].decode()
        assert 8 <= size <= len(film)
        found[name] = film[8:size]
        if name in FOLDERS:
            found |= boxes_of(found[name])
        film = film[size:]
    return found
