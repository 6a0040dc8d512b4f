"""Things as HTML for the cells of notebooks: self-contained, and with text only as text."""

import asyncio
from collections.abc import Callable, Collection, Coroutine, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import singledispatch
from html import escape
from typing import Any, TypeVar

from agentflow.app.pages.films import Shapes, machine_data
from agentflow.app.pages.runs import run_page
from agentflow.app.tasks import TaskInfo
from agentflow.env.drawing.stills import png, png_url
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.variations import DEFAULT
from agentflow.env.verification import Verification
from agentflow.errors import UsageError
from agentflow.machine import Machine, Report
from agentflow.machine.brief import LONE_ROOT
from agentflow.metrics.tables import cell_text, counted
from agentflow.notebook.recorded import Run, Sweep
from agentflow.progress import silent
from agentflow.report.page import page

Row = Sequence[object]
_Found = TypeVar("_Found")
PICTURE = (480, 360)
"""Width and height of pictures, pixels."""
TALL = {"cell": 460, "run": 860}
"""Kind of page -> height of its frame, pixels."""
BAR = 160
"""Width of the widest bar, pixels."""


@singledispatch
def to_html(shown: object) -> str:
    """Something as HTML that notebooks can show; text by default."""
    return f"<pre>{escape(repr(shown))}</pre>"


def to_png(machine: Machine) -> bytes:
    """The picture of a machine, for places that show no HTML."""
    return png(machine, view="three-quarter", size=PICTURE)


@to_html.register
def _machine(machine: Machine) -> str:
    """The 3D viewer of reports with the machine as built."""
    blocks = counted(len(machine), "block")
    return _viewer(machine, None, f"{blocks}, {machine.digest}")


@to_html.register
def _report(report: Report) -> str:
    """The problems of a machine, and its picture with the blocks that overlap in red."""
    if report.machine is None:
        picture = ""
    else:
        red = {block for pair in report.overlaps for block in pair}
        picture = _picture(report.machine, red)
    whole = "valid" if report.task_valid else counted(len(report.problems), "problem")
    items = [("problem", item) for item in report.problems]
    items += [("warning", item) for item in report.warnings]
    rows = [(what, item.code, item.message) for what, item in items]
    return f"<p><b>{whole}</b></p>{_table(('', 'kind', 'message'), rows)}{picture}"


@to_html.register
def _rollout(rollout: Rollout) -> str:
    """The film with loads and events, the score and its terms."""
    title = f"{rollout.status}, score {cell_text(rollout.score)}"
    terms = _table(("term", "value"), [(k, cell_text(v)) for k, v in rollout.terms.items()])
    if rollout.machine is None or rollout.trace is None:
        return f"<p><b>{title}</b></p><p>{escape(rollout.feedback.text)}</p>{terms}"
    return _viewer(rollout.machine, rollout, title) + _folded("Terms of the score", terms)


@to_html.register
def _verification(found: Verification) -> str:
    """The score in every simulation, as bars beside the median."""
    scores = {name: rollout.score for name, rollout in found.rollouts.items()}
    most = max((abs(score) for score in scores.values() if score is not None), default=0.0) or 1.0
    fails = found.holding.fails if found.holding else ()
    rows = [
        (
            "default conditions" if name == DEFAULT.name else name,
            cell_text(score) if score is not None else found.rollouts[name].status,
            _Markup(_bar((score or 0.0) / most, name in fails)),
        )
        for name, score in scores.items()
    ]
    spread = (
        "incomplete"
        if found.score is None
        else f"verified score {cell_text(found.score)}, from {cell_text(found.low)} to "
        f"{cell_text(found.high)}; {found.holding}"
    )
    return f"<p><b>{escape(spread)}</b></p>{_table(('simulation', 'score', ''), rows)}"


@to_html.register
def _run(run: Run) -> str:
    """The page of the run: its tree, curve, conversations, and machines as built."""
    try:
        title, data = _wait(run_page(run.path, films=0, workers=1, say=silent))
        for machine in data["machines"].values():
            machine["remark"] = "Shown as built; agentflow report makes films."
        return _frame("run", title, data)
    except UsageError as error:
        return f"<p>{escape(repr(run))}: {escape(str(error))}</p>"


