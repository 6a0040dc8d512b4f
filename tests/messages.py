"""Every text that agentflow shows to a user: help, errors and problems, read from the source.

python -m tests.messages            # print the list
python -m tests.messages --update   # write tests/messages.txt
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

from agentflow.docstrings import split_docstring

PACKAGE = Path(__file__).parent.parent / "agentflow"
LIST = Path(__file__).with_name("messages.txt")
ERRORS = {
    node.name
    for node in ast.parse((PACKAGE / "errors.py").read_text(encoding="utf-8")).body
    if isinstance(node, ast.ClassDef)
}


def messages() -> Iterator[str]:
    """One line per text, `module: kind: text`; expressions in texts appear as `{name}`."""
    for path in sorted(PACKAGE.rglob("*.py")):
        module = ".".join(path.relative_to(PACKAGE).with_suffix("").parts)
        for kind, text in _texts(ast.parse(path.read_text(encoding="utf-8"))):
            yield f"{module}: {kind}: {text}"


def _texts(tree: ast.Module) -> Iterator[tuple[str, str]]:
    named = {
        target.id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and _is_command(node):
            about, told = split_docstring(ast.get_docstring(node) or "")
            yield "help", " ".join(about.split("\b")[0].split())
            yield from (("help", text) for text in told.values())
        if isinstance(node, ast.Call):
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            helps = [word.value for word in node.keywords if word.arg in ("help", "epilog")]
            helps = [named.get(h.id, h) if isinstance(h, ast.Name) else h for h in helps]
            yield from (("help", text) for value in helps if (text := _text(value)))
            if name in ERRORS or name.endswith("Error") or name == "os_errors":
                yield from ((name, text) for value in node.args if (text := _text(value)))
            if name == "Problem":
                given = [*node.args[2:], *(w.value for w in node.keywords if w.arg == "message")]
                yield from (("problem", text) for value in given if (text := _text(value)))


def _is_command(node: ast.FunctionDef) -> bool:
    calls = (each for each in node.decorator_list if isinstance(each, ast.Call))
    return any(getattr(each.func, "attr", "") == "command" for each in calls)


def _text(node: ast.expr) -> str:
    """A string as written, expressions shortened to their source; "" for anything else."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return " ".join(node.value.split())
    if isinstance(node, ast.JoinedStr):
        parts = (
            part.value if isinstance(part, ast.Constant) else f"{{{_source(part.value)}}}"
            for part in node.values
        )
        return " ".join("".join(map(str, parts)).split())
    if isinstance(node, ast.BinOp):
        return _text(node.left) + _text(node.right)
    return ""


def _source(node: ast.expr) -> str:
    """An expression as source, the same for every version of Python."""
    nested = any(isinstance(each, ast.JoinedStr) for each in ast.walk(node))
    return "..." if nested else ast.unparse(node)


if __name__ == "__main__":
    listed = "\n".join(messages()) + "\n"
    if sys.argv[1:] == ["--update"]:
        LIST.write_text(listed, encoding="utf-8")
    else:
        print(listed, end="")
