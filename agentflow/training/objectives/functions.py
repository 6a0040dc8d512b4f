"""The function tests by the names that files of objectives use, and how they are read."""

from collections.abc import Mapping
from types import MappingProxyType

from pydantic import ValidationError

from agentflow.files.faults import describe_fault, first_fault
from agentflow.training.objectives import handling, travelling
from agentflow.training.objectives.measuring import FunctionTest

FUNCTIONS: Mapping[str, type[FunctionTest]] = MappingProxyType(
    {
        "moves": travelling.Moves,
        "reaches": travelling.Reaches,
        "stays upright": travelling.StaysUpright,
        "stays whole": travelling.StaysWhole,
        "turns": travelling.Turns,
        "spins": travelling.Spins,
        "jumps": travelling.Jumps,
        "unfolds": travelling.Unfolds,
        "throws": handling.Throws,
        "hits target": handling.HitsTarget,
        "passes rings": handling.PassesRings,
        "raises": handling.Raises,
        "holds": handling.Holds,
        "shifts": handling.Shifts,
        "strikes": handling.Strikes,
        "avoids": handling.Avoids,
        "carries": handling.Carries,
    }
)


def read_test(name: str, thresholds: object) -> FunctionTest:
    """One function test.

    Raises:
        ValueError: There is no such test or threshold, or a value is wrong; says what to change.
    """
    if name not in FUNCTIONS:
        raise ValueError(f"there is no function test {name!r}; known: {', '.join(FUNCTIONS)}")
    kind = FUNCTIONS[name]
    try:
        return kind.model_validate({} if thresholds is None else thresholds)
    except ValidationError as error:
        fault = first_fault(error)
        key = ".".join(str(part) for part in (name, *fault["loc"]))
        if fault["type"] == "extra_forbidden":
            known = ", ".join(kind.model_fields) or "none"
            raise ValueError(f"{key} is not a threshold; known: {known}") from None
        raise ValueError(f"{key}: {describe_fault(fault)}") from None