@to_html.register
def _sweep(sweep: Sweep) -> str:
    """What each condition reached."""
    rows = sweep.summary_rows()
    heads = list(rows[0]) if rows else ["condition"]
    cells = [[cell_text(value) for value in row.values()] for row in rows]
    return f"<p><b>{escape(repr(sweep))}</b></p>{_table(heads, cells)}"


@to_html.register
def _task(task: TaskInfo) -> str:
    """What designers read, and the knobs."""
    parts = [task.objective, *task.scene, *task.schedule, *task.score]
    text = "".join(f"<li>{escape(part)}</li>" for part in parts)
    knobs = _table(
        ("knob", "value", "range", ""), [(k.name, k.value, k.range, k.help) for k in task.knobs]
    )
    title = f"{task.name}: {task.title}; good score {task.good:g}"
    return f"<p><b>{escape(title)}</b></p><ul>{text}</ul>{_folded('Knobs', knobs)}"


def design_html(found: Any) -> str:
    """The best machine of a design, and what is known of it."""
    verified = "" if found.verified is None else f", verified {cell_text(found.verified)}"
    title = f"score {cell_text(found.score)}{verified}{', fragile' * bool(found.fragile)}"
    below = f"<p><code>{escape(str(found.run))}</code></p>"
    if found.machine is None:
        return f"<p><b>{escape(str(found.data.get('reason') or 'no valid machine'))}</b></p>{below}"
    return _viewer(found.machine, None, title) + below


def _viewer(machine: Machine, rollout: Rollout | None, title: str) -> str:
    """The 3D viewer, or a picture where the viewer is not installed."""
    shapes = Shapes()
    shown = machine_data(machine, rollout, shapes, given=LONE_ROOT)
    data = {"kind": "cell", "title": title, "machine": shown, **shapes.data}
    try:
        return _frame("cell", title, data)
    except UsageError as error:
        return f"<p><b>{escape(title)}</b></p>{_picture(machine)}<p>{escape(str(error))}</p>"


def _frame(kind: str, title: str, data: Mapping[str, Any]) -> str:
    """A page inside a cell. It may run its own script and nothing else of the notebook."""
    content = escape(page(title, data), quote=True)
    return (
        f'<iframe srcdoc="{content}" sandbox="allow-scripts allow-downloads" '
        f'title="{escape(title, quote=True)}" loading="lazy" '
        f'style="width: 100%; height: {TALL[kind]}px; border: 1px solid #8884"></iframe>'
    )


def _picture(machine: Machine, red: Collection[int] = ()) -> str:
    url = png_url(machine, view="three-quarter", size=PICTURE, red=red)
    words = counted(len(machine), "block")
    return f'<img src="{url}" alt="Machine of {words}" width="{PICTURE[0]}">'


class _Markup(str):
    """HTML that is inserted as it is."""


def _table(heads: Sequence[str], rows: Sequence[Row]) -> str:
    if not rows:
        return ""

    def line(cells: Sequence[object], tag: str) -> str:
        texts = (cell if isinstance(cell, _Markup) else escape(str(cell)) for cell in cells)
        parts = (f'<{tag} style="text-align: left">{text}</{tag}>' for text in texts)
        return f"<tr>{''.join(parts)}</tr>"

    body = "".join(line(row, "td") for row in rows)
    return f"<table><thead>{line(heads, 'th')}</thead><tbody>{body}</tbody></table>"


def _folded(title: str, content: str) -> str:
    return f"<details><summary>{escape(title)}</summary>{content}</details>" if content else ""


def _bar(share: float, fails: bool) -> str:
    """A bar as wide as a share of 1; hatched, and said in words, where the score does not hold."""
    wide = max(1, round(BAR * abs(share)))
    fill = (
        "repeating-linear-gradient(45deg, #D55E00 0 3px, transparent 3px 6px)"
        if fails
        else "#0072B2"
    )
    note = " does not hold" if fails else ""
    return (
        f'<span style="display: inline-block; width: {wide}px; height: 0.8em; '
        f'background: {fill}"></span>{note}'
    )


def _wait(work: Coroutine[Any, Any, _Found]) -> _Found:
    """The result of a coroutine, also where an event loop runs, as in notebooks."""
    start: Callable[[Coroutine[Any, Any, _Found]], _Found] = asyncio.run
    with ThreadPoolExecutor(1) as threads:
        return threads.submit(start, work).result()
