"""The machine language: construction trees, geometry, validity, edits, descriptions.

Needs no physics engine and no model: reading, checking or editing a machine takes well under a
millisecond.
"""

from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import BlockType
from agentflow.machine.brief import Brief
from agentflow.machine.description.geometry_info import describe, describe_text
from agentflow.machine.edits.script import StepVerdict, apply_script
from agentflow.machine.formats.json_text import extract_json
from agentflow.machine.formats.parse import read_machine
from agentflow.machine.geometry.placement import AutoConnection, Geometry, place
from agentflow.machine.problems import Problem
from agentflow.machine.tree import ROOT, Machine, Step
from agentflow.machine.validity import Report, check, spatial_problems

__all__ = [
    "ROOT",
    "AutoConnection",
    "BlockType",
    "Brief",
    "Geometry",
    "Machine",
    "Problem",
    "Report",
    "Step",
    "StepVerdict",
    "apply_script",
    "check",
    "describe",
    "describe_text",
    "extract_json",
    "library",
    "place",
    "read_machine",
    "spatial_problems",
]
