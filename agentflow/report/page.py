"""Pages: single HTML files that contain their script, style and data and load nothing."""

from __future__ import annotations

import base64
import hashlib
import html
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from agentflow.errors import UsageError
from agentflow.files.atomic import write_output
from agentflow.files.templates import fill

BUNDLE = Path(__file__).parent / "bundle"
"""Built from web/ when the package is installed; not in the repository."""
SCRIPT, STYLE = "player.js", "player.css"
POLICY = (
    "default-src 'none'; script-src {script}; style-src {style}; img-src data:; "
    "base-uri 'none'; form-action 'none'; trusted-types 'none'; require-trusted-types-for 'script'"
)


def page(title: str, data: Mapping[str, Any]) -> str:
    """The whole page; `title` is plain text, and the data's `kind` says which page."""
    script, style = read_bundle(SCRIPT), read_bundle(STYLE)
    policy = POLICY.format(script=_source(script), style=_source(style))
    title, content = html.escape(title), embeddable_json(data)
    known = {"policy": policy, "title": title, "style": style, "data": content, "script": script}
    return fill("agentflow.report", "page.html", **known)


def write_page(out: Path, title: str, data: Mapping[str, Any]) -> None:
    """Write a page to a file; arguments as for `page`."""
    with write_output(out) as part:
        part.write_text(page(title, data), encoding="utf-8")


def require_writable(out: Path) -> None:
    """Check that the bundle exists and the page can be written, before the work starts."""
    check_bundle()
    if out.is_dir() or not out.parent.is_dir():
        why = "it is a directory" if out.is_dir() else f"no such directory: {out.parent}"
        raise UsageError(f"cannot write {out}: {why}")


def check_bundle() -> None:
    """Raise UsageError if the bundle is missing, before any work is done."""
    for name in (SCRIPT, STYLE):
        read_bundle(name)


def read_bundle(name: str) -> str:
    """Read a file of the bundle; UsageError if it is missing."""
    try:
        return (BUNDLE / name).read_text(encoding="utf-8")
    except OSError:
        raise UsageError(
            f"the report player is missing ({name} was not bundled when agentflow was installed): "
            "run scripts/setup in a checkout, or reinstall with pip install ."
        ) from None


def embeddable_json(data: Mapping[str, Any]) -> str:
    """JSON that cannot be read as HTML markup: ASCII, with <, > and & escaped."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return text


def _source(content: str) -> str:
    digest = hashlib.sha256(content.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode()}'"
