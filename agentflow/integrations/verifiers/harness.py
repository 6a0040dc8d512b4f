"""How a model is asked for a reply."""

from typing import Any

import verifiers.v1 as vf
from openai import AsyncOpenAI
from verifiers.v1.dialects.chat import message_to_wire


class ReplyHarness(vf.Harness[vf.HarnessConfig]):
    """Asks the model once, in this process: a reply needs no program and no sandbox."""

    APPENDS_SYSTEM_PROMPT = True
    EXECUTES_CODE = False
    NEEDS_CONTAINER = False

    async def launch(
        self,
        ctx: vf.ModelContext,
        trace: vf.Trace,  # noqa: ARG002
        runtime: vf.Runtime,  # noqa: ARG002
        endpoint: str,
        secret: str,
        mcp_urls: dict[str, str],  # noqa: ARG002
        data: vf.TaskData,
    ) -> vf.ProgramResult:
        """Send the prompt to verifiers' endpoint, which records and forwards it."""
        system, prompt = self.resolve_text_prompt(data)
        told = [vf.SystemMessage(content=system or ""), vf.UserMessage(content=prompt or "")]
        messages: Any = [message_to_wire(message) for message in told]
        async with AsyncOpenAI(base_url=endpoint, api_key=secret, max_retries=0) as client:
            await client.chat.completions.create(model=ctx.model, messages=messages)
        return vf.ProgramResult(0, "", "")
