"""Tools from functions: name, description and JSON schema come from signature and docstring."""

from __future__ import annotations

import inspect
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_type_hints

from pydantic import BaseModel, ConfigDict, ValidationError, create_model
from pydantic.fields import FieldInfo

from agentflow.docstrings import split_docstring
from agentflow.tools.results import RefusedCall, ToolResult, ToolSpec
from agentflow.tools.workspace import Call

ToolFunction = Callable[..., Awaitable[ToolResult]]
"""Takes a `Call` and typed arguments."""
Need = Literal["", "simulations", "pictures", "controls"]


class _Arguments(BaseModel):
    model_config = ConfigDict(extra="forbid")


@dataclass(frozen=True)
class BenchTool:
    """A tool, and how to call it."""

    spec: ToolSpec
    function: ToolFunction
    _arguments: type[BaseModel]
    needs: Need
    with_controls: str
    label: str

    @classmethod
    def of(
        cls, function: ToolFunction, *, needs: Need = "", with_controls: str = "", label: str = ""
    ) -> BenchTool:
        """The tool of a function whose first parameter is the `Call`.

        The docstring has a description in one paragraph and, under `Args:`, one for each argument.

        Args:
            function: Carries out a call.
            needs: What it is charged for; it is on offer only in stages that have some;
                `controls` are simulations, where machines bring controls.
            with_controls: What the description adds where machines bring control programs.
            label: The step of designing that a call is, as docs/how-to/studies.md labels people's.
        """
        summary, about = split_docstring(inspect.getdoc(function) or "")
        hints = get_type_hints(function, include_extras=True)
        _, *parameters = inspect.signature(function).parameters.values()
        name = inspect.unwrap(function).__name__
        fields: dict[str, Any] = {
            item.name: (
                hints[item.name],
                FieldInfo(
                    default=... if item.default is item.empty else item.default,
                    description=about[item.name],
                ),
            )
            for item in parameters
        }
        model = create_model(name, __base__=_Arguments, **fields)
        schema = _plain(model.model_json_schema(), {})
        spec = ToolSpec(name, " ".join(summary.split()), schema)
        return cls(spec, function, model, needs, with_controls, label)

    async def __call__(self, call: Call, arguments: Mapping[str, Any]) -> ToolResult:
        """Call it with arguments from an agent; refuse those that do not fit the schema."""
        return await self.function(call, **self.read(arguments))

    def read(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """Typed arguments, with their defaults; refuse those that do not fit the schema."""
        try:
            given = self._arguments.model_validate(arguments)
        except ValidationError as error:
            raise RefusedCall(self._misfit(error)) from None
        return {name: getattr(given, name) for name in type(given).model_fields}

    def _misfit(self, error: ValidationError) -> str:
        """What is wrong with arguments, and what the tool takes."""
        faults = [
            f"{'.'.join(map(str, item['loc']))[:80]}"
            + (" is missing" if item["type"] == "missing" else f": {item['msg']}")
            for item in error.errors()[:4]
        ]
        names = self.spec.parameters["properties"]
        takes = ", ".join(names) if names else "no arguments"
        return f"{self.spec.name} takes {takes}; {'; '.join(faults)}"


def _plain(schema: Any, definitions: Mapping[str, Any]) -> Any:
    """A schema without titles and references, which not every endpoint understands."""
    if isinstance(schema, list):
        return [_plain(item, definitions) for item in schema]
    if not isinstance(schema, dict):
        return schema
    definitions = schema.get("$defs", definitions)
    if "$ref" in schema:
        return _plain(definitions[schema["$ref"].rpartition("/")[2]], definitions)
    return {
        key: {name: _plain(item, definitions) for name, item in value.items()}
        if key == "properties"
        else _plain(value, definitions)
        for key, value in schema.items()
        if key not in ("title", "$defs")
    }
