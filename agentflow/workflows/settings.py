"""Settings of workflows."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from agentflow.llm.messages import fix_surrogates
from agentflow.machine.blocks.library import library
from agentflow.machine.formats.parse import read_machine
from agentflow.machine.tree import Machine
from agentflow.search.settings import INDEPENDENT, SearchSettings

Emitter = Literal["edit", "crossover", "refiner"]
LONGEST_BRIEF = 8000
Objective = Literal["score", "robust", "pareto"]


class ExternalSettings(BaseModel, frozen=True, extra="forbid"):
    """The agent program of the workflow `external`, which each stage runs once.

    Attributes:
        command: Program and arguments: a list, or one line, split at blanks as in a shell.
        shell: Let a shell run the command, which must then be one line.
        limit_s: Seconds until the program is stopped.
        variables: More environment variables to pass to it, such as keys; it gets harmless ones,
            such as PATH, anyway.
        isolate: Run it under bubblewrap: where that works, always, or never.
        network: Let an isolated program use the network, not only the bench.
        readable: More files and folders that an isolated program can read.
    """

    command: str | tuple[str, ...] = ""
    shell: bool = False
    limit_s: float = Field(1800.0, gt=0, allow_inf_nan=False)
    variables: tuple[str, ...] = ()
    isolate: Literal["auto", "always", "never"] = "auto"
    network: bool = False
    readable: tuple[str, ...] = ()

    @field_validator("command", mode="before")
    @classmethod
    def _line_or_words(cls, value: object) -> object:
        """Refuse what is neither; YAML reads an empty command as nothing."""
        words = value if isinstance(value, list | tuple) else [value or ""]
        if not all(isinstance(word, str) for word in words):
            raise ValueError(f"expected one line, or a list of words, not {value!r}")
        return value or ""


class WorkflowSettings(BaseModel):
    """Switches of a workflow; all workflows share these keys, so that sweeps can compare them.

    Attributes:
        trajectories: Machines designed in parallel.
        placements: Independent attempts (placement, random-placement).
        candidates: Designs per structure and trajectory (hierarchical).
        meta_designer: What the plan says: structures (what each is for), detailed (how to build
            each, step by step), or off: no plan, whole machines (hierarchical).
        start: Construction tree of a machine to improve, in place of first designs.
        rationales: Plans for designers to follow, one per trajectory, repeated if too few.
        brief: The user's wishes for the machine, added to the task in every prompt.
        sketch: PNG file with the user's sketch, shown to meta-designer, designer and inspector; the
            run keeps a copy.
        drafts: Let designers send a draft, which is checked, before the machine that counts (one
            more call for each design).
        inspector: Criticise machines before the blind refinement.
        simulate_first: Show the blind refinement the simulation of its machine (no extra rollout).
        querier: Ask for states of single blocks (with feedback active).
        feedback: What refiners see of a simulation.
        history: Show refiners the earlier edits.
        spatial: Show designers and refiners 3D information.
        representation: How machines are written: construction tree, or absolute coordinates.
        vision: Show pictures of the machine to refiners, and to agents (tools).
        refinement: Refiners write edit commands or a whole machine.
        max_simulations: Simulations of a run; default: 3 per trajectory (random-dsl), 24 (tools),
            as many as the rounds of a search can need (explore, and searches over the whole run,
            such as halving); else no limit.
        emitters: What makes new machines from others: edit (random), crossover, refiner; default:
            edit and crossover, equally often (explore); refiner and edit, as the search decides
            (searches over the whole run).
        candidates_per_stage: Machines that an agent may submit in a stage (tools).
        max_pictures: Pictures that an agent may look at in a run (tools, with vision).
        tell_record: Tell agents the best known score of the task (tools, external).
        external: The agent program (external).
        local_trials: Single edits of a machine that are simulated before its refiner is asked, and
            told to it (hierarchical, iterative, single); 0: none.
        inspirations: Best machines of other trajectories that designers and refiners are shown,
            with score and mechanism (hierarchical, iterative, single).
        lessons: Show designers and refiners what edits in all trajectories did to the score, in at
            most 300 tokens (hierarchical, iterative, single).
        analyst: With lessons: let an analyst write them anew, from what edits did, whenever that
            has changed.
        novelty: Refuse machines that differ from simulated ones only in the numbers of their
            blocks, or are their mirror images; false: simulate them.
        finalists: Machines of a search over the whole run, the best by score, of which the one with
            the highest mean score in its verification is chosen; a machine whose score is no higher
            than that is not verified any more. 1: the highest score is chosen.
        models: Models at the run's endpoint, among which a search over the whole run chooses who
            designs and who refines next; default: the model of these roles.
        another_mechanism: When a search over the whole run prefers a new design to refining, ask
            for another mechanism than those found.
        known_lessons: Lessons of other runs that designers and refiners are shown; --lessons takes
            them from a book.
        objective: What makes a machine better: its score; its robust score; or pareto: score,
            robust score, number of blocks and mass. Robust scores take ten simulations of each
            machine.
        search: The feedback loop; 0 rounds skip it.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    trajectories: int = Field(8, ge=1)
    placements: int = Field(50, ge=1)
    candidates: int = Field(1, ge=1)
    meta_designer: Literal["structures", "detailed", "off"] = "structures"
    start: tuple[dict[str, int], ...] | dict[str, Any] = ()
    rationales: tuple[str, ...] = ()
    brief: str | None = None
    sketch: str | None = Field(None, min_length=1)
    drafts: bool = False
    inspector: bool = True
    simulate_first: bool = False
    querier: bool = True
    feedback: Literal["active", "basic", "score_only"] = "active"
    history: bool = True
    spatial: bool = True
    representation: Literal["tree", "coordinates"] = "tree"
    vision: bool = False
    refinement: Literal["steps", "whole_machine"] = "steps"
    max_simulations: int | None = Field(None, ge=1)
    emitters: tuple[Emitter, ...] = ()
    candidates_per_stage: int = Field(8, ge=1, le=10_000)
    max_pictures: int = Field(24, ge=1)
    tell_record: bool = False
    external: ExternalSettings = ExternalSettings()
    local_trials: int = Field(0, ge=0, le=1000)
    inspirations: int = Field(0, ge=0, le=10)
    lessons: bool = False
    analyst: bool = False
    novelty: bool = True
    finalists: int = Field(5, ge=1, le=100)
    models: tuple[Annotated[str, Field(min_length=1)], ...] = ()
    another_mechanism: bool = False
    known_lessons: tuple[str, ...] = ()
    objective: Objective = "score"
    search: SearchSettings = SearchSettings()

    @field_validator("meta_designer", mode="before")
    @classmethod
    def _off(cls, value: object) -> object:
        """Accept false, which is how YAML reads a bare `off`."""
        return "off" if value is False else value

    @field_validator("brief")
    @classmethod
    def _brief_is_short(cls, value: str | None) -> str | None:
        """Refuse an empty brief, and one that would fill a model's context."""
        if value is None:
            return None
        text = fix_surrogates(value).strip()
        if not 0 < len(text) <= LONGEST_BRIEF:
            raise ValueError(
                f"expected 1 to {LONGEST_BRIEF} characters about the machine, not {len(text)}"
            )
        return text

    @model_validator(mode="after")
    def _one_plan(self) -> WorkflowSettings:
        if self.start and self.rationales:
            raise ValueError("rationales guide first designs; a run with a start machine has none")
        return self

    @property
    def start_machine(self) -> Machine | None:
        """The machine to start from; None if designers make the first machines."""
        return read_machine(self.start_data, tuple(library())).machine if self.start else None

    @property
    def start_data(self) -> object:
        """The machine to start from as JSON data: its blocks, or an object with its controls."""
        return self.start if isinstance(self.start, dict) else list(self.start)

    @property
    def shows_elsewhere(self) -> bool:
        """Whether prompts may show what was learnt elsewhere."""
        shared = self.inspirations > 0 or self.lessons or self.another_mechanism
        return shared or bool(self.known_lessons)

    def rationale(self, trajectory: int) -> str:
        """The plan for the designers of a trajectory (1, 2, ...); "" for none."""
        plans = self.rationales
        return plans[(trajectory - 1) % len(plans)] if plans else ""

    @property
    def arms(self) -> tuple[Emitter, ...]:
        """Who makes new machines from others in a search that deals the budget of a whole run."""
        if self.search.strategy == INDEPENDENT:
            return ()
        return tuple(dict.fromkeys(self.emitters)) or ("refiner", "edit")

    @property
    def model_arms(self) -> tuple[str, ...]:
        """The models among which the search chooses; none unless it is over the whole run."""
        from agentflow.search.strategies import searches_whole_run  # loads asyncio

        return tuple(dict.fromkeys(self.models)) if searches_whole_run(self.search) else ()

    @property
    def asks_analyst(self) -> bool:
        """Whether an analyst writes the lessons that are shown."""
        return self.analyst and self.lessons

    @property
    def asks_querier(self) -> bool:
        """Whether to ask the querier: its answers reach the refiner only with active feedback."""
        return self.querier and self.feedback == "active"
