"""The notebook of examples that trains a tiny model runs from top to bottom."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.examples.test_notebooks import ROOT, executed


@pytest.mark.slow
@pytest.mark.training
@pytest.mark.timeout(900)
def test_the_notebook_of_training_runs(tmp_path: Path) -> None:
    executed(ROOT / "examples" / "train.ipynb", tmp_path)
