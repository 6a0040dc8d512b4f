"""Packs motion for the page: 16-bit positions and rotations, deflated, as base64 text.

The page's film.js unpacks it.
"""

from __future__ import annotations

import base64
import json
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

STEPS = 65535
"""Steps of a coordinate between its minimum and maximum: 1.5 mm over 100 m."""
TURN = 32767
"""Integer for a quaternion component of 1."""
LOAD = 200
"""Steps of a load of 1, at which a connection breaks; loads are capped at 255 steps."""
PRECISION = 1e-4
"""Smallest extent of a coordinate, m, to avoid division by zero."""


@dataclass(frozen=True)
class FilmMotion:
    """Poses of bodies over time, game frame: T samples, B bodies, E connections."""

    times: NDArray[np.float64]
    """(T,) s, increasing from 0; spaced unevenly around events."""
    position: NDArray[np.float64]
    """(T, B, 3) m."""
    rotation: NDArray[np.float64]
    """(T, B, 4) unit quaternions x, y, z, w; neighbours in time have the same signs."""
    load: NDArray[np.float64]
    """(T, E) load divided by strength; NaN after a break."""


def pack_motion(motion: FilmMotion) -> dict[str, Any]:
    """Pack a motion for the page.

    Positions are accurate to about 1/65,000 of their extent, rotations to 0.005 degrees, loads to
    0.005.
    """
    samples, bodies, _ = motion.position.shape
    low = motion.position.min(axis=(0, 1))
    extent = np.maximum(np.ptp(motion.position, axis=(0, 1)), PRECISION)
    places = np.round((motion.position - low) * (STEPS / extent)) - STEPS // 2 - 1
    turns = np.round(motion.rotation * TURN)
    rows = np.concatenate([places, turns], axis=2).transpose(2, 1, 0).reshape(-1, samples)
    changes = np.diff(rows.astype(np.int64), axis=1, prepend=0).astype(np.uint16).ravel()
    loads = np.round(np.nan_to_num(motion.load).clip(0.0, 255 / LOAD) * LOAD).astype(np.int64).T
    content = (
        (changes & 255).astype(np.uint8).tobytes()
        + (changes >> 8).astype(np.uint8).tobytes()
        + np.diff(loads, axis=1, prepend=0).astype(np.uint8).tobytes()
    )
    return {
        "samples": samples,
        "times": [round(float(time), 4) for time in motion.times],
        "bodies": bodies,
        "low": [round(float(value), 6) for value in low],
        "step": [float(value) / STEPS for value in extent],
        "loads": motion.load.shape[1],
        "data": deflate(content),
    }


def deflate(content: bytes) -> str:
    """Deflate bytes to base64 text."""
    return base64.b64encode(zlib.compress(content, 9)).decode()


def deflate_json(value: object) -> str:
    """Deflate JSON data to base64 text."""
    return deflate(json.dumps(value).encode())
