"""Whether training data hold what models are evaluated with: texts of levels, machines of runs."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from agentflow.diversity.topology import tree_hash
from agentflow.env.physics.registry import ENGINES
from agentflow.env.tasks.family import Family
from agentflow.env.tasks.records import read_records
from agentflow.env.tasks.registry import FAMILIES, get_level, get_task, task_names
from agentflow.errors import RunError
from agentflow.extras import needs_extra
from agentflow.machine import library, read_machine
from agentflow.runs import find_runs
from agentflow.runs.reading import MACHINES
from agentflow.training.evaluation.record import ABOUT, REPLIES, read_replies

WORDS = 4
"""Words of an n-gram: shorter ones, such as "as far as", are in many sentences."""
MOST_SHARED = 0.25
"""A text of which this share of n-grams, or more, is in a level's brief repeats it; so does a long
prompt that holds this share of the n-grams of a level's objective."""
MOST_SIMILAR = Family.similar
"""The same for the TF-IDF cosine of a text with a sentence of a brief, of families that have no
value of their own."""
_WORD = re.compile(r"[a-z0-9]+")


@dataclass(frozen=True)
class Likeness:
    """How near a text comes to the brief of a level."""

    level: str
    """The level that it is nearest to."""
    shared: float
    """Greatest share of its n-grams that are in the brief of one level, or of the n-grams of a
    level's objective that are in it."""
    cosine: float
    """TF-IDF cosine with the sentence of a brief that comes nearest to its family's limit."""

    @property
    def contaminated(self) -> bool:
        """Whether a model that learns from the text knows the level."""
        return self.shared >= MOST_SHARED or self.cosine >= _most_similar(self.level)


def compare_texts(texts: Mapping[str, str]) -> dict[str, Likeness]:
    """How near each text comes to the levels of all families.

    The words of TF-IDF are runs of 3 to 5 characters, so that "throws" is like "throw".

    Args:
        texts: By name.

    Raises:
        ConfigError: scikit-learn is not installed.
    """
    with needs_extra("diversity"):
        from sklearn.feature_extraction.text import TfidfVectorizer

    briefs = _briefs()
    sentences = [(level, text) for level, told in briefs.items() for text in told]
    vectorizer = TfidfVectorizer(analyzer="char_wb", ngram_range=(3, 5), sublinear_tf=True)
    known = vectorizer.fit_transform([text for _, text in sentences])
    cosines = (vectorizer.transform(texts.values()) @ known.T).toarray()
    limits = [_most_similar(level) for level, _ in sentences]
    grams = {level: set(_ngrams(" ".join(told))) for level, told in briefs.items()}
    asked = {level: _ngrams(told[0]) for level, told in briefs.items()}
    found = {}
    for (name, text), row in zip(texts.items(), cosines, strict=True):
        own = _ngrams(text)
        shares = {
            level: max(_share(own, grams[level]), _share(asked[level], set(own)))
            for level in briefs
        }
        best, nearest = int((row / limits).argmax()), max(shares, key=shares.__getitem__)
        level = nearest if shares[nearest] >= MOST_SHARED else sentences[best][0]
        cosine = round(float(row[best]), 4)
        found[name] = Likeness(level, round(shares[nearest], 4), cosine)
    return found


def _most_similar(level: str) -> float:
    """The cosine from which on a text says the same as a sentence of a level's brief."""
    return FAMILIES[get_level(level).file.family].similar


def _briefs() -> dict[str, tuple[str, ...]]:
    """The sentences of each level's brief: what to do, then where, and how it is scored."""
    briefs = {name: get_task(name).brief for name in task_names()}
    return {name: (brief.objective, *brief.scene, *brief.score) for name, brief in briefs.items()}


def _ngrams(text: str) -> list[tuple[str, ...]]:
    words = _WORD.findall(text.lower())
    return [tuple(words[i : i + WORDS]) for i in range(len(words) - WORDS + 1)]


def _share(own: Sequence[tuple[str, ...]], theirs: set[tuple[str, ...]]) -> float:
    return sum(gram in theirs for gram in own) / max(1, len(own))


def evaluation_trees(folders: Iterable[Path]) -> frozenset[str]:
    """The trees of the machines in evaluations, and of the best known machine of every level.

    Args:
        folders: Run directories, evaluations of models, or folders that hold some.

    Raises:
        RunError: One holds neither, or a machine cannot be read.
    """
    trees = {one.tree for engine in ("", *ENGINES) for one in read_records(engine).values()}
    for folder in folders:
        runs, evaluations = list(find_runs(folder)), sorted(folder.rglob(ABOUT))
        if not runs and not evaluations:
            raise RunError(
                f"{folder} holds no runs and no evaluations: name a run directory, one of "
                "agentflow evaluate, or a folder with some"
            )
        files = [file for run in runs for file in (run / MACHINES).glob("[!.]*.json")]
        trees.update(_tree_in(file.read_bytes(), file) for file in files)
        for file in filter(Path.exists, (about.with_name(REPLIES) for about in evaluations)):
            machines = (reply.machine for reply in read_replies(file))
            trees.update(_tree_in(machine, file) for machine in machines if machine is not None)
    return frozenset(trees)


def _tree_in(content: object, file: Path) -> str:
    source = content.decode(errors="replace") if isinstance(content, bytes) else content
    machine = read_machine(source, tuple(library())).machine
    if machine is None:
        raise RunError(f"{file} is damaged: it holds no machine")
    return tree_hash(machine)
