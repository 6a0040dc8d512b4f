"""Growing lists, such as the messages of a conversation, of which a file holds every item once."""

from collections.abc import Sequence
from typing import Generic, TypeVar

_T = TypeVar("_T")


class Chains(Generic[_T]):
    """The lists so far, by key. A list that continues another one takes its place; one that only
    begins as another one leaves it there."""

    def __init__(self) -> None:
        self._lists: dict[str, tuple[_T, ...]] = {}

    def add(self, key: str, items: Sequence[_T]) -> None:
        """Remember a list, which others may continue."""
        self._lists[key] = tuple(items)

    def longest(self, items: Sequence[_T]) -> tuple[str, int]:
        """The list that begins like this one for longest, and how many items they share; ("", 0)
        without one."""
        best, most = "", 0
        for key, known in self._lists.items():
            pairs = enumerate(zip(known, items, strict=False))
            least = min(len(known), len(items))
            shared = next((i for i, (one, other) in pairs if one != other), least)
            if shared > most:
                best, most = key, shared
        return best, most

    def whole(self, after: str, shared: int, items: Sequence[_T]) -> tuple[_T, ...]:
        """A list from its own items and what it shares with the one that it continues.

        Raises:
            ValueError: There is no such list.
        """
        known = self._lists.get(after)
        if known is None or shared > len(known):
            raise ValueError("it continues a call that is not before it")
        whole = (*known[:shared], *items)
        if shared >= len(known) - 1 and len(whole) >= len(known):  # the last item may have changed
            del self._lists[after]
        return whole
