"""Turns the settings of the workflow `external` into a program and its environment."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path

from agentflow.errors import ConfigError
from agentflow.workflows.settings import ExternalSettings

_HARMLESS = """
    PATH HOME USER LOGNAME SHELL TERM LANG LANGUAGE TZ TMPDIR TEMP TMP
    XDG_CONFIG_HOME XDG_CACHE_HOME XDG_DATA_HOME XDG_STATE_HOME XDG_RUNTIME_DIR
    HTTP_PROXY HTTPS_PROXY ALL_PROXY http_proxy https_proxy all_proxy
    SSL_CERT_FILE SSL_CERT_DIR CURL_CA_BUNDLE REQUESTS_CA_BUNDLE NODE_EXTRA_CA_CERTS
    SYSTEMROOT SYSTEMDRIVE WINDIR COMSPEC PATHEXT USERNAME USERPROFILE HOMEDRIVE HOMEPATH
    APPDATA LOCALAPPDATA PROGRAMDATA PROGRAMFILES
"""
PASSED = frozenset(_HARMLESS.split())
"""Variables that every program gets, besides LC_*: what programs need to start, to find the files
of their user and to reach the network. No key is among them."""
NO_PROXY = ("NO_PROXY", "no_proxy")
LOOPBACK = "127.0.0.1"


def command_words(settings: ExternalSettings) -> list[str]:
    """The program, by its absolute path, and its arguments.

    Raises:
        ConfigError: There is none, it is not found, or it is not executable.
    """
    words = _split(settings)
    if not words:
        raise ConfigError(
            "external.command is empty, but the workflow external runs a program; name it, for "
            "example with --set external.command='claude -p'"
        )
    return [_find(words[0]), *words[1:]]


def _split(settings: ExternalSettings) -> list[str]:
    command = settings.command
    if settings.shell:
        if not isinstance(command, str):
            raise ConfigError("external.command: with external.shell, give one line, not a list")
        shell = ["cmd", "/c"] if sys.platform == "win32" else ["/bin/sh", "-c"]
        return [*shell, command] if command.strip() else []
    if not isinstance(command, str):
        return list(command)
    try:
        return shlex.split(command)
    except ValueError as error:
        raise ConfigError(
            f"external.command: {command!r} cannot be split into words: {error}; close the "
            "quotation, or give a list of words"
        ) from None


def _find(program: str) -> str:
    """The absolute path of a program."""
    found = shutil.which(program)
    if found is not None:
        return os.path.abspath(found)
    if os.path.dirname(program):
        if Path(program).is_file():
            raise ConfigError(
                f"external.command: {program} is not executable; run chmod +x on it, or "
                "put its interpreter before it"
            )
        raise ConfigError(f"external.command: there is no program {program}; check its path")
    raise ConfigError(
        f"external.command: no program {program!r} is on the PATH; install it, or give its path"
    )


def program_environment(
    settings: ExternalSettings, environ: Mapping[str, str], bench: Mapping[str, str]
) -> dict[str, str]:
    """The variables of a program: those in `PASSED`, those that the settings name, and `bench`.

    Raises:
        ConfigError: The settings name one that is not set.
    """
    for name in settings.variables:
        if name not in environ:
            raise ConfigError(
                f"external.variables names {name}, which is not set; set it, or remove the name"
            )
    passed = {
        name: value
        for name, value in environ.items()
        if name in PASSED or name.startswith("LC_") or name in settings.variables
    }
    around = [environ[name] for name in NO_PROXY if environ.get(name)][:1]
    direct = ",".join([*around, LOOPBACK])  # the bench is never behind a proxy
    return {**passed, **dict.fromkeys(NO_PROXY, direct), **bench}
