"""New packages: what is written, and that they install and pass their own tests."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest

from agentflow.app.plugins.scaffold import KINDS, Kind, new_plugin
from agentflow.cli import main
from agentflow.errors import UsageError

ROOT = Path(__file__).parents[3]
NAMES = {kind: f"own_{kind}" for kind in get_args(Kind)}


def test_every_kind_is_complete(tmp_path: Path) -> None:
    assert set(KINDS) == set(NAMES)
    for kind, name in NAMES.items():
        made = new_plugin(tmp_path / name, kind)
        assert {"pyproject.toml", f"{name}/__init__.py", f"tests/test_{name}.py"} < set(made.files)
        project = (made.path / "pyproject.toml").read_text()
        for group in KINDS[kind].entries:
            assert f'[project.entry-points."agentflow.{group}"]\n{name} = "{name}' in project
        for file in made.path.rglob("*.py"):
            ast.parse(file.read_text())


def test_names_that_are_not_free(tmp_path: Path) -> None:
    for name, why in (
        ("json", "there is already a package or metric 'json': choose another name"),
        ("mean_all", "there is already a package or metric 'mean_all': choose another name"),
        ("1st", "'1st' cannot name a package: use letters, digits and _"),
    ):
        with pytest.raises(UsageError) as caught:
            new_plugin(tmp_path / name, "metric")
        assert str(caught.value) == why
        assert not (tmp_path / name).exists()
    (tmp_path / "used").mkdir()
    (tmp_path / "used" / "file").touch()
    with pytest.raises(UsageError, match="used is not empty: name a new folder"):
        new_plugin(tmp_path / "used", "metric")


def test_the_command_says_what_to_do_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new-plugin", "my-search", "--kind", "strategy"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "my-search/my_search/__init__.py",
        "my-search/my_search/strategy.py",
        "my-search/pyproject.toml",
        "my-search/tests/test_my_search.py",
        "install it: pip install --no-deps --editable my-search",
        "test it: pytest my-search",
        "use it: agentflow design --set search.strategy=my_search",
    ]


@pytest.mark.slow
def test_new_packages_install_and_pass_their_tests(tmp_path: Path) -> None:
    """In an environment of their own, which sees the libraries of this one."""
    pytest.importorskip("setuptools", minversion="70.1")  # earlier ones build only with wheel
    venv = tmp_path / "venv"
    _run(sys.executable, "-m", "venv", "--without-pip", venv, cwd=tmp_path)
    python = venv / "bin" / "python"
    found = _run(python, "-c", "import site; print(site.getsitepackages()[0])", cwd=tmp_path)
    libraries = [path for path in sys.path if path.endswith("site-packages")]
    (Path(found.strip()) / "these.pth").write_text("\n".join([str(ROOT), *libraries]))
    for kind, name in NAMES.items():
        new_plugin(tmp_path / name, kind)
    pip = ("-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-index")
    folders = [tmp_path / name for name in NAMES.values()]
    _run(python, *pip, "--no-deps", "--no-build-isolation", *folders, cwd=tmp_path)
    tests = _run(python, "-m", "pytest", "-q", "-p", "no:cacheprovider", *folders, cwd=tmp_path)
    assert "11 passed" in tests
    small = ["--set", "trajectories=1", "--set", "search.rounds=1", "--set", "verify=false"]
    parts = ["--set", "search.strategy=own_strategy", "--set", "prompts=own_prompts"]
    main_ = "import sys; from agentflow.cli import main; sys.exit(main())"
    design = ("design", "--task", "own_family", "--workflow", "own_role", "--quiet")
    shown = _run(python, "-c", main_, *design, *small, *parts, cwd=tmp_path)
    assert "best score" in shown


def _run(*command: object, cwd: Path) -> str:
    environ = {name: os.environ[name] for name in ("PATH", "HOME") if name in os.environ}
    done = subprocess.run(
        list(map(str, command)), cwd=cwd, env=environ, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
