"""Owns opening XML that nobody vouches for: no document type, no entities, no deep nesting."""

from __future__ import annotations

from typing import NoReturn
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

MAX_DEPTH = 64
"""Deepest nesting that is read; machine files need six levels."""


class UnsafeXmlError(ValueError):
    """The text is no XML, or XML that is not opened; the message says which."""


def parse_xml(text: str) -> Element:
    """The root element of an XML text.

    Raises:
        UnsafeXmlError: It is not well-formed, declares a document type or entities, or is nested
            too deeply.
    """
    parser = expat.ParserCreate()
    builder = TreeBuilder()
    depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_DEPTH:
            raise UnsafeXmlError(f"the XML is nested more than {MAX_DEPTH} deep")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_: object) -> NoReturn:
        raise UnsafeXmlError("the XML declares a document type; such files are not opened")

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise UnsafeXmlError(f"this is no well-formed XML: {error}") from None
    except UnicodeEncodeError:
        raise UnsafeXmlError("this is no well-formed XML: it has lone surrogates") from None
    root: Element = builder.close()
    return root
