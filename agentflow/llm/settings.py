"""Settings of an endpoint: time-outs, retries, rate limits.

Kept apart from the client code: reading a configuration must not load httpx.
"""

from __future__ import annotations

from pydantic import BaseModel, Field


class HttpSettings(BaseModel, frozen=True, extra="forbid"):
    """Time-outs in seconds."""

    connect_s: float = Field(default=10.0, gt=0)
    """Time-out for connecting."""
    idle_s: float = Field(default=300.0, gt=0)
    """Maximum time without data; servers that do not stream send nothing until they are done."""
    total_s: float = Field(default=1800.0, gt=0)
    """Maximum duration of one attempt."""


class RetrySettings(BaseModel, frozen=True, extra="forbid"):
    """Exponential back-off with full jitter: waits are uniform in [0, min(cap, base * 2^n)]."""

    attempts: int = Field(default=6, ge=1)
    """Maximum number of attempts per call, including the first."""
    base_s: float = Field(default=0.5, ge=0)
    cap_s: float = Field(default=30.0, ge=0)
    retry_after_cap_s: float = Field(default=120.0, ge=0)
    """Upper limit for waits requested by the server."""


class LimitSettings(BaseModel, frozen=True, extra="forbid"):
    """Rate limits of one endpoint over the whole run; None is unlimited."""

    concurrent: int | None = Field(default=None, ge=1)
    """Maximum number of concurrent calls."""
    rpm: int | None = Field(default=None, ge=1)
    """Maximum number of calls started per minute."""
    tpm: int | None = Field(default=None, ge=1)
    """Maximum tokens per minute, prompt and completion; estimated before a call, then exact."""


class EndpointSettings(BaseModel, frozen=True, extra="forbid"):
    """All settings of an endpoint; none of them changes a reply."""

    http: HttpSettings = HttpSettings()
    retry: RetrySettings = RetrySettings()
    limits: LimitSettings = LimitSettings()
