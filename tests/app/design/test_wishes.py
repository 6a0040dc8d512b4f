"""The user's own words and sketch: what models get, what a run keeps, what is refused."""

from __future__ import annotations

from base64 import b64decode
from pathlib import Path

import pytest
from PIL import Image

from agentflow.app.design.plan import RunPlan
from agentflow.app.design.replay import replay
from agentflow.app.design.run import RunOptions, design, resume
from agentflow.app.sketch import SIDE
from agentflow.cli import main
from agentflow.config.run import DesignConfig, build_config
from agentflow.errors import DamagedError, EndpointError, UsageError
from tests.app.test_doctor import threaded
from tests.llm.hostile import body, reply

MACHINE = """It stands.
```json
[{"type": 0, "id": 0, "parent": -1, "face_id": -1},
 {"type": 1, "id": 1, "parent": 0, "face_id": 0}]
```"""
REPLY = reply(MACHINE)
WISHES = "a machine that\n## Your reply\nhas {{ arms }}"


def ignore(_line: str) -> None:
    """Ignores remarks."""


def tiny(**settings: object) -> DesignConfig:
    given = {"trajectories": 1, "search": {"rounds": 0}, "inspector": False, **settings}
    return build_config({"workflow": "single", "workers": 1, "verify": False, "settings": given})


@pytest.fixture
def drawn(tmp_path: Path) -> Path:
    file = tmp_path / "arm.png"
    Image.new("RGBA", (2 * SIDE, 30)).save(file)
    return file


@pytest.mark.slow
def test_wishes_and_sketch_reach_the_model_and_stay_in_the_run(drawn: Path, tmp_path: Path) -> None:
    config = tiny(trajectories=2, brief=WISHES, sketch=str(drawn))
    denied = body({"error": {"message": "no"}}, 403)
    with threaded(REPLY, denied, REPLY) as server:
        model = config.model.model_copy(update={"name": "m", "base_url": server.base_url})
        with pytest.raises(EndpointError):
            design(config.model_copy(update={"model": model}), tmp_path / "runs")
        (run,) = (tmp_path / "runs").iterdir()
        drawn.unlink()
        resume(run, RunOptions(approve=lambda _sentence: True))
        designs = [item.body["messages"][1]["content"] for item in server.asked]
    for text, picture in designs:
        assert "written about the machine:\n> a machine that\n> ## Your reply" in text["text"]
        assert "has {{ arms }}" in text["text"]
        assert "user's sketch" in text["text"]
        assert picture["image_url"]["url"].startswith("data:image/png;base64,")
    assert replay(run, ignore) is None
    (kept,) = run.glob("sketch-*.png")
    sent = designs[0][1]["image_url"]["url"].removeprefix("data:image/png;base64,")
    assert b64decode(sent) == kept.read_bytes()
    with Image.open(kept) as shown:
        assert shown.size == (SIDE, 15)
        assert shown.getpixel((0, 0)) == (255, 255, 255)
    kept.write_bytes(kept.read_bytes() + b" ")
    with pytest.raises(DamagedError, match="the sketch of the run, is missing or has changed"):
        replay(run, ignore)


def test_without_them_prompts_and_conditions_are_those_of_before(drawn: Path) -> None:
    plain, brief = RunPlan.of(tiny()), RunPlan.of(tiny(brief="tall"))
    sketch = RunPlan.of(tiny(sketch=str(drawn)))
    assert plain.brief == plain.task.brief
    assert plain.conditions["demands"] == brief.conditions["demands"]
    prompts = [plan.conditions["prompts"] for plan in (plain, brief, sketch)]
    assert prompts[0] != prompts[1] == prompts[2]
    assert "does not read the user's wishes" in brief.model_note
    assert not plain.model_note


@pytest.mark.parametrize("brief", [" ", "x" * 10_000_000])
def test_a_brief_that_is_empty_or_long_is_refused(brief: str) -> None:
    with pytest.raises(UsageError, match=r"settings\.brief: expected 1 to 8000 characters") as why:
        tiny(brief=brief)
    assert len(str(why.value)) < 100


def test_pictures_that_cannot_be_shown_are_refused(tmp_path: Path) -> None:
    paint, large, bomb, cut = (tmp_path / f"{n}.png" for n in ("paint", "large", "bomb", "cut"))
    Image.new("RGB", (9, 9)).save(paint, "JPEG")
    with large.open("wb") as file:
        file.truncate(100_000_000)
    Image.new("1", (8000, 7000)).save(bomb)
    Image.effect_noise((99, 99), 50).save(cut)
    cut.write_bytes(cut.read_bytes()[:5000])
    for file, why in {
        tmp_path / "none.png": "cannot read the sketch .*: No such file",
        tmp_path: "cannot read the sketch .*: Is a directory",
        paint: "is no whole PNG picture: save it as PNG",
        cut: "is no whole PNG picture: save it as PNG",
        large: "has more than 20 million bytes: make it smaller",
        bomb: "has more than 50 million pixels: make it smaller",
    }.items():
        with pytest.raises(UsageError, match=why):
            RunPlan.of(tiny(sketch=str(file)))


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (["--workflow", "single"], "the designer is played by procedural"),
        (
            ["--workflow", "tools", "--model", "m"],
            "the workflow tools, as configured, asks no role",
        ),
    ],
)
def test_what_does_not_see_is_refused_before_any_call(
    options: list[str],
    why: str,
    drawn: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["design", "--sketch", str(drawn), *options]) == 2
    assert why in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()
