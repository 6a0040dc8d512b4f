"""Writes a session as an .eaf file for ELAN: a tier for each level of the record."""

import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from agentflow.files.atomic import write_output
from agentflow.study.episodes import MEANING
from agentflow.study.segments import Segments, describe_event, read_segments
from agentflow.study.session import Action, Audio, Note, Pause, Session, StudioTest

Span = tuple[float, float, str]
"""Begin and end, seconds since the start of the session, and a text."""
LABELS = "labels"
"""Name of the tier of labels, and of the vocabulary that its entries are from."""
MARK = 0.5
"""Seconds that an action or a note is shown for, unless another one follows sooner."""
_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that no XML file can hold."""


def write_elan(session: Session, file: Path) -> Path:
    """Write the record and the episodes of a session.

    Raises:
        UsageError: The file cannot be written.
        RunError: The episodes of the session cannot be read.
    """
    from pympi.Elan import Eaf, to_eaf

    eaf = Eaf(author="agentflow")
    eaf.adocument["DATE"] = session.start.began.isoformat(timespec="seconds")
    eaf.remove_tier("default")
    eaf.properties.clear()  # ELAN counts annotations itself
    eaf.add_language("eng", lang_label="English")
    eaf.add_controlled_vocabulary(LABELS)
    eaf.add_cv_description(LABELS, "eng", "What a person does in an episode")
    for label, meaning in MEANING.items():
        eaf.add_cv_entry(LABELS, f"cve_{label}", [(label, "eng", meaning)])
    eaf.add_linguistic_type(LABELS, timealignable=True, param_dict={
        "LINGUISTIC_TYPE_ID": LABELS, "TIME_ALIGNABLE": "true", "GRAPHIC_REFERENCES": "false",
        "CONTROLLED_VOCABULARY_REF": LABELS,
    })  # fmt: skip
    for name, spans in _tiers(session, read_segments(session)):
        eaf.add_tier(name, LABELS if name == LABELS else "default-lt")
        for begin, end, text in _separate(spans):
            eaf.add_annotation(name, begin, end, _NO_XML.sub("\N{REPLACEMENT CHARACTER}", text))
    with write_output(file) as part:
        to_eaf(part, eaf)
    return file


def _tiers(session: Session, segments: Segments) -> Iterator[tuple[str, Sequence[Span]]]:
    """Name and content of each tier, the most interpreted first."""
    episodes = segments.episodes
    yield LABELS, [(one.begin, one.end, one.label) for one in episodes if one.label]
    yield "episodes", [(one.begin, one.end, one.coarse) for one in episodes]
    yield "speech", [(one.begin, one.end, one.text) for one in segments.spoken]
    yield "notes", [(one.at, one.at + MARK, one.text) for one in session.of(Note)]
    yield "actions", [(one.at, one.at + MARK, describe_event(one)) for one in session.of(Action)]
    yield "trials", [(one.at, one.end, describe_event(one)) for one in session.of(StudioTest)]
    yield (
        "pauses",
        [(one.at, one.end, "break" if one.asked else "pause") for one in session.of(Pause)],
    )
    yield "recordings", [(one.at, session.seconds, one.file) for one in session.of(Audio)]


def _separate(spans: Iterable[Span]) -> Iterator[tuple[int, int, str]]:
    """Spans in milliseconds which do not overlap and are not empty, as ELAN needs them.

    One that overlaps the next ends where that begins; one that begins with another begins 1 ms
    after it.
    """
    ordered = sorted(spans)
    begins: list[int] = []
    for begin, _, _ in ordered:
        begins.append(max(round(1000 * begin), begins[-1] + 1 if begins else 0))
    for number, (_, end, text) in enumerate(ordered, start=1):
        start = begins[number - 1]
        last = max(round(1000 * end), start + 1)
        yield start, min([last, *begins[number : number + 1]]), text
