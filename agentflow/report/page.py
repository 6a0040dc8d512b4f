"""Owns the file: one HTML page that holds its script, its style and its data, and loads nothing.

What the data say is the other modules'; how they are shown is web/'s.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from agentflow.errors import UsageError

BUNDLE = Path(__file__).parent / "bundle"
"""Made from web/ when the package is built; not in the repository."""
SCRIPT, STYLE = "player.js", "player.css"
POLICY = (
    "default-src 'none'; script-src {script}; style-src {style}; img-src data:; "
    "base-uri 'none'; form-action 'none'; trusted-types 'none'; require-trusted-types-for 'script'"
)
PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="agentflow">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<noscript>This page shows its data by a script, which it holds itself. Nothing is loaded.</noscript>
<script type="application/json" id="data">{data}</script>
<script>{script}</script>
</body>
</html>
"""


def page(title: str, data: Mapping[str, Any]) -> str:
    """The whole page, as text.

    Args:
        title: For the window; plain text.
        data: JSON data; `kind` says which page it is for: run, sweep or gallery.

    Raises:
        UsageError: The bundle is missing; says how to make it.
    """
    script, style = bundled(SCRIPT), bundled(STYLE)
    policy = POLICY.format(script=_source(script), style=_source(style))
    return PAGE.format(
        policy=policy, title=html.escape(title), style=style, data=embedded(data), script=script
    )


def check_bundle() -> None:
    """See that pages can be made, before work is done for one.

    Raises:
        UsageError: The bundle is missing; says how to make it.
    """
    for name in (SCRIPT, STYLE):
        bundled(name)


def bundled(name: str) -> str:
    """A file of the bundle.

    Raises:
        UsageError: It is missing.
    """
    try:
        return (BUNDLE / name).read_text(encoding="utf-8")
    except OSError:
        raise UsageError(
            f"the report's player is missing ({name} was not bundled when agentflow was "
            "installed): run scripts/setup in a checkout, or install again with pip install ."
        ) from None


def embedded(data: Mapping[str, Any]) -> str:
    """JSON that no HTML parser takes for markup: every <, > and & is escaped, all is ASCII."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return text


def _source(content: str) -> str:
    digest = hashlib.sha256(content.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode()}'"
