"""Configurations that ship with the package are found from any folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from agentflow.cli import main
from agentflow.config.run import load_document
from agentflow.config.shipped import find_config
from agentflow.errors import ConfigError
from tests.loops import for_each

CONFIGS = Path(__file__).parents[2] / "configs"


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@for_each(sorted(path.relative_to(CONFIGS.parent) for path in CONFIGS.rglob("*.yaml")))
def test_every_one_has_a_long_and_a_short_name(path: Path) -> None:
    own = CONFIGS.parent / path
    for name in (own, path, Path(*path.parts[1:]).with_suffix("")):
        assert find_config(name).samefile(own), name


def test_sweeps_and_benchmarks_start_in_any_folder(
    elsewhere: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sweep", "inspector", "--seeds", "1", "--dry-run"]) == 0
    assert "no_inspector.seed-0: " in capsys.readouterr().out
    assert main(["benchmark", "--lite", "--dry-run"]) == 0
    assert not any(elsewhere.iterdir())


def test_a_file_in_the_folder_comes_first(elsewhere: Path) -> None:
    (elsewhere / "inspector").write_text("title: own\n")
    assert load_document(Path("inspector")) == {"title": "own"}


def test_its_folder_is_no_configuration(elsewhere: Path) -> None:
    assert not (elsewhere / "configs").exists()
    for name in ("configs", "configs/..", "nowhere/.."):
        assert find_config(Path(name)) == Path(name)


@for_each(["inspecter", "configs", "/inspector", "other/inspector", "", "x" * 5000])
def test_other_names_are_not_found(name: str) -> None:
    with pytest.raises(ConfigError, match=r"cannot read|mapping"):
        load_document(Path(name))
