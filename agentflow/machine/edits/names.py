"""The names that a script gives to the blocks it adds."""

from __future__ import annotations

import re
from collections.abc import Sequence

from agentflow.machine.edits.commands import Add, Command
from agentflow.machine.problems import comma_list

MAX_LENGTH = 32
"""Most characters of a name."""
_WORDS = frozenset({"add", "remove", "move", "to", "in", "as"})
"""Words of the commands, which cannot be names."""
_EXAMPLE = "Add 63 to 3 in 0 as a"


class Refused(Exception):
    """A command that cannot be applied: a code for counting, and one sentence for models."""

    def __init__(self, code: str, reason: str) -> None:
        super().__init__(reason)
        self.code, self.reason = code, reason


class Names:
    """Name -> id of the blocks that the script has named so far."""

    def __init__(self, commands: Sequence[Command | None]) -> None:
        """Take all commands of the script, to tell names of later lines from unknown ones."""
        self.given: dict[str, int] = {}
        self._all = {command.name for command in commands if isinstance(command, Add)} - {""}

    def give(self, name: str, block_id: int) -> None:
        """Name a block; raise `Refused` if the name is not allowed or taken."""
        if re.fullmatch(r"[+-]?[\d.]+", name):
            better = "b" + re.sub(r"\D", "", name)
            reason = f"the name {name} looks like an id; give it a letter, as in 'as {better}'"
            raise Refused("bad_name", reason)
        if name in _WORDS:
            raise Refused("bad_name", f"{name} is a word of the commands; choose another name")
        if not re.fullmatch(r"[a-z0-9_]+", name) or len(name) > MAX_LENGTH:
            rule = f"at most {MAX_LENGTH} letters, digits and underscores"
            raise Refused("bad_name", f"the name {name} is not allowed; use {rule}")
        if name in self.given:
            taken = f"the name {name} is already taken by new block {self.given[name]}"
            raise Refused("name_taken", f"{taken}; choose another name")
        self.given[name] = block_id

    def find(self, name: str) -> int:
        """The id of the block with a name; raise `Refused` if there is none."""
        if name in self.given:
            return self.given[name]
        if name in self._all:
            reason = f"the name {name} is given only in a later line; move that line up"
            raise Refused("name_not_yet_given", reason)
        if not self._all:
            reason = f"no block has the name {name}; use an id, or give the name: '{_EXAMPLE}'"
            raise Refused("unknown_name", reason)
        known = comma_list(sorted(self._all))
        raise Refused("unknown_name", f"no block has the name {name}; the names are: {known}")

    def name_of(self, block_id: int) -> str:
        """The name of a block; "" if it has none."""
        return next((name for name, id_ in self.given.items() if id_ == block_id), "")
