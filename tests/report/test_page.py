"""The file: what it holds, what it allows, and how it refuses to be made without its player."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from pathlib import Path

import pytest

from agentflow.errors import UsageError
from agentflow.report.page import embeddable_json, page, read_bundle

WEB = Path(__file__).parent.parent.parent / "agentflow" / "report" / "web"


def hash_of(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def test_the_policy_names_script_and_style_by_hash_and_nothing_else() -> None:
    text = page("t", {"kind": "gallery"})
    script = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    style = re.findall(r"<style>(.*?)</style>", text, re.DOTALL)
    assert (len(script), len(style), text.count("<script")) == (1, 1, 2)
    policy = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text)
    assert policy == [
        f"default-src 'none'; script-src '{hash_of(script[0])}'; style-src '{hash_of(style[0])}'; "
        "img-src data:; base-uri 'none'; form-action 'none'; trusted-types 'none'; "
        "require-trusted-types-for 'script'"
    ]


def test_the_window_title_is_text() -> None:
    assert "<title>&lt;b&gt;&amp;&quot;</title>" in page('<b>&"', {"kind": "gallery"})


def test_data_hold_no_markup_and_come_back_whole() -> None:
    data = {"a": "</script><!--<script>&amp; \u2028 \x00 \ud800 é", "b": [1, None, 2.5]}
    text = embeddable_json(data)
    assert text.isascii()
    assert not set("<>&") & set(text)
    assert json.loads(text) == data


def test_numbers_that_json_does_not_know_are_a_bug() -> None:
    with pytest.raises(ValueError, match="Out of range float values"):
        embeddable_json({"score": float("nan")})


def test_the_player_keeps_its_licence() -> None:
    script = read_bundle("player.js")
    assert "Permission is hereby granted, free of charge" in script[:1500]
    assert re.match(r"(?s).{0,20}/\*! Contains three\.js 0\.\d+", script)


def test_a_missing_bundle_says_how_to_make_it() -> None:
    with pytest.raises(UsageError) as caught:
        read_bundle("missing.js")
    assert str(caught.value) == (
        "the report player is missing (missing.js was not bundled when agentflow was installed): "
        "run scripts/setup in a checkout, or reinstall with pip install ."
    )


def test_the_lock_file_names_no_host_and_every_package_by_its_content() -> None:
    text = (WEB / "package-lock.json").read_text()
    lock = json.loads(text)
    assert "://" not in text
    packages = {name: entry for name, entry in lock["packages"].items() if name}
    assert all(entry["integrity"].startswith("sha512-") for entry in packages.values())
    licenses = {name: entry["license"] for name, entry in packages.items()}
    # Pages are tested with axe-core, which is not in the bundle.
    assert licenses.pop("node_modules/axe-core") == "MPL-2.0"
    assert set(licenses.values()) == {"MIT"}
    assert packages["node_modules/axe-core"]["dev"]
