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
        if option in renamed:
            notes.append((option, renamed[option]))
            option = renamed[option]
            words[i] = option + equals + value
        if not equals and i + 1 < end and (option, words[i + 1]) in CHOICES:
            choice = CHOICES[option, words[i + 1]]
            notes.append((f"{option} {words[i + 1]}", f"{option} {choice}"))
            words[i + 1] = choice
        if equals and (option, value) in CHOICES:
            choice = CHOICES[option, value]
            notes.append((f"{option} {value}", f"{option} {choice}"))
            words[i] = f"{option}={choice}"
    return words, notes
