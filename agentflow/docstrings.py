"""What a docstring says of a function or a class, and of each argument or attribute."""

import re

_HEADING = re.compile(r"\n\n(?:Args|Attributes):\n")
_ARGUMENT = re.compile(r"^    (\w+): (.+(?:\n {5,}.+)*)", re.MULTILINE)


def split_docstring(text: str) -> tuple[str, dict[str, str]]:
    """The description, and one paragraph for each argument, from a docstring without indentation.

    Arguments are named under `Args:`, attributes under `Attributes:`, in the style of Google.
    """
    about, *rest = _HEADING.split(text, 1)
    told = _ARGUMENT.findall("".join(rest))
    return about, {name: " ".join(said.split()) for name, said in told}
