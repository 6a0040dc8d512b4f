"""Gathers the sources of the site in one folder: pages with their links, pictures, theme."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from docs.make.links import REPOSITORY, ROOT, rewrite, show, site_path
from docs.make.pages import DOCS, SECTIONS, pages_of

MAKE = Path(__file__).parent
GALLERY = Path("gallery")
"""Folder of the gallery in the site."""
PICTURES = (".png", ".gif", ".webp", ".svg", ".json")
"""Files that pages show or offer, besides the pages themselves."""
UNSEARCHED = "---\nsearch:\n  exclude: true\n---\n\n"
"""Head of pages that show a file of the repository."""
Nav = list[dict[str, "str | Nav"]]


def stage(folder: Path) -> None:
    """Write the pages into `folder/docs`, and the settings of Zensical beside them."""
    target = folder / "docs"
    shutil.copytree(MAKE / "theme" / "assets", target / "assets")
    _stage_pictures(target)
    documents = _stage_pages(target)
    settings = (MAKE / "zensical.toml").read_text(encoding="utf-8")
    nav = f"nav = {_toml(navigation(documents))}"
    (folder / "zensical.toml").write_text(settings.replace("nav = []", nav), encoding="utf-8")


def navigation(documents: dict[str, str]) -> Nav:
    """The navigation of the site; `documents` are titles and paths of pages beside `docs`."""
    sections: Nav = [
        {title: [{page.title: page.path.as_posix()} for page in pages_of(folder)]}
        for folder, title in SECTIONS.items()
    ]
    project: Nav = [{title: path} for title, path in sorted(documents.items())]
    return [
        {"Start": "index.md"},
        {"Gallery": f"{GALLERY}/index.md"},
        *sections,
        {"Project": project},
    ]


def _stage_pictures(target: Path) -> None:
    for path in DOCS.rglob("*"):
        if _is_picture(path):
            place = target / path.relative_to(DOCS)
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, place)


def _stage_pages(target: Path) -> dict[str, str]:
    """Write the pages of `docs`, and of all that they lead to; title -> path of the latter."""
    waiting, seen, documents = sorted(DOCS.rglob("*.md")), set[Path](), dict[str, str]()
    while waiting:
        source = waiting.pop(0)
        if source in seen or _is_picture(source):
            continue
        seen.add(source)
        place = site_path(source)
        if source.suffix == ".md":
            text = rewrite(source, source.read_text(encoding="utf-8"), waiting.append)
            if place.is_relative_to(REPOSITORY):
                documents[_title(source, text)] = place.as_posix()
        else:
            text = UNSEARCHED + show(source)
        (target / place).parent.mkdir(parents=True, exist_ok=True)
        (target / place).write_text(text, encoding="utf-8")
    return documents


def _title(source: Path, text: str) -> str:
    """The first line of a document; README's is the name of the whole site."""
    return "README" if source == ROOT / "README.md" else text.partition("\n")[0].removeprefix("# ")


def _is_picture(path: Path) -> bool:
    return path.suffix in PICTURES and path.is_relative_to(DOCS) and not path.is_relative_to(MAKE)


def _toml(nav: Nav) -> str:
    """A navigation in TOML, whose strings can be written as those of JSON."""
    return f"[{', '.join(_entry(*item) for entry in nav for item in entry.items())}]"


def _entry(title: str, inner: str | Nav) -> str:
    value = json.dumps(inner) if isinstance(inner, str) else _toml(inner)
    return f"{{ {json.dumps(title)} = {value} }}"
