"""Owns MP4 files: AV1 frames as Pillow encodes them, in boxes that every player takes for a film.

An animated AVIF is an MP4 in all but its labels, so nothing but Pillow is needed. Boxes are those
of ISO/IEC 14496-12: a size and a name of four bytes each, then the content.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from struct import pack_into, unpack_from

from PIL import Image, features

from agentflow.errors import UsageError

QUALITY = 75
SPEED = 8
"""The slowest of libaom's speeds that costs far less than drawing."""
FOLDERS = (b"moov", b"trak", b"mdia")
DURATION = {b"mvhd": 32, b"tkhd": 36, b"mdhd": 32}
"""Where each header (of version 1) says how long the film lasts, from the start of its box."""
MADE, HANDLER, BRAND = 12, 16, 8
"""Where a header says when it was made, what a track is, and what a file is."""
UNUSED = (b"meta", b"edts")
"""The still that an AVIF shows first, and how often it repeats."""


def save_mp4(frames: Sequence[Image.Image], path: Path, interval: float) -> None:
    """Keep frames as an MP4 (AV1) of constant rate.

    Args:
        frames: Of one size; one alone is shown twice, because it would be no film.
        path: Where to.
        interval: Seconds that each is shown.

    Raises:
        UsageError: This Pillow cannot encode AV1.
    """
    if not features.check("avif"):
        raise UsageError("MP4 needs a Pillow that writes AVIF: pip install --upgrade pillow")
    buffer = BytesIO()
    frames[0].save(
        buffer,
        "AVIF",
        save_all=True,
        append_images=frames[1:] or frames,
        duration=round(1000 * interval),
        quality=QUALITY,
        speed=SPEED,
        max_threads=1,
        codec="aom",
        range="limited",
    )
    path.write_bytes(as_mp4(buffer.getvalue()))


def as_mp4(animation: bytes) -> bytes:
    """Relabel an animated AVIF: a film, shown once, made at no particular time."""
    film = bytearray(animation)
    boxes = dict(_boxes(film, 0, len(film)))
    pack_into("4s", film, BRAND, b"iso8")
    pack_into("4s", film, boxes[b"hdlr"] + HANDLER, b"vide")
    for name in UNUSED:
        pack_into("4s", film, boxes[name] + 4, b"free")
    length = unpack_from(">Q", film, boxes[b"mdhd"] + DURATION[b"mdhd"])
    for name, place in DURATION.items():
        pack_into(">QQ", film, boxes[name] + MADE, 0, 0)
        pack_into(">Q", film, boxes[name] + place, *length)
    return bytes(film)


def _boxes(film: bytearray, start: int, end: int) -> Iterator[tuple[bytes, int]]:
    """Name and place of every box that matters here; the one track has one of each."""
    while start < end:
        size, name = unpack_from(">I4s", film, start)
        yield name, start
        if name in FOLDERS:
            yield from _boxes(film, start + 8, start + size)
        start += size
