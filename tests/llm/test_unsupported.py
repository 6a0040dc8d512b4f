"""Unsupported parameters in the messages of several vendors."""

from __future__ import annotations

import pytest

from agentflow.errors import RefusedError
from agentflow.llm.endpoint.body import request_body
from agentflow.llm.endpoint.faults import ErrorResponse, read_error_response
from agentflow.llm.endpoint.unsupported import UnsupportedParameters, refuses_images, refuses_tools
from agentflow.llm.messages import JsonSchema, Message, NamedTool, Tool
from tests.llm.helpers import ask, client_for
from tests.llm.hostile import body, reply, serving

FULL = request_body(
    ask(max_tokens=5, seed=1, stop=("END",), response_format="json_object"),
    "m",
)
EXTRA = (
    "[{'type': 'extra_forbidden', 'loc': ('body', '%s'), "
    "'msg': 'Extra inputs are not permitted', 'input': 1}]"
)

WORDINGS = [
    (
        "max_tokens",
        "Unsupported parameter: 'max_tokens' is not supported with this model. "
        "Use 'max_completion_tokens' instead.",
        "max_tokens",
    ),
    ("max_tokens", EXTRA % "max_tokens", ""),
    (
        "temperature",
        "Unsupported value: 'temperature' does not support 0.7 with this model. "
        "Only the default (1) value is supported.",
        "temperature",
    ),
    ("temperature", "`temperature` is deprecated for this model.", ""),
    ("top_p", "Unsupported parameter: 'top_p' is not supported with this model.", "top_p"),
    (
        "top_p",
        "`temperature` and `top_p` cannot both be specified for this model. Please use only one.",
        "",
    ),
    ("seed", EXTRA % "seed", ""),
    ("seed", "Unrecognized request argument supplied: seed", ""),
    ("stop", "Argument not supported on this model: stop", ""),
    ("stop", "Unsupported parameter: 'stop' is not supported with this model.", "stop"),
    (
        "response_format",
        "'response_format.type' must be 'json_schema' or 'text'",
        "",
    ),
    (
        "response_format",
        "Invalid parameter: 'response_format' of type 'json_object' is not supported "
        "with this model.",
        "response_format",
    ),
    ("stream_options", EXTRA % "stream_options", ""),
    ("stream", "Your organization must be verified to stream this model.", "stream"),
]


@pytest.mark.parametrize(("name", "message", "param"), WORDINGS)
def test_vendor_messages(name: str, message: str, param: str) -> None:
    warnings: list[str] = []
    unsupported = UnsupportedParameters(warnings.append)
    assert unsupported.learn(ErrorResponse(400, message, param), FULL, "message")
    known_as = "response_format json_object" if name == "response_format" else name
    assert set(unsupported.actions) == {known_as}
    assert len(warnings) == 1
    assert name not in unsupported.adapt(FULL)


@pytest.mark.parametrize(("name", "message", "param"), WORDINGS)
async def test_vendor_messages_over_the_network(name: str, message: str, param: str) -> None:
    refusal = body({"error": {"message": message, "param": param or None}}, 400)
    request = ask(max_tokens=5, seed=1, stop=("END",), response_format="json_object")
    warnings: list[str] = []
    async with serving(refusal, reply("ok")) as server:
        client = client_for(server.base_url, warn=warnings.append)
        for _ in range(2):
            assert (await client.complete(request)).text == "ok"
        await client.aclose()
    first, *others = [asked.body for asked in server.asked]
    assert name in first
    assert len(others) == 2
    assert not any(name in sent for sent in others)
    assert len(warnings) == 1


@pytest.mark.parametrize(
    "message",
    [
        "max_tokens is too large: 100000. This model supports at most 4096 completion tokens.",
        "Invalid 'temperature': decimal above maximum value. Expected a value <= 2.",
        "This model's maximum context length is 8192 tokens.",
        "The model `m` is not supported",
        "nonstop temperatures",
    ],
)
def test_user_errors_are_not_hidden(message: str) -> None:
    unsupported = UnsupportedParameters(lambda _line: pytest.fail("warned"))
    assert not unsupported.learn(ErrorResponse(400, message), FULL, "")


