"""A release holds all that it needs: it installs without node, and works from any folder."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from tests.install_lines import CLONE, install_lines

ROOT = Path(__file__).parents[1]
PARTS = (
    *("agentflow", "agentflow_command.py", "agentflow_verifiers.py"),
    *("pyproject.toml", "setup.py", "MANIFEST.in", "README.md", "LICENSE"),
)
PAGES = ("player.css", "player.js", "studio.css", "studio.js", "stamp.txt")
BUNDLE = {f"agentflow/report/bundle/{name}" for name in PAGES}
WEB = ("agentflow/report/web/", "agentflow/studio/web/")
METADATA = ("METADATA", "RECORD", "WHEEL", "entry_points.txt", "top_level.txt", "licenses/LICENSE")


def run(
    *command: object,
    folder: Path,
    path: str = os.environ["PATH"],
    stderr: int = subprocess.PIPE,
) -> str:
    """Standard output of a command, which must succeed; it cannot import from the checkout."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        list(map(str, command)),
        cwd=folder,
        env={**environment, "PATH": path},
        stdout=subprocess.PIPE,
        stderr=stderr,
        text=True,
    )
    assert done.returncode == 0, done.stdout + (done.stderr or "")
    return done.stdout


def packaged_files() -> set[str]:
    """The package's files in the checkout, committed or not."""
    listed = run(
        *("git", "ls-files", "--cached", "--others", "--exclude-standard", "agentflow"), folder=ROOT
    )
    return {name for name in listed.splitlines() if (ROOT / name).exists()}


def record_blocks() -> dict[str, list[dict[str, int]]]:
    """The machine of each record: what an agent that is measured must not find."""
    found = {
        file.relative_to(ROOT / "records").with_suffix("").as_posix(): json.loads(file.read_bytes())
        for file in ROOT.glob("records/**/*.json")
    }
    return {name: record["blocks"] for name, record in found.items()}


def solutions_in(texts: dict[str, str]) -> list[tuple[str, str]]:
    """Each text with a machine of a record, however it is spaced, or with the end of one."""
    found = []
    for name, text in texts.items():
        plain = "".join(text.split()).replace("'", '"')
        for record, blocks in record_blocks().items():
            tail = json.dumps(blocks[-min(6, len(blocks) - 1) :], separators=(",", ":"))
            if tail.strip("[]") in plain:
                found.append((name, record))
    return found


def newest_python() -> str:
    """The newest CPython that is found, from 3.12 on; the running one if there is none."""
    found = run(ROOT / "scripts" / "pythons", "3.12", folder=ROOT).splitlines()
    return found[0] if found else sys.executable


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_release_installs_without_node_and_designs_a_machine(tmp_path: Path) -> None:
    source, dist, elsewhere = tmp_path / "source", tmp_path / "dist", tmp_path / "elsewhere"
    for folder in (source, elsewhere):
        folder.mkdir()
    for name in {*packaged_files(), *BUNDLE, *PARTS[1:]}:
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, source / name)
    for name in ("configs", "records"):
        shutil.copytree(ROOT / name, source / name)
    configs = {str(path.relative_to(ROOT)) for path in ROOT.glob("configs/**/*.yaml")}

    run(sys.executable, "-m", "build", "--sdist", "--outdir", dist, folder=source)
    [packed] = dist.glob("*.tar.gz")
    with tarfile.open(packed) as archive:
        held = {name.partition("/")[2] for name in archive.getnames() if "." in Path(name).name}
    ours = packaged_files()
    assert {name for name in held if name.startswith("agentflow/")} == ours | BUNDLE
    assert configs <= held

    build = (sys.executable, "-m", "build", "--wheel", "--outdir", dist)
    assert "nodejs" not in run(*build, packed, folder=elsewhere)
    [wheel] = dist.glob("*-py3-none-any.whl")
    release = wheel.name.removesuffix("-py3-none-any.whl")
    with zipfile.ZipFile(wheel) as archive:
        content = set(archive.namelist())
        texts = {name: archive.read(name).decode(errors="replace") for name in content}
    assert solutions_in({"the control": json.dumps(record_blocks()["throwing-1"], indent=4)})
    assert solutions_in(texts) == []
    assert content == {
        *(name for name in ours if not name.startswith(WEB)),
        *BUNDLE,
        *PARTS[1:3],
        *(f"agentflow/{name}" for name in configs),
        *(f"{release}.dist-info/{name}" for name in METADATA),
    }

    venv = tmp_path / "venv"
    run(newest_python(), "-m", "venv", venv, folder=elsewhere)
    pip = (venv / "bin" / "python", "-m", "pip", "install", "--disable-pip-version-check")
    require_documented_lines(*pip, "--find-links", dist, folder=elsewhere)
    [step] = re.findall(r"(?m)^RUN (pip install .*)$", (ROOT / "Dockerfile").read_text("utf-8"))
    install = step.replace("/wheels", str(dist))
    run("sh", "-c", install, folder=elsewhere, path=f"{venv / 'bin'}{os.pathsep}{os.defpath}")
    require_documented_lines(*pip, folder=elsewhere)
    shutil.copytree(ROOT / "examples" / "pushing", source / "examples" / "pushing")
    for folder in CLONE:
        run(*pip, "--dry-run", "--no-deps", folder, folder=source)

    agentflow, bare = venv / "bin" / "agentflow", str(venv / "bin")
    small = ("--workflow", "iterative", "--set", "search.rounds=1", "--json")
    design = run(agentflow, "design", "--task", "throwing", *small, folder=elsewhere, path=bare)
    result = json.loads(design)
    assert result["score"] > 0
    for plan in (("sweep", "inspector"), ("benchmark",)):
        run(agentflow, *plan, "--dry-run", folder=elsewhere, path=bare)
    run(agentflow, "report", result["run"], "--out", "page.html", folder=elsewhere, path=bare)
    assert "</html>" in (elsewhere / "page.html").read_text(encoding="utf-8")


def require_documented_lines(*pip: object, folder: Path) -> None:
    """Every line of a document finds agentflow without an index, with the extra that it names."""
    lines = {line: page for line, page in install_lines().items() if not {*line} & {*CLONE}}
    words = dict.fromkeys(word for line in lines for word in line)  # at once: pip is slow
    offline = (*pip, "--dry-run", "--no-deps", "--no-index")
    planned = run(*offline, *words, folder=folder, stderr=subprocess.STDOUT)
    assert "agentflow" in planned, (lines, planned)
    assert "WARNING" not in planned, (lines, planned)  # as of an extra that is not there
