"""The registry of prompt sets: packages that contain a set.yaml and templates."""

from types import ModuleType

from agentflow.registry import Registry, package_with

DEFAULT = "default"
"""Name of the set that has templates for every role of ours."""
ABOUT = "set.yaml"
"""Settings of a set: description (`about`), the set that provides missing templates (`base`), and
the token limit for system and user prompt together (`fits`)."""

PROMPT_SETS: Registry[ModuleType] = Registry(
    "prompt set",
    "agentflow.prompts",
    {
        "compact": "agentflow.prompts.compact",
        "default": "agentflow.prompts.default",
        "no_geometry": "agentflow.prompts.no_geometry",
        "no_motion": "agentflow.prompts.no_motion",
    },
    package_with(ABOUT),
)
