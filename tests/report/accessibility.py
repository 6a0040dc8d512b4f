"""What axe-core finds on a page: rules of accessibility that a program can check."""

from __future__ import annotations

from pathlib import Path

from selenium import webdriver

import agentflow

AXE = Path(agentflow.__file__).parent / "report" / "bundle" / "axe.min.js"
"""Comes with the page's bundle in a checkout; no release holds it."""
SCREENS = ((1440, 900, False), (1440, 900, True), (390, 844, False), (390, 844, True))
"""Width, height, and whether it is dark."""
RULES = """
const [done] = arguments;
axe.run(document, { resultTypes: ["violations"] }).then(({ violations }) => done(
  violations.flatMap(({ id, nodes }) => nodes.map(({ target, failureSummary }) =>
    `${id}: ${target.flat().join(" ")}: ${failureSummary.split("\\n")[1]}`))));"""


def violations(driver: webdriver.Chrome) -> list[str]:
    """Each rule that the page breaks, where, and how it can be mended."""
    driver.execute_script(AXE.read_text(encoding="utf-8"))
    return list(driver.execute_async_script(RULES))
