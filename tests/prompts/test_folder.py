"""Prompt sets that are folders, and the templates that roles bring."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

import pytest

from agentflow.agents.base import Parsed, Prompt, chat_prompt
from agentflow.agents.designer import Designer
from agentflow.agents.registry import ROLES
from agentflow.app.design.plan import RunPlan
from agentflow.cli import main
from agentflow.config.run import DesignConfig
from agentflow.env.tasks.registry import get_task
from agentflow.errors import ConfigError, PromptError
from agentflow.prompts.folder import read_folder
from agentflow.prompts.render import PromptSet
from agentflow.runs import read_document


@pytest.fixture
def careful(tmp_path: Path) -> Path:
    """A folder with one template, which takes all others from `compact`."""
    folder = tmp_path / "careful"
    (folder / "designer").mkdir(parents=True)
    (folder / "set.yaml").write_text("about: Careful.\nbase: compact\n")
    system = PromptSet("compact").files["designer/system.j2"] + "\nCheck twice.\n"
    (folder / "designer" / "system.j2").write_text(system)
    return folder


def test_a_folder_is_a_set(careful: Path) -> None:
    found, base = PromptSet(str(careful)), PromptSet("compact")
    assert found.about == "Careful."
    changed = [path for path in base.files if found.files[path] != base.files[path]]
    assert changed == ["designer/system.j2"]
    assert found.digest != base.digest
    prompt = chat_prompt(Designer, get_task("movement").brief, str(careful))
    assert prompt[0]["content"].endswith("\nCheck twice.\n")
    (careful / "set.yaml").unlink()
    assert read_folder(str(careful)).base == "default"


def test_folders_that_cannot_be_used(careful: Path) -> None:
    with pytest.raises(ConfigError, match=r"^the prompt set \./nowhere does not exist$"):
        PromptSet("./nowhere")
    (careful / "empty").mkdir()
    with pytest.raises(ConfigError, match=r"empty has no templates, such as designer/user\.j2$"):
        PromptSet(f"{careful}/empty")
    (careful / "set.yaml").write_text("fit: 3")
    with pytest.raises(ConfigError, match=r"set.yaml: unknown key 'fit'; known: fits, "):
        PromptSet(str(careful))
    (careful / "set.yaml").write_text(f"base: {careful}")
    with pytest.raises(ConfigError, match=r"set.yaml: base: must be the name of a prompt set, not"):
        PromptSet(str(careful))
    (careful / "set.yaml").unlink()
    (careful / "designer" / "user.j2").write_bytes(b"\xff")
    with pytest.raises(ConfigError, match=r"the template .*user.j2 cannot be read: 'utf-8' codec"):
        PromptSet(str(careful))


def test_templates_of_a_folder_run_no_code(careful: Path) -> None:
    for hostile in ("{{ task.__class__.__mro__ }}", "{{ ''.__class__ }}", "{{ types.clear() }}"):
        (careful / "designer" / "system.j2").write_text(hostile)
        with pytest.raises(PromptError, match=r"designer/system\.j2, line 1: "):
            chat_prompt(Designer, get_task("movement").brief, str(careful))


@pytest.mark.parametrize(
    ("path", "text", "fault"),
    [
        ("designr/system.j2", "x", ": nothing uses designr/system.j2; did you mean designer/"),
        ("designer/sytem.j2", "x", ": nothing uses designer/sytem.j2; did you mean designer/sys"),
        ("querier/user.j2", "\n{% if %}", ", querier/user.j2, line 2: Expected an expression"),
    ],
)
def test_templates_that_no_prompt_shows_are_named(
    careful: Path, path: str, text: str, fault: str
) -> None:
    PromptSet(str(careful)).require_use(ROLES)
    (careful / path).parent.mkdir(exist_ok=True)
    (careful / path).write_text(text)
    with pytest.raises(PromptError) as caught:
        RunPlan.of(DesignConfig(task="movement", prompts=str(careful)))
    assert str(caught.value).startswith(f"prompt set {str(careful)!r}{fault}")


def test_a_template_may_include_another(careful: Path) -> None:
    (careful / "designer" / "user.j2").write_text("{% include 'mine/care.j2' %}")
    with pytest.raises(PromptError, match=r"designer/user.j2, line 1: .* no template mine/care.j2"):
        chat_prompt(Designer, get_task("movement").brief, str(careful))
    (careful / "mine").mkdir()
    (careful / "mine" / "care.j2").write_text("Take care.")
    PromptSet(str(careful)).require_use(ROLES)


@pytest.mark.slow
def test_a_run_keeps_the_templates_of_its_folder(
    careful: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    small = ("prompts=./careful", "trajectories=1", "search.rounds=0", "verify=false")
    words = [word for item in small for word in ("--set", item)]
    design = ["design", "--task", "movement", "--workflow", "single", "--quiet"]
    assert main([*design, *words, "--name", "x"]) == 0
    run = tmp_path / "runs" / "x"
    assert list(read_document(run)["prompt_folder"]["files"]) == ["designer/system.j2"]
    assert "Check twice." in (run / "calls.jsonl").read_text()
    shutil.rmtree(careful)
    capsys.readouterr()
    assert main(["replay", str(run)]) == 0
    assert capsys.readouterr().out == "identical\n"
    (run / "result.json").unlink()
    assert main(["design", "--resume", str(run), "--quiet"]) == 0


class Namer(Prompt[str, str]):
    """A prompt with templates of its own."""

    name: ClassVar[str] = "namer"

    def variables(self, given: str) -> Mapping[str, object]:
        return {"machine": given}

    def parse(self, text: str, given: str) -> Parsed[str]:  # noqa: ARG002
        return Parsed(text)


def test_a_role_brings_templates_which_a_set_may_replace(tmp_path: Path) -> None:
    with pytest.raises(PromptError, match="'default' has no templates for the role 'namer': add"):
        Namer().prompt("car", PromptSet())

    class Own(Namer):
        templates: ClassVar[Path | None] = tmp_path / "own"

    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "system.j2").write_text("You name machines.")
    (tmp_path / "own" / "user.j2").write_text("Name {{ machine }}.")
    assert Own().prompt("car", PromptSet()) == ("You name machines.\n", "Name car.\n")
    (tmp_path / "set" / "namer").mkdir(parents=True)
    (tmp_path / "set" / "namer" / "user.j2").write_text("Name it.")
    replaced = PromptSet(str(tmp_path / "set"))
    assert Own().prompt("car", replaced) == ("You name machines.\n", "Name it.\n")
