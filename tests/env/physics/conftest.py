"""Leaves out the folders of tests that look inside an engine that is not installed."""

from __future__ import annotations

from tests.installed import missing_engines

collect_ignore_glob = [f"{name}/*" for name in missing_engines()]
