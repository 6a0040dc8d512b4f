"""What a docstring says of a function, and of each of its arguments."""

import re

_ARGUMENT = re.compile(r"^    (\w+): (.+(?:\n {5,}.+)*)", re.MULTILINE)


def split_docstring(text: str) -> tuple[str, dict[str, str]]:
    """The description, and one paragraph for each argument, from a docstring without indentation.

    Arguments are named under `Args:`, in the style of Google.
    """
    about, _, rest = text.partition("\n\nArgs:\n")
    return about, {name: " ".join(said.split()) for name, said in _ARGUMENT.findall(rest)}
