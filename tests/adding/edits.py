"""What an addition of each kind touches: new files, which `additions` holds, and edits of files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

ADDITIONS = Path(__file__).parent / "additions"
Edit = tuple[str, str]
"""A text that the file holds once, and what is to stand in its place."""

KITE = """,
    {"type": 24, "name": "Kite", "category": "Structure", "set": "extended",
     "size_xyz": [1, 1, 1], "mass": 0.5, "flags": ["non_static"], "kite": 20.0, "faces": []}
  ]
}
"""
JUDGEMENT = '''

@dataclass(frozen=True)
class JudgementEvent(RunEvent, kind="judgement"):
    """A machine was judged; at the location of the call."""

    text: str


def read_typed_events('''
SHOW_SIZE = '''def show_size(found: Data) -> None:
    """Print the number of blocks of a machine."""
    print(f"{found['blocks']} blocks")


def show_result('''
PIE = """/** One disc; its area is the number. */
export function discChart(title, number) {
  return figure(title, () => [svg("circle", { class: "disc", r: Math.sqrt(number) })]);
}

/** Scores as dots"""
MECHANISM = """  - name: strolling frame
    purpose: stroll
    idea: A frame that strolls.
    parts: [Frame]
  - name: frame
    purpose: stand"""
MIDDLE = '''def middle(rewards: npt.ArrayLike) -> Floats:
    """Reward less the median of the group."""
    return _transform_scored(rewards, lambda scored: np.asarray(scored - np.median(scored)))


@dataclass(frozen=True)
class Advantage:'''

EDITS: Mapping[str, tuple[Edit, ...]] = {
    "agentflow/env/tasks/registry.py": (('"rocket",', '"rocket",\n            "strolling",'),),
    "agentflow/llm/procedural/mechanisms.yaml": (
        ("purposes: {", "purposes: {stroll: strolls, "),
        ("  - name: frame\n    purpose: stand", MECHANISM),
    ),
    "agentflow/machine/blocks/blocks.json": (("\n  ]\n}\n", KITE),),
    "agentflow/env/constants.json": (('"87": 0.9}', '"87": 0.9, "24": 0.5}'),),
    "agentflow/prompts/facts.yaml": (
        ("\n  41: [7500, 2500]", "\n  24: [15000, 5000]\n  41: [7500, 2500]"),
    ),
    "agentflow/prompts/block_functions.yaml": (
        ("\n1: rigid", "\n24: kite; it is pulled to x+\n1: rigid"),
    ),
    "agentflow/machine/blocks/types.py": (
        (
            '    """A flame that always burns; None for other blocks."""\n',
            '    """A flame that always burns; None for other blocks."""\n'
            "    kite: float | None = field(default=None, repr=False)\n"
            '    """Pull of a kite, N; None for other blocks."""\n',
        ),
    ),
    "agentflow/env/physics/assembly/devices.py": (
        ("(PropellerBlade,)", "(PropellerBlade, Kite)"),
        (
            "from agentflow.env.physics.laws.motion",
            "from agentflow.env.physics.laws.gliding import Kite\n"
            "from agentflow.env.physics.laws.motion",
        ),
    ),
    "agentflow/agents/registry.py": (
        ('        "agent":', '        "judge": "agentflow.agents.judge:Judge",\n        "agent":'),
    ),
    "agentflow/prompts/registry.py": (
        (
            '        "no_geometry"',
            '        "loud": "agentflow.prompts.loud",\n        "no_geometry"',
        ),
    ),
    "agentflow/search/registry.py": (
        ('        "random"', '        "eager": "agentflow.search.eager:eager",\n        "random"'),
    ),
    "agentflow/workflows/registry.py": (
        (
            '        "tools"',
            '        "judged": "agentflow.workflows.judged:JUDGED",\n        "tools"',
        ),
    ),
    "agentflow/tools/bench.py": (
        (
            "import designing, exploring, measuring",
            "import designing, exploring, measuring, weighing",
        ),
        (
            "    BenchTool.of(measuring.simulate",
            "    BenchTool.of(weighing.weigh),\n    BenchTool.of(measuring.simulate",
        ),
    ),
    "agentflow/training/objectives/functions.py": (
        ("import handling, travelling", "import handling, resting, travelling"),
        ('        "moves":', '        "rests": resting.Rests,\n        "moves":'),
    ),
    "agentflow/env/physics/registry.py": (
        (
            '        "mujoco"',
            '        "tick": "agentflow.env.physics.tick:TICK",\n        "mujoco"',
        ),
    ),
    "agentflow/metrics/cells.py": (
        (
            '        "std": Metric(',
            '        "run_count": Metric(lambda cell: len(cell.runs), "number of runs"),\n'
            '        "std": Metric(',
        ),
    ),
    "agentflow/training/advantages.py": (
        ("@dataclass(frozen=True)\nclass Advantage:", MIDDLE),
        (
            '        "best": Advantage',
            '        "middle": Advantage(middle),\n        "best": Advantage',
        ),
    ),
    "agentflow/app/pages/registry.py": (
        (
            '        "sweep":',
            '        "plain": "agentflow.app.pages.plain:plain_report",\n        "sweep":',
        ),
    ),
    "agentflow/report/web/main.js": (
        ("import { runPage }", 'import { plainPage } from "./plain.js";\nimport { runPage }'),
        ("const PAGES = { ", "const PAGES = { plain: plainPage, "),
    ),
    "agentflow/report/web/charts.js": (("/** Scores as dots", PIE),),
    "agentflow/report/sweep.py": (
        ('        "kind": "sweep",', '        "kind": "sweep",\n        "many": len(runs),'),
    ),
    "agentflow/report/web/sweep.js": (
        ("import { intervalChart", "import { discChart, intervalChart"),
        (
            "      data.spreads.length ?",
            '      discChart("Runs", data.many),\n      data.spreads.length ?',
        ),
    ),
    "agentflow/runs/events.py": (("\n\ndef read_typed_events(", JUDGEMENT),),
    "agentflow/runs/record.py": (
        (
            "        elif isinstance(event, kinds.RemarkEvent):",
            "        elif isinstance(event, kinds.JudgementEvent):\n"
            "            self.remarks.append(event.text)\n"
            "        elif isinstance(event, kinds.RemarkEvent):",
        ),
    ),
    "agentflow/cli/display/show_runs.py": (("def show_result(", SHOW_SIZE),),
    "agentflow/cli/__init__.py": (('    "tasks",\n', '    "size",\n    "tasks",\n'),),
}
"""File of the package -> edits that register new parts, or add what has no file of its own."""

TOUCHED: Mapping[str, tuple[str, ...]] = {
    "Task family": (
        "env/tasks/families/strolling.py",
        "env/tasks/registry.py",
        "env/tasks/templates/strolling.j2",
        "env/tasks/levels/strolling-1.yaml",
        "llm/procedural/mechanisms.yaml",
    ),
    "Block type": (
        "machine/blocks/blocks.json",
        "env/constants.json",
        "prompts/facts.yaml",
        "prompts/block_functions.yaml",
    ),
    "Block behaviour": (
        "machine/blocks/types.py",
        "env/physics/laws/gliding.py",
        "env/physics/assembly/devices.py",
    ),
    "Role": (
        "agents/judge.py",
        "llm/procedural/judging.py",
        "agents/registry.py",
        "prompts/default/judge/system.j2",
        "prompts/default/judge/user.j2",
    ),
    "Prompt set": ("prompts/loud/set.yaml", "prompts/loud/judge/system.j2", "prompts/registry.py"),
    "Search strategy": ("search/eager.py", "search/registry.py"),
    "Workflow": ("workflows/judged.py", "workflows/registry.py"),
    "Tool": ("tools/weighing.py", "tools/bench.py"),
    "Function test": ("training/objectives/resting.py", "training/objectives/functions.py"),
    "Physics engine": (
        "env/physics/tick/engine.py",
        "env/physics/tick/__init__.py",
        "env/physics/registry.py",
    ),
    "Metric": ("metrics/cells.py",),
    "Advantage": ("training/advantages.py",),
    "Page": (
        "app/pages/plain.py",
        "app/pages/registry.py",
        "report/web/plain.js",
        "report/web/main.js",
    ),
    "Chart": ("report/web/charts.js", "report/sweep.py", "report/web/sweep.js"),
    "Kind of event": ("runs/events.py", "runs/record.py"),
    "Command": (
        "app/inspect/sizes.py",
        "cli/display/show_runs.py",
        "cli/commands/size.py",
        "cli/__init__.py",
    ),
    "Adapter": ("integrations/blackbox.py",),
    "Model client": (),
}
"""Entry of "To add something" -> files of the package that adding one touches, in that order."""