def test_max_tokens_becomes_max_completion_tokens_then_nothing() -> None:
    warnings: list[str] = []
    unsupported = UnsupportedParameters(warnings.append)
    unsupported.learn(ErrorResponse(400, "unsupported", "max_tokens"), FULL, "no")
    adapted = unsupported.adapt(FULL)
    assert adapted["max_completion_tokens"] == 5
    unsupported.learn(ErrorResponse(422, EXTRA % "max_completion_tokens"), adapted, "no")
    assert not {"max_tokens", "max_completion_tokens"} & set(unsupported.adapt(FULL))
    assert warnings == [
        "the endpoint does not support max_tokens: "
        "replaced by max_completion_tokens from now on (no)",
        "the endpoint does not support max_completion_tokens: omitted from now on (no)",
    ]


def test_without_a_stream_there_are_no_stream_options() -> None:
    unsupported = UnsupportedParameters(lambda _line: None)
    unsupported.learn(ErrorResponse(400, "unsupported", "stream"), FULL, "")
    assert not {"stream", "stream_options"} & set(unsupported.adapt(FULL))


def test_a_known_parameter_is_omitted_without_another_warning() -> None:
    warnings: list[str] = []
    unsupported = UnsupportedParameters(warnings.append)
    refusal = read_error_response(422, {}, b'{"detail": "seed: Extra inputs are not permitted"}')
    assert unsupported.learn(refusal, FULL, "")
    assert unsupported.learn(refusal, FULL, "")
    assert len(warnings) == 1
    assert not unsupported.learn(refusal, unsupported.adapt(FULL), "")


def test_other_statuses_are_ignored() -> None:
    assert not UnsupportedParameters(lambda _line: None).learn(
        ErrorResponse(500, "unsupported", "seed"), FULL, ""
    )


def test_a_schema_becomes_an_object_then_nothing() -> None:
    schema = JsonSchema(name="reply", content={"type": "object"})
    body = request_body(ask(response_format=schema), "m")
    assert body["response_format"] == {
        "type": "json_schema",
        "json_schema": {"name": "reply", "schema": {"type": "object"}},
    }
    warnings: list[str] = []
    unsupported = UnsupportedParameters(warnings.append)
    message = "This response_format type is unavailable now"
    assert unsupported.learn(ErrorResponse(400, message), body, "no")
    adapted = unsupported.adapt(body)
    assert adapted["response_format"] == {"type": "json_object"}
    assert unsupported.learn(ErrorResponse(400, message), adapted, "no")
    assert "response_format" not in unsupported.adapt(body)
    assert warnings == [
        "the endpoint does not support response_format json_schema: replaced by json_object "
        "from now on (no)",
        "the endpoint does not support response_format json_object: omitted from now on (no)",
    ]


def test_an_endpoint_without_json_objects_may_support_schemas() -> None:
    unsupported = UnsupportedParameters(lambda _line: None)
    assert unsupported.learn(
        ErrorResponse(400, "'response_format.type' must be 'json_schema'"), FULL, ""
    )
    assert "response_format" not in unsupported.adapt(FULL)
    body = request_body(ask(response_format=JsonSchema(name="x", content={})), "m")
    assert unsupported.adapt(body)["response_format"] == body["response_format"]


TOOL = Tool(name="check", description="Check a machine.", parameters={"type": "object"})
WITH_TOOLS = ask().model_copy(update={"tools": (TOOL,)})
NO_TOOLS = [
    (400, "registry.ollama.ai/library/gemma2:2b does not support tools", ""),
    (404, "No endpoints found that support tool use. To learn more about routing, visit: x", ""),
    (400, "Tools is not supported in this model. For a list of supported models, refer to x", ""),
    (400, "Unsupported parameter: 'tools' is not supported with this model.", "tools"),
    (
        400,
        '"auto" tool choice requires --enable-auto-tool-choice and --tool-call-parser to be set',
        "",
    ),
    (500, "tools param requires --jinja flag", ""),
    (500, "Unsupported param: tools", ""),
    (400, "Function calling is not enabled for this model", ""),
    (400, "m does not support Function Calling", ""),
    (400, "This model doesn't support tool use.", ""),
    (422, EXTRA % "tools", ""),
    (
        400,
        "litellm.UnsupportedParamsError: o does not support parameters: ['tools'], for model=m",
        "",
    ),
    (501, "not implemented", "tools"),
]


