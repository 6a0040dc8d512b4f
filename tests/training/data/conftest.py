"""Design objectives that simulate quickly."""

from __future__ import annotations

from pathlib import Path

import pytest

OBJECTIVES = """
- name: small-cart
  text: A handcart of planks and wheels drives away from where it stood.
  kind: function
  blocks: [0, 1, 2]
  scene: {level: movement, knobs: {window: 1}}
  test: {moves: {metres: 1}}
- name: log-wagon
  text: A wagon of logs drives off without losing its balance.
  kind: constraint
  blocks: [0, 2, 15, 63]
  scene: {level: movement, knobs: {window: 1}}
  test: {moves: {metres: 1}, stays upright: {degrees: 30}}
- name: statue
  text: A statue of cubes stands about and is looked at by visitors.
  kind: function
  blocks: [0, 15]
  scene: {level: movement, knobs: {window: 1}}
  test: {moves: {metres: 1}}
"""


@pytest.fixture
def objectives(tmp_path: Path) -> Path:
    """The file of three objectives; no machine can meet the last one."""
    path = tmp_path / "objectives.yaml"
    path.write_text(OBJECTIVES, encoding="utf-8")
    return path
