"""Parse untrusted XML: no document type, no entities, no deep nesting."""

from __future__ import annotations

from typing import NoReturn
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

MAX_DEPTH = 64
"""Maximum nesting; machine files need six levels."""


class UnsafeXmlError(ValueError):
    """The text is not XML, or is XML that is refused for safety."""


def parse_xml(text: str) -> Element:
    """The root element of an XML text.

    Raises:
        UnsafeXmlError: The text is not well-formed, declares a document type or entities, or is
            nested too deeply.
    """
    parser = expat.ParserCreate()
    builder = TreeBuilder()
    depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_DEPTH:
            raise UnsafeXmlError(f"the XML is nested more than {MAX_DEPTH} levels deep")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_: object) -> NoReturn:
        raise UnsafeXmlError("the XML declares a document type, which is not allowed")

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise UnsafeXmlError(f"this is not well-formed XML: {error}") from None
    except UnicodeEncodeError:
        raise UnsafeXmlError("this is not well-formed XML: it contains lone surrogates") from None
    root: Element = builder.close()
    return root