@pytest.mark.parametrize(("status", "message", "param"), NO_TOOLS)
async def test_a_refusal_of_tools_is_one_sentence(status: int, message: str, param: str) -> None:
    refusal = body({"error": {"message": message, "param": param or None}}, status)
    async with serving(refusal) as server:
        client = client_for(server.base_url)
        with pytest.raises(RefusedError) as caught:
            await client.complete(WITH_TOOLS)
        await client.aclose()
        assert len(server.asked) == 1
    assert caught.value.exit_status == 4
    assert str(caught.value) == (
        f"model 'm' at {server.base_url} does not support tools ({status}: {message}); switch on "
        "tool calling at the server, or use another model, or a workflow without tools"
    )


@pytest.mark.parametrize(
    ("status", "message"),
    [
        (400, "Invalid schema for function 'check': 'additionalProperties' is not permitted"),
        (400, "Invalid 'tools[0].function.name': unexpected character"),
        (400, "This model does not support images"),
        (429, "tools are not available at this rate"),
    ],
)
def test_other_errors_are_not_taken_for_a_refusal_of_tools(status: int, message: str) -> None:
    assert not refuses_tools(ErrorResponse(status, message))


async def test_without_a_choice_of_tools_the_request_is_made_again() -> None:
    refusal = body({"error": {"message": "m does not support this tool_choice"}}, 400)
    request = WITH_TOOLS.model_copy(update={"tool_choice": NamedTool(name="check")})
    warnings: list[str] = []
    async with serving(refusal, reply("ok")) as server:
        client = client_for(server.base_url, warn=warnings.append)
        assert (await client.complete(request)).text == "ok"
        await client.aclose()
    assert "tool_choice" not in server.asked[1].body
    assert server.asked[1].body["tools"] == server.asked[0].body["tools"]
    assert warnings == [
        "the endpoint does not support tool_choice: omitted from now on "
        "(m does not support this tool_choice)"
    ]


async def test_tools_without_streaming() -> None:
    message = "This model doesn't support tool use in streaming mode."
    async with serving(body({"message": message}, 400), reply("ok")) as server:
        client = client_for(server.base_url)
        assert (await client.complete(WITH_TOOLS)).text == "ok"
        await client.aclose()
    assert "stream" not in server.asked[1].body


SEEN = (("system", ()), ("user", ("data:image/png;base64,AAAA",)))
NO_IMAGES = [
    (400, "Invalid content type. image_url is only supported by certain models."),
    (400, "qwen3 is not a multimodal model"),
    (400, "At most 0 image(s) may be provided in one request."),
    (500, "image input is not supported - hint: you may need to provide the mmproj"),
    (404, "No endpoints found that support image input"),
    (422, "messages[1]: unknown variant `image_url`, expected `text`"),
    (400, "'messages.1' : content must be a string"),
    (400, "This model does not support images"),
]


@pytest.mark.parametrize(("status", "message"), NO_IMAGES)
async def test_a_refusal_of_pictures_says_what_to_change(status: int, message: str) -> None:
    system, user = (Message(role=role, text="x", images=images) for role, images in SEEN)
    async with serving(body({"error": {"message": message}}, status)) as server:
        client = client_for(server.base_url)
        with pytest.raises(RefusedError, match=r"takes no pictures .* leave out the sketch"):
            await client.complete(ask().model_copy(update={"messages": (system, user)}))
        await client.aclose()
        assert len(server.asked) == 1


def test_other_errors_are_not_taken_for_a_refusal_of_pictures() -> None:
    assert not refuses_images(ErrorResponse(400, "image too large: at most 5 MB"))
    assert not refuses_images(ErrorResponse(429, "images are not available at this rate"))
    assert not refuses_images(ErrorResponse(400, "seed is not supported"))
