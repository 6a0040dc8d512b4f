"""Checks a configured endpoint, for `agentflow doctor`."""

import asyncio
from typing import Any

from agentflow.agents.designer import Designer
from agentflow.agents.registry import ROLES
from agentflow.config.run import DesignConfig
from agentflow.errors import ConfigError, UnknownNameError
from agentflow.llm.build import diagnose
from agentflow.llm.messages import JsonSchema, Message, Request, Sampling, Tool
from agentflow.machine import check, library, read_machine
from agentflow.models.choices import choose_models

_FORM = JsonSchema(
    name="answer",
    content={
        "type": "object",
        "properties": {"machine": {"type": "array", "items": {"type": "object"}}},
        "required": ["machine"],
        "additionalProperties": False,
    },
)
_TEXT = (
    "Write a machine of three blocks as a JSON object: "
    '{"machine": [{"type": 0, "id": 0, "parent": -1, "face_id": -1}, ...]}. Keep the first '
    "block. Add a small wooden block (type 15, id 1) at face 0 of block 0, and a "
    "powered wheel (type 2, id 2) at face 0 of block 1."
)
_QUESTION = Request(
    role="doctor",
    label="doctor",
    messages=(Message(role="user", text=f"{_TEXT} Reply with the object only."),),
    sampling=Sampling(max_tokens=2048, seed=1, stop=("###",), response_format=_FORM),
)
"""Uses every optional parameter, to find the unsupported ones."""
_TOOL_QUESTION = Request(
    role="doctor",
    label="doctor",
    messages=(Message(role="user", text=f"{_TEXT} Call the tool with the object."),),
    sampling=Sampling(max_tokens=2048, seed=1),
    tools=(Tool(name="check", description="Check a machine.", parameters=_FORM.content),),
)
_IDLE_S, _TOTAL_S = 60.0, 120.0
"""Time-outs for one small reply, shorter than in a run."""


def check_endpoint(config: DesignConfig, role: str = Designer.name) -> dict[str, Any]:
    """Ask the model of a role for one small machine; that of the agent has to call a tool.

    Returns:
        The fields of `Diagnosis`, with `machine` (a verdict on the machine in the reply, "" without
        a usable reply) in place of `reply`.

    Raises:
        UnknownNameError: There is no such role.
        ConfigError: The model has no endpoint, or its base URL or key cannot be used.
    """
    choices = choose_models(config.model)
    if role not in choices:
        raise UnknownNameError("role", role, choices)
    if choices[role].local:
        what = "procedural model" if choices[role].procedural else f"model in {choices[role].model}"
        raise ConfigError(
            f"the {what} has no endpoint to check; name a model with --model or AGENTFLOW_MODEL"
        )
    http = config.model.endpoint.http
    settings = http.model_copy(
        update={"idle_s": min(http.idle_s, _IDLE_S), "total_s": min(http.total_s, _TOTAL_S)}
    )
    question = _TOOL_QUESTION if ROLES[role].replies == "calls" else _QUESTION
    found = asyncio.run(diagnose(choices[role].endpoint(), settings, question)).model_dump()
    reply = found.pop("reply")
    return {**found, "machine": "" if found["problem"] else _judge(reply)}


def _judge(reply: str) -> str:
    """What the machine in a reply is worth, in one line."""
    text = reply[reply.find("[") : reply.rfind("]") + 1]
    report = check(read_machine(text, tuple(library())))
    if not text or (report.problems[:1] and report.problems[0].code == "not_json"):
        return "none in the reply: the model may be too small to design machines"
    if report.problems:
        return f"invalid: {report.problems[0].message}"
    return f"valid, {len(report.machine or ())} blocks"
