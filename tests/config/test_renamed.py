"""Earlier names of configuration keys and values are read, with a note, and never from a run."""

from __future__ import annotations

import warnings
from pathlib import Path

import pytest

from agentflow.cli import main
from agentflow.config.renamed import KEYS, VALUES, RenamedWarning, update_names
from agentflow.config.run import DesignConfig, build_config, load_document, set_key

EARLIER = {
    "keep_rollouts": "winners",
    "settings": {
        "rollouts": 7,
        "looks": 3,
        "meta_designer": "modules",
        "search": {"waves": 2, "rounds": 1},
    },
}
NOW = {
    "keep_rollouts": "best",
    "settings": {
        "max_simulations": 7,
        "max_pictures": 3,
        "meta_designer": "structures",
        "search": {"request_rounds": 2, "rounds": 1},
    },
}


def test_a_configuration_with_earlier_names_is_the_one_with_those_of_today() -> None:
    assert update_names(EARLIER) == NOW
    assert update_names(NOW) == NOW
    assert build_config(EARLIER) == build_config(NOW)
    assert EARLIER["keep_rollouts"] == "winners"  # what was given is unchanged


def test_where_both_names_are_given_that_of_today_counts() -> None:
    both = {"settings": {"rollouts": 1, "max_simulations": 2}}
    assert build_config(both).settings.max_simulations == 2


def test_every_name_of_today_exists() -> None:
    document = DesignConfig().model_dump()
    for now in (*KEYS.values(), *(path for path, _ in VALUES)):
        value = document
        for name in now.split("."):
            assert name in value, now
            value = value[name]


def test_a_file_that_a_person_wrote_is_read_with_a_note_and_a_run_without(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("settings: {rollouts: 3}\n")
    note = "settings.rollouts is now settings.max_simulations; the next version will refuse"
    with pytest.warns(RenamedWarning, match=f"^{note} the earlier name$"):
        document = load_document(file)
    assert build_config(document).settings.max_simulations == 3
    file.write_text("schema: 1\nconfig: {settings: {rollouts: 3}}\n")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert build_config(load_document(file)).settings.max_simulations == 3


@pytest.mark.parametrize("path", ["rollouts", "settings.rollouts"])
def test_a_setting_under_its_earlier_name(path: str) -> None:
    with pytest.warns(RenamedWarning):
        document = set_key({}, path, 5)
    assert build_config(document).settings.max_simulations == 5


def test_a_sweep_with_earlier_names_in_base_and_axes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "sweep.yaml"
    file.write_text(
        "title: Two budgets\n"
        "base: {workflow: random-dsl, keep_rollouts: winners}\n"
        "axes: {budget: {few: {rollouts: 2}, more: {rollouts: 4}}}\n"
        "table: {metrics: [max]}\n"
    )
    assert main(["sweep", str(file), "--dry-run"]) == 0
    assert capsys.readouterr().err.splitlines() == [
        "agentflow: note: keep_rollouts: winners is now keep_rollouts: best; "
        "the next version will refuse the earlier name",
        "agentflow: note: settings.rollouts is now settings.max_simulations; "
        "the next version will refuse the earlier name",
    ]
