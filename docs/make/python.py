"""The page on Python: every public name, with what its docstring in the source says."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path

import griffe

from docs.make.configuration import meanings
from docs.make.markdown import anchor, blocks, code, fence, generated, sentence, table

ROOT = Path(__file__).parents[2]
PACKAGE = "agentflow"
ABOUT = (
    "This page lists the names that you can import. Those of the package `agentflow` itself come "
    "first, and they are stable. Then come the names in its modules that the documentation and the "
    "examples use, mostly to add parts of your own, and every exception."
)
ERRORS = f"{PACKAGE}.errors"
USERS = ("README.md", "docs/**/*.md", "examples/**/*.py", "recipes/**/*.py", "recipes/**/*.md")
Named = griffe.Class | griffe.Function | griffe.Attribute


def page() -> str:
    """The whole page."""
    sections = [_module(module, items) for module, items in documented().items()]
    return blocks(generated("Python", ABOUT), *sections) + "\n"


def documented() -> Mapping[str, Mapping[str, Named]]:
    """Module -> what is documented of it by name; nothing occurs twice."""
    errors = [n for n, item in _read(ERRORS).members.items() if isinstance(item, griffe.Class)]
    names = {
        PACKAGE: import_module(PACKAGE).__all__,
        **{module: sorted(names) for module, names in sorted(used_names().items())},
        ERRORS: errors,
    }
    seen: set[str] = set()
    found: dict[str, dict[str, Named]] = {}
    for module, wanted in names.items():
        items = {name: _find(module, name) for name in wanted}
        new = {name: item for name, item in items.items() if item.path not in seen}
        seen |= {item.path for item in new.values()}
        if new:
            found[module] = new
    return found


@cache
def _read(module: str) -> griffe.Module:
    """A module, without those below it."""
    file = ROOT.joinpath(*module.split("."))
    path = file / "__init__.py" if file.is_dir() else file.with_suffix(".py")
    return griffe.visit(module, path, path.read_text(encoding="utf-8"), docstring_parser="google")


def _find(module: str, name: str) -> Named:
    """What a module defines or imports under a name."""
    found = _read(module).members[name]
    if isinstance(found, griffe.Alias):
        return _find(*found.target_path.rsplit(".", 1))
    assert isinstance(found, Named)
    return found


def used_names() -> Mapping[str, set[str]]:
    """What documentation and examples import from modules of the package."""
    found: dict[str, set[str]] = {}
    for path in (path for pattern in USERS for path in sorted(ROOT.glob(pattern))):
        for node in ast.walk(ast.parse(_python(path))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(f"{PACKAGE}."):
                found.setdefault(str(node.module), set()).update(name.name for name in node.names)
    return found


def _python(path: Path) -> str:
    """The Python of a file: all of it, or that of its fences."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        return text
    return "\n".join(re.findall(r"(?ms)^```python\n(.*?)^```$", text))


def _module(path: str, items: Mapping[str, Named]) -> str:
    headings = {name: _heading(path, name, item) for name, item in items.items()}
    rows = [
        (f"[`{name}`](#{anchor(headings[name])})", _first_sentence(item))
        for name, item in items.items()
    ]
    sections = [
        blocks(f"### {headings[name]}", *_describe(name, item)) for name, item in items.items()
    ]
    return blocks(f"## {path}", table(("name", "meaning"), rows), *sections)


def _heading(module: str, name: str, item: Named) -> str:
    """Classes are marked: anchors do not distinguish `Design` from `design`."""
    whole = code(name if module == PACKAGE else f"{module}.{name}")
    return f"Class {whole}" if isinstance(item, griffe.Class) else whole


def _first_sentence(item: Named) -> str:
    return _docstring(item).value.split("\n\n")[0].replace("\n", " ")


def _docstring(item: Named) -> griffe.Docstring:
    if item.docstring is None:
        raise ValueError(f"{item.path} has no docstring: write one")
    return item.docstring


def _describe(name: str, item: Named) -> Iterator[str]:
    yield fence("pyi", _signature(name, item))
    yield from _sections(item)
    if isinstance(item, griffe.Class):
        yield table(("attribute", "type", "meaning"), _attributes(item))
        for method in _methods(item):
            yield f"#### {code(f'{name}.{method.name}')}"
            yield fence("pyi", _signature(method.name, method))
            yield from _sections(method)


