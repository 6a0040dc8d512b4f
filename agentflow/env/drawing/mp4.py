"""MP4 files with AV1 frames, encoded by Pillow.

An animated AVIF differs from an MP4 only in its labels, so relabelling Pillow's output is enough.
Boxes follow ISO/IEC 14496-12: size and name of four bytes each, then the content.
"""

from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from struct import pack_into, unpack_from

from PIL import Image, features

from agentflow.errors import UsageError

QUALITY = 75
SPEED = 8
"""libaom speed: the slowest that takes far less time than drawing."""
FOLDERS = (b"moov", b"trak", b"mdia")
DURATION = {b"mvhd": 32, b"tkhd": 36, b"mdhd": 32}
"""Offset of the duration in each header box (version 1)."""
CREATED, HANDLER, BRAND = 12, 16, 8
"""Offsets of the creation time, the track's handler type and the file's brand in their boxes."""
TICKING, TICKS = (b"mvhd", b"mdhd"), 28
"""Header boxes that tell how many ticks a second has, and the offset of that number."""
UNUSED = (b"meta", b"edts")
"""Boxes to drop: the AVIF's still image and its repetition count."""


def save_mp4(frames: Sequence[Image.Image], path: Path, interval: float) -> None:
    """Write frames to an MP4 (AV1) with a constant frame rate.

    Args:
        frames: Frames of one size; a single frame is shown twice, because a film needs two.
        path: File to write.
        interval: Duration of each frame, s.

    Raises:
        UsageError: The installed Pillow cannot encode AV1.
    """
    if not features.check("avif"):
        raise UsageError("MP4 needs a Pillow with AVIF support: pip install --upgrade pillow")
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
    path.write_bytes(as_mp4(buffer.getvalue(), round(round(1000 * interval) / interval)))


def as_mp4(animation: bytes, ticks: int) -> bytes:
    """Relabel an animated AVIF as a film that plays once, without a creation time; its milliseconds
    count as ticks, so many in a second, because 60 frames a second are no whole milliseconds."""
    film = bytearray(animation)
    boxes = dict(_boxes(film, 0, len(film)))
    pack_into("4s", film, BRAND, b"iso8")
    pack_into("4s", film, boxes[b"hdlr"] + HANDLER, b"vide")
    for name in UNUSED:
        pack_into("4s", film, boxes[name] + 4, b"free")
    length = unpack_from(">Q", film, boxes[b"mdhd"] + DURATION[b"mdhd"])
    for name, place in DURATION.items():
        pack_into(">QQ", film, boxes[name] + CREATED, 0, 0)
        pack_into(">Q", film, boxes[name] + place, *length)
    for name in TICKING:
        pack_into(">I", film, boxes[name] + TICKS, ticks)
    return bytes(film)


def _boxes(film: bytearray, start: int, end: int) -> Iterator[tuple[bytes, int]]:
    """Name and offset of every relevant box; there is one track, so names are unique."""
    while start < end:
        size, name = unpack_from(">I4s", film, start)
        yield name, start
        if name in FOLDERS:
            yield from _boxes(film, start + 8, start + size)
        start += size
