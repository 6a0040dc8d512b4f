"""A session of this test's own clicks, recorded in a real browser, goes through the whole study."""

from __future__ import annotations

import json
from pathlib import Path

import pympi
import pytest
from selenium.webdriver.common.keys import Keys

from agentflow.cli import main
from agentflow.models.completion import complete_config
from agentflow.study.elan import write_elan
from agentflow.study.segments import segment
from agentflow.study.session import Session, read_session
from tests.report.browser import chromium
from tests.scripted import ScriptedClient
from tests.studio.pages import attach, blocks, find, keys, open_page, said, take_block, until
from tests.studio.serving import studio
from tests.study.test_segments import takes_the_last

TRANSCRIPT = """WEBVTT

NOTE Invented for this test: nobody said this.

00:00.100 --> 00:01.000
A frame first, then the wheels.
"""
DONE = ("building", "testing", "looking")


def click_through_a_session(runs: Path, profile: Path) -> Session:
    """Build a car with four wheels, test it, and take the last wheel away."""
    with studio(runs) as served, chromium(profile, (1280, 863)) as browser:
        browser.get(served.address)
        open_page(browser, served, "sessions")
        options = find(browser, "form.begin select")
        options.find_element("css selector", "option[value='movement']").click()
        find(browser, "form.begin button").click()
        until(browser, lambda: find(browser, "body").get_attribute("data-ready") == "build")
        take_block(browser, "wooden block")
        for face in ("0.0", "0.1"):
            attach(browser, face)
        take_block(browser, "powered wheel")
        for face in ("1.1", "1.3", "2.1", "2.3"):
            attach(browser, face)
        blocks(browser, 7)
        find(browser, ".notes input").send_keys("It will go farther with four wheels.", Keys.ENTER)
        until(browser, lambda: "Noted." in find(browser, ".session").text)
        find(browser, ".test").click()
        said(browser, "Test 1: ")
        until(browser, lambda: "filming" in str(find(browser, ".centre").get_attribute("class")))
        find(browser, ".top .tab").click()
        keys(browser, Keys.CONTROL, "z", Keys.NULL)
        blocks(browser, 6)
        end = find(browser, ".session > button:nth-of-type(3)")
        end.click()
        until(browser, lambda: end.text == "End it for good?")
        end.click()
        until(browser, lambda: find(browser, ".ended").is_displayed())
    [folder] = (runs / "sessions").iterdir()
    return read_session(folder)


@pytest.mark.slow
def test_a_session_of_clicks_is_segmented_exported_and_measured(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    session = click_through_a_session(tmp_path / "runs", tmp_path / "profile")
    transcript = tmp_path / "said.vtt"
    transcript.write_text(TRANSCRIPT)

    config = complete_config({})
    by_model = segment(session.path, transcript, config, client=ScriptedClient(takes_the_last))
    by_rules = segment(session.path, transcript, config)
    for found, labels in (
        (by_model, ["Restructure", "Test", "Diagnose", "Restructure"]),
        (by_rules, ["Build", "Test", "Observe", "Revise"]),
    ):
        assert [one.label for one in found.episodes if one.coarse in DONE] == labels
        assert found.unlabelled == 0
        assert found.episodes[-1].end == session.seconds

    eaf = pympi.Eaf(str(write_elan(session, tmp_path / "one.eaf")))
    assert [text for _, _, text in eaf.get_annotation_data_for_tier("actions")] == [
        *(["add Wooden Block"] * 2),
        *(["add Powered Wheel"] * 4),
        "watch",
        "undo",
    ]

    assert main(["study", "metrics", str(tmp_path / "runs"), "--json"]) == 0
    person, run = json.loads(capsys.readouterr().out)["sources"]
    assert person["best"] == person["final"] == run["best"] >= 40
    assert (person["trials"], person["restarts"], person["design"]) == (1, 0, "vehicle")
    assert person["foundation_first"] is run["foundation_first"] is True
    assert (person["by"], run["by"]) == ("person", "a person in the studio")
