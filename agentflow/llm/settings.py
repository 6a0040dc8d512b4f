"""Owns how an endpoint is asked, as it is written down: waits, repetitions, limits.

Apart from what is done with it, so that a configuration is read without what speaks HTTP.
"""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field


class HttpSettings(BaseModel):
    """How long to wait for an endpoint."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    connect_s: float = Field(default=10.0, gt=0)
    """Longest wait for a connection."""
    idle_s: float = Field(default=300.0, gt=0)
    """Longest silence inside an answer; servers that do not stream are silent until it is ready."""
    total_s: float = Field(default=1800.0, gt=0)
    """Longest duration of one attempt, against servers that trickle for ever."""


class RetrySettings(BaseModel):
    """Exponential back-off with full jitter: a wait is uniform in [0, min(cap, base * 2^n)]."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    attempts: int = Field(default=6, ge=1)
    """Most attempts per call, the first one included."""
    base_s: float = Field(default=0.5, ge=0)
    cap_s: float = Field(default=30.0, ge=0)
    retry_after_cap_s: float = Field(default=120.0, ge=0)
    """A server that asks for a longer wait than this gets this one."""


class LimitSettings(BaseModel):
    """Limits of one endpoint over the whole run; None is no limit."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    concurrent: int | None = Field(default=None, ge=1)
    """Most calls in flight."""
    rpm: int | None = Field(default=None, ge=1)
    """Most calls begun per minute."""
    tpm: int | None = Field(default=None, ge=1)
    """Most tokens (prompt and completion) per minute, estimated before a call, true after it."""


class EndpointSettings(BaseModel):
    """How an endpoint is asked; none of it changes an answer."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    http: HttpSettings = HttpSettings()
    retry: RetrySettings = RetrySettings()
    limits: LimitSettings = LimitSettings()
