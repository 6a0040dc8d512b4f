"""How motion is packed: read back as the page does, byte by byte."""

from __future__ import annotations

import base64
import zlib
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from agentflow.report.film import FilmMotion, pack_motion

STILL = (0.0, 0.0, 0.0, 1.0)


def unpacked(film: dict[str, Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Position (T, B, 3), rotation (T, B, 4), load (T, E), as film.js works them out."""
    content = np.frombuffer(zlib.decompress(base64.b64decode(film["data"])), dtype=np.uint8)
    samples, bodies = film["samples"], film["bodies"]
    count = 7 * bodies * samples
    changes = content[:count].astype(np.uint16) | content[count : 2 * count].astype(np.uint16) << 8
    rows = np.cumsum(changes.reshape(7, bodies, samples), axis=2, dtype=np.uint16)
    values = rows.view(np.int16).astype(np.float64).transpose(2, 1, 0)
    position = film["low"] + (values[..., :3] + 32768) * film["step"]
    loads = content[2 * count :].reshape(film["loads"], samples)
    load = np.cumsum(loads, axis=1, dtype=np.uint8).T / 200
    return position, values[..., 3:] / 32767, load


def test_places_turns_and_loads_come_back() -> None:
    chance = np.random.default_rng(0)
    position = chance.uniform((-5, 0, -3), (5, 20, 97), (40, 6, 3))
    turns = chance.normal(size=(40, 6, 4))
    turns /= np.linalg.norm(turns, axis=2, keepdims=True)
    load = chance.uniform(0, 1.2, (40, 9))
    film = pack_motion(FilmMotion(np.arange(40) * 0.1, position, turns, load))
    assert {key: film[key] for key in ("samples", "bodies", "loads")} == {
        "samples": 40,
        "bodies": 6,
        "loads": 9,
    }
    seen, turned, loaded = unpacked(film)
    assert np.abs(seen - position).max() < 100 / 65535
    assert np.abs(np.abs(np.sum(turned * turns, axis=2)) - 1).max() < 1e-4
    assert np.abs(loaded - load).max() <= 0.0025 + 1e-9


def test_what_has_broken_and_what_is_overloaded_fits_a_byte() -> None:
    load = np.array([[np.nan, 7.0]])
    place = np.zeros((1, 1, 3))
    _, _, loaded = unpacked(pack_motion(FilmMotion(np.zeros(1), place, np.array([[STILL]]), load)))
    assert loaded.tolist() == [[0.0, pytest.approx(1.275)]]


def test_what_never_moves_takes_next_to_nothing() -> None:
    position, turns = np.zeros((300, 60, 3)), np.tile(STILL, (300, 60, 1))
    assert (
        len(
            pack_motion(FilmMotion(np.arange(300) / 30, position, turns, np.zeros((300, 60))))[
                "data"
            ]
        )
        < 1000
    )
