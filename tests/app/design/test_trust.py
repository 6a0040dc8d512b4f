"""A file that names a host or a key variable which the user did not name sends nothing there."""

from __future__ import annotations

import os
import pty
import sys
from contextlib import suppress
from pathlib import Path

import pytest
import yaml

import agentflow
from agentflow.app.design.plan import RunPlan
from agentflow.app.design.trust import refuse, require_trust
from agentflow.cli import main
from agentflow.config.run import DesignConfig, ModelConfig, build_config
from agentflow.errors import ConfigError, RefusedError
from agentflow.runs import RunDirectory
from tests.app.test_doctor import threaded
from tests.llm.hostile import body

SECRET = "very-secret-2b1f"
TINY = {"task": "movement", "workflow": "single", "settings": {"trajectories": 1}}


def received_run(folder: Path, model: dict[str, object]) -> Path:
    """An unfinished run, as somebody else could send it."""
    plan = RunPlan.of(build_config({**TINY, "model": {"name": "m", **model}}))
    run = RunDirectory.create(folder, "received", plan.run_document)
    run.close()
    return run.path


def test_a_received_run_or_file_sends_no_variable_of_the_user_anywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CLOUD_PASSWORD", SECRET)
    with threaded(body({"error": {"message": "thanks"}}, 400)) as server:
        host = server.base_url.removesuffix("/v1")
        model = {"base_url": server.base_url, "key_variable": "CLOUD_PASSWORD"}
        run = received_run(tmp_path, model)
        file = tmp_path / "received.yaml"
        file.write_text(yaml.safe_dump({**TINY, "model": {"name": "m", **model}}))
        sweep = tmp_path / "sweep.yaml"
        base = {**TINY, "model": {"name": "m", **model}}
        sweep.write_text(
            yaml.safe_dump({"title": "t", "base": base, "table": {"metrics": ["max"]}})
        )
        for given in (
            ["design", "--resume", str(run)],
            ["design", "--config", str(file), "--out", str(tmp_path / "out")],
            ["design", "--config", str(run / "run.yaml"), "--out", str(tmp_path / "out")],
            ["doctor", "--config", str(file)],
            ["sweep", str(sweep), "--out", str(tmp_path / "out")],
        ):
            assert main(given) == 2, given
            assert (
                f"{given[1] if given[0] == 'sweep' else given[2]} sends prompts to {host} with the "
                "key in CLOUD_PASSWORD, which you have not named on the command line or in the "
                "environment; check it, then allow it with --trust (in Python: trust=True)\n"
            ) in capsys.readouterr().err, given
        with pytest.raises(ConfigError, match="allow it with --trust"):
            agentflow.resume(run)
        with pytest.raises(ConfigError, match="allow it with --trust"):
            agentflow.design(config=file, out=tmp_path / "out")
        assert server.asked == []
        assert not (tmp_path / "out").exists()
        with pytest.raises(RefusedError, match=r"--resume .*received --trust$"):
            agentflow.resume(run, trust=True)
        assert len(server.asked) == 1


OWN = {"OPENAI_BASE_URL": "https://own.example/v1"}
ELSEWHERE = {"roles": {"refiner": {"name": "n", "base_url": "http://b"}}}


@pytest.mark.parametrize(
    ("model", "named", "environment", "refused"),
    [
        ({}, {}, {}, ""),
        ({}, {}, OWN, "https://api.openai.com with the"),
        ({"base_url": "https://own.example"}, {}, OWN, ""),
        ({"base_url": "http://own.example"}, {}, OWN, "http://own.example with the key in OPENAI"),
        ({"base_url": "http://a/v1"}, {"base_url": "http://a:80/"}, {}, ""),
        ({"base_url": "http://a:81/v1"}, {"base_url": "http://a"}, {}, "http://a:81 with the key"),
        ({"key_variable": "HOME"}, {}, {}, "https://api.openai.com with the key in HOME"),
        ({"key_variable": "MINE"}, {"key_variable": "MINE"}, {}, ""),
        (ELSEWHERE, {}, {}, "http://b with no key"),
        (ELSEWHERE, {"roles": {"refiner": {"base_url": "http://b"}}}, {}, ""),
    ],
)
def test_what_the_user_names_is_allowed(
    model: dict[str, object],
    named: dict[str, object],
    environment: dict[str, str],
    refused: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("OPENAI_BASE_URL", raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    asked: list[str] = []

    def approve(sentence: str) -> bool:
        asked.append(sentence)
        return True

    config = DesignConfig(model=ModelConfig.model_validate({"name": "m", **model}))
    require_trust(Path("file"), [config], {"model": named}, approve)
    assert len(asked) == bool(refused)
    assert all(sentence.startswith(f"file sends prompts to {refused}") for sentence in asked)


@pytest.mark.parametrize(
    ("external", "named", "refused"),
    [
        ({"limit_s": 5}, {}, ""),
        ({"command": "rm -r x"}, {}, "the program 'rm -r x'"),
        ({"command": ["rm", "a b"]}, {}, "the program \"rm 'a b'\""),
        ({"command": "a", "variables": ["K", "L"]}, {}, "the program 'a' with the variables K, L"),
        ({"command": "a"}, {"command": "a"}, ""),
        ({"command": "a", "limit_s": 5}, {"command": "a"}, ""),
        (
            {"command": "a", "variables": ["K"]},
            {"command": "a"},
            "the program 'a' with the variables K",
        ),
        ({"command": "a", "shell": True}, {"command": "a"}, "the program 'a'"),
        ({"command": "a", "shell": True}, {"command": "a", "shell": True}, ""),
    ],
)
def test_a_program_that_only_a_file_names_is_refused(
    external: dict[str, object], named: dict[str, object], refused: str
) -> None:
    config = build_config({"settings": {"external": external}})
    given = {"settings": {"external": named}}
    if not refused:
        require_trust(Path("file"), [config], given, refuse)
        return
    with pytest.raises(ConfigError) as caught:
        require_trust(Path("file"), [config, config], given, refuse)
    assert str(caught.value).startswith(f"file runs {refused}, which you have not named on the")


@pytest.mark.slow
@pytest.mark.parametrize(("answer", "status"), [("n", 2), ("y", 4)])
def test_on_a_terminal_the_user_is_asked(answer: str, status: int, tmp_path: Path) -> None:
    endpoint = {"retry": {"attempts": 1}}
    model = {"name": "m", "base_url": "http://127.0.0.1:9/v1", "endpoint": endpoint}
    (tmp_path / "c.yaml").write_text(yaml.safe_dump({**TINY, "model": model}))
    command = ["design", "--config", str(tmp_path / "c.yaml"), "--quiet", "--out", str(tmp_path)]
    code = "import sys; from agentflow.cli import main; sys.exit(main())"
    child, terminal = pty.fork()
    if child == 0:
        os.execv(sys.executable, [sys.executable, "-c", code, *command])
    shown = b""
    with suppress(OSError):  # how the end of a terminal reads on Linux
        while part := os.read(terminal, 4096):
            shown += part
            if b"Allow it?" in part:
                os.write(terminal, answer.encode() + b"\n")
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == status
    assert b"sends prompts to http://127.0.0.1:9 with the key in OPENAI_API_KEY" in shown
