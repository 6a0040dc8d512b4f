"""Where the seconds of the tests go, as Markdown: each folder, and the slowest tests.

scripts/test --all --junitxml=tests.xml; .venv/bin/python benchmarks/seconds.py tests.xml
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

SLOWEST = 50


def seconds(report: Path) -> Counter[str]:
    """Test -> its seconds, with what it needs to be set up."""
    found = Counter[str]()
    for case in ElementTree.parse(report).getroot().iter("testcase"):
        found[f"{case.attrib['classname']}::{case.attrib['name']}"] += float(case.attrib["time"])
    return found


def folder(test: str) -> str:
    """The part of the package that a test is about, as in tests/env."""
    return "/".join(test.partition("::")[0].split(".")[:2])


def table(heading: str, rows: list[tuple[str, float]], whole: float) -> str:
    lines = [f"| {heading} | seconds | share |", "|---|---|---|"]
    return "\n".join([*lines, *(f"| {n} | {s:.0f} | {s / whole:.0%} |" for n, s in rows)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("report", type=Path, help="what pytest --junitxml wrote")
    tests = seconds(parser.parse_args().report)
    folders = Counter[str]()
    for test, taken in tests.items():
        folders[folder(test)] += taken
    whole = tests.total()
    print(f"{len(tests)} tests, {whole:.0f} s in all processes together\n")
    print(table("folder", folders.most_common(), whole), end="\n\n")
    print(table("test", tests.most_common(SLOWEST), whole))


if __name__ == "__main__":
    main()
