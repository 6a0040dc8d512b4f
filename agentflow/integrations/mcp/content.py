"""Results, tools, prompts and resources of a bench in the types of the protocol."""

import base64
from collections.abc import Mapping

from mcp import types
from mcp.shared.exceptions import MCPError

from agentflow.tools import READING, Bench, ToolResult, ToolSpec

BRIEF, EVENTS, MACHINE = "task://brief", "run://events", "machine://"
TEXT, JSON, LINES = "text/plain", "application/json", "application/jsonl"
INSTRUCTIONS = (
    "Design a machine for the task that the tool `brief` describes. Write a machine and `check` "
    "it, `simulate` it, `edit` what fell short, and `submit` the best machine at the end."
)
REFINE = (
    "Improve the machine {} with the tools of this server: `simulate` it, `edit` what fell short, "
    "and `submit` the best machine at the end."
)
PROMPTS = (
    types.Prompt(name="design", description="Design a machine for the task from scratch."),
    types.Prompt(
        name="refine",
        description="Improve a machine that has been checked.",
        arguments=[types.PromptArgument(name="machine", description="Its name.", required=True)],
    ),
)
TEMPLATE = types.ResourceTemplate(
    name="machine",
    uri_template=f"{MACHINE}{{name}}",
    description="A machine as JSON text.",
    mime_type=JSON,
)


def tool(spec: ToolSpec) -> types.Tool:
    """A tool as clients list it."""
    return types.Tool(
        name=spec.name,
        description=spec.description,
        input_schema=dict(spec.parameters),
        annotations=types.ToolAnnotations(
            read_only_hint=spec.name in READING, destructive_hint=False, open_world_hint=False
        ),
    )


def tool_result(result: ToolResult) -> types.CallToolResult:
    """The answer to a call: text, data, and perhaps a picture."""
    content: list[types.ContentBlock] = [types.TextContent(text=result.text)]
    if result.image is not None:
        picture = base64.b64encode(result.image).decode("ascii")
        content.append(types.ImageContent(data=picture, mime_type="image/png"))
    return types.CallToolResult(
        content=content, structured_content=dict(result.data), is_error=result.refused
    )


def resources(bench: Bench | None, events: str) -> list[types.Resource]:
    """What a client can read now, at a bench or after the last one."""
    found = []
    if bench:
        task = types.Resource(name="brief", uri=BRIEF, description="The task.", mime_type=TEXT)
        found.append(task)
    if events:
        about = "What has happened in this run, one JSON object per line."
        found.append(types.Resource(name="events", uri=EVENTS, description=about, mime_type=LINES))
    for known in bench.machines if bench else ():
        uri = f"{MACHINE}{known.name}"
        found.append(types.Resource(name=known.name, uri=uri, mime_type=JSON))
    return found


def read(bench: Bench, uri: str) -> str:
    """The text of the brief or of a machine.

    Raises:
        MCPError: There is no such resource.
    """
    if uri == BRIEF:
        return bench.brief_text
    for known in bench.machines:
        if uri == f"{MACHINE}{known.name}":
            return known.machine.to_text()
    raise MCPError(types.INVALID_PARAMS, f"there is no resource {uri[:80]!r}; list them first")


def text_of(uri: str, text: str) -> types.ReadResourceResult:
    """A resource with its content."""
    mime = JSON if uri.startswith(MACHINE) else LINES if uri == EVENTS else TEXT
    found = types.TextResourceContents(uri=uri, text=text, mime_type=mime)
    return types.ReadResourceResult(contents=[found])


async def prompt(bench: Bench, name: str, given: Mapping[str, str]) -> types.GetPromptResult:
    """A prompt with the brief and, to refine one, the machine.

    Raises:
        MCPError: There is no such prompt or machine.
    """
    if name == "design":
        text = f"{INSTRUCTIONS}\n\n{bench.brief_text}"
    elif name == "refine" and "machine" in given:
        described = await bench.call("describe", {"machine": given["machine"]})
        if described.refused:
            raise MCPError(types.INVALID_PARAMS, described.text)
        text = f"{REFINE.format(given['machine'])}\n\n{described.text}\n\n{bench.brief_text}"
    else:
        raise MCPError(types.INVALID_PARAMS, "the prompts are `design` and `refine` (machine)")
    message = types.PromptMessage(role="user", content=types.TextContent(text=text))
    return types.GetPromptResult(messages=[message])
