"""Commands, options and choices under their earlier names, which this version still reads."""

from collections.abc import Sequence

COMMANDS = {("perturb",): ("robustness",), ("diagnose", "fate"): ("diagnose", "outcome")}
"""First words of a command line -> the words now."""
OPTIONS = {
    ("prompts", "show"): {"--set": "--prompt-set"},
    ("mcp",): {"--looks": "--max-pictures"},
    (): {"--on": "--backend"},
}
"""First words of a command line, none for any -> option -> the option now."""
CHOICES = {("--show", "players"): "human", ("--keep-rollouts", "winners"): "best"}
"""Option and value -> the value now."""


def update_arguments(given: Sequence[str]) -> tuple[list[str], list[tuple[str, str]]]:
    """A command line under today's names, and which names were earlier ones, with those of today.

    Options may be written as `--name value` or `--name=value`; what follows `--` is left alone.
    """
    words, notes = list(given), []
    for earlier, now in COMMANDS.items():
        if tuple(words[: len(earlier)]) == earlier:
            words[: len(earlier)] = now
            notes.append((" ".join(earlier), " ".join(now)))
    end = words.index("--") if "--" in words else len(words)
    renamed = {
        option: now
        for command, options in OPTIONS.items()
        if tuple(words[: len(command)]) == command
        for option, now in options.items()
    }
    for i, word in enumerate(words[:end]):
        option, equals, value = word.partition("=")
        if name := renamed.get(option):
            notes.append((option, name))
            option, words[i] = name, name + equals + value
        place = i if equals else i + 1
        value = value if equals else "".join(words[place : min(place + 1, end)])
        if choice := CHOICES.get((option, value)):
            notes.append((f"{option} {value}", f"{option} {choice}"))
            words[place] = f"{option}={choice}" if equals else choice
    return words, notes