def _signature(name: str, item: Named) -> str:
    if isinstance(item, griffe.Attribute):
        return _source(item)
    if isinstance(item, griffe.Class):
        bases = ", ".join(str(base) for base in item.bases if not str(base).startswith("_"))
        return f"class {name}({bases})" if bases else f"class {name}"
    keyword = "async def" if "async" in item.labels else "def"
    parts = [str(part) for part in _parameters(item)]
    short = f"{keyword} {name}({', '.join(parts)}) -> {_written(item.returns)}"
    if len(short) <= 90:
        return short
    return "\n".join(
        [
            f"{keyword} {name}(",
            *(f"    {part}," for part in parts),
            f") -> {_written(item.returns)}",
        ]
    )


def _source(item: Named) -> str:
    """Its lines in the code, which ruff has formatted: it formats this page as well."""
    assert isinstance(item.filepath, Path)
    lines = item.filepath.read_text(encoding="utf-8").splitlines()
    return "\n".join(lines[(item.lineno or 1) - 1 : item.endlineno])


def _written(expression: str | griffe.Expr | None) -> str:
    """An expression in the quotes of Python; versions of griffe write different ones."""
    return "" if expression is None else ast.unparse(ast.parse(str(expression), mode="eval"))


def _parameters(function: griffe.Function) -> Iterator[str]:
    """Parameters as written, with the bare star."""
    starred = False
    for parameter in function.parameters:
        if parameter.name in ("self", "cls"):
            continue
        kind = parameter.kind
        if kind is griffe.ParameterKind.keyword_only and not starred:
            yield "*"
        starred |= kind in (griffe.ParameterKind.keyword_only, griffe.ParameterKind.var_positional)
        star = {griffe.ParameterKind.var_positional: "*", griffe.ParameterKind.var_keyword: "**"}
        typed = f": {_written(parameter.annotation)}" if parameter.annotation else ""
        default = f" = {_written(parameter.default)}" if parameter.default is not None else ""
        yield star.get(kind, "") + parameter.name + typed + default


def _sections(item: Named) -> Iterator[str]:
    """The docstring, with tables of arguments and exceptions."""
    for section in _docstring(item).parsed:
        kind = section.kind
        if kind is griffe.DocstringSectionKind.text:
            yield str(section.value)
        elif kind is griffe.DocstringSectionKind.parameters:
            rows = [(code(each.name), _one_line(each.description)) for each in section.value]
            yield table(("argument", "meaning"), rows)
        elif kind is griffe.DocstringSectionKind.attributes:
            continue  # they are listed with their types
        elif kind is griffe.DocstringSectionKind.raises:
            rows = [
                (code(str(each.annotation)), _one_line(each.description)) for each in section.value
            ]
            yield table(("raises", "when"), rows)
        elif kind is griffe.DocstringSectionKind.returns:
            yield "Returns: " + " ".join(_one_line(each.description) for each in section.value)
        else:
            raise ValueError(f"{item.path}: its docstring has a section {kind.value!r}")


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _attributes(item: griffe.Class) -> Iterator[tuple[str, str, str]]:
    for name, member in item.members.items():
        if isinstance(member, griffe.Attribute) and not name.startswith("_"):
            if member.docstring is None and member.annotation is None:
                continue  # overrides one of a base class, which describes it
            kind = _written(member.annotation).replace(" | ", " or ")
            doc = member.docstring
            meaning = _one_line(doc.value) if doc is not None else _field_meaning(item, name)
            yield code(name), code(kind), meaning


def _field_meaning(item: griffe.Class, name: str) -> str:
    """What a pydantic model says of a field; "" where the name says it all."""
    model = getattr(import_module(item.module.path), item.name)
    fields = getattr(model, "model_fields", {})
    if name not in fields:
        return ""
    return sentence(fields[name].description or meanings(model).get(name, ""))


def _methods(item: griffe.Class) -> Iterator[griffe.Function]:
    """Public methods; one without a docstring carries out what a base class describes."""
    for name, member in item.members.items():
        if isinstance(member, griffe.Function) and not name.startswith("_") and member.docstring:
            yield member
