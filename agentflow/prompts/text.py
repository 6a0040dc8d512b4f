"""Quote untrusted text in prompts, and estimate token counts."""

import json
import math
import re
from collections.abc import Mapping

_PIECES = re.compile(r"[^\W\d_]+|\d{1,3}|[^\w\s]{1,3}|_|\n+", re.UNICODE)
CL100K = 1.06
"""Maximum cl100k_base tokens per estimated token over all prompts (benchmarks/prompts.py)."""
_UNSAFE = {"`": "\\u0060", "\x85": "\\u0085", "\u2028": "\\u2028", "\u2029": "\\u2029"}


def quote(text: str) -> str:
    """Put "> " before every line to keep it from starting a heading or a fence."""
    return "\n".join(f"> {line}".rstrip() for line in text.strip().splitlines())


def guard(text: str) -> str:
    """Put "> " before lines that look like a heading or a fence; for tables and reports."""
    lines = text.strip().splitlines()
    return "\n".join(
        f"> {line}" if line.lstrip().startswith(("#", "```", "~~~")) else line for line in lines
    )


def clip(text: str, width: int, lines: int, first: int = 0) -> str:
    """Keep the `first` and the last lines of a text, `lines` in all, cut to `width` characters."""
    kept = text.strip().splitlines()
    if len(kept) > lines:
        kept = [*kept[:first], *kept[len(kept) - lines + first :]]
    return "\n".join(line if len(line) <= width else f"{line[:width]} ..." for line in kept)


def oneline(text: str) -> str:
    """Join a text into one line."""
    return " ".join(text.split())


def as_json(data: Mapping[str, object]) -> str:
    """Write an object as JSON, one key per line, escaping characters that end fences or lines."""
    items = [f" {json.dumps(key)}: {json.dumps(data[key], ensure_ascii=False)}" for key in data]
    text = "{\n" + ",\n".join(items) + "\n}"
    return "".join(_UNSAFE.get(char, char) for char in text)


def token_estimate(text: str) -> int:
    """Estimate the number of tokens of a text without a tokenizer.

    Counts the pieces into which common byte-pair tokenizers first split a text: words, groups of up
    to three digits, runs of punctuation, line breaks. A word counts one token per eight letters, or
    per two letters in non-Latin scripts.
    """
    count = 0
    for piece in _PIECES.findall(text):
        if piece[0].isalpha():
            count += math.ceil(len(piece) / (8 if piece.isascii() else 2))
        else:
            count += 1
    return count
