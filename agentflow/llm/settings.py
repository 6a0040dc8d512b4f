"""Settings of an endpoint: time-outs, retries, rate limits.

Kept apart from the client code: reading a configuration must not load httpx.
"""

from pydantic import BaseModel, Field


class HttpSettings(BaseModel, frozen=True, extra="forbid"):
    """Time-outs in seconds.

    Attributes:
        connect_s: Seconds to wait for a connection.
        idle_s: Maximum time without data; servers that do not stream send nothing until they are
            done.
        total_s: Maximum duration of one attempt.
    """

    connect_s: float = Field(10.0, gt=0)
    idle_s: float = Field(300.0, gt=0)
    total_s: float = Field(1800.0, gt=0)


class RetrySettings(BaseModel, frozen=True, extra="forbid"):
    """Exponential back-off with full jitter: waits are uniform in [0, min(cap, base * 2^n)].

    Attributes:
        attempts: Maximum attempts per call, including the first.
        base_s: Longest wait before the second attempt.
        cap_s: Longest wait before any attempt.
        retry_after_cap_s: Upper limit for waits that the server requests.
    """

    attempts: int = Field(6, ge=1)
    base_s: float = Field(0.5, ge=0)
    cap_s: float = Field(30.0, ge=0)
    retry_after_cap_s: float = Field(120.0, ge=0)


class LimitSettings(BaseModel, frozen=True, extra="forbid"):
    """Rate limits of one endpoint over the whole run; null is no limit.

    Attributes:
        concurrent: Maximum number of concurrent calls.
        rpm: Maximum number of calls started per minute.
        tpm: Maximum tokens per minute, prompt and completion; estimated before a call, then exact.
    """

    concurrent: int | None = Field(None, ge=1)
    rpm: int | None = Field(None, ge=1)
    tpm: int | None = Field(None, ge=1)


class EndpointSettings(BaseModel, frozen=True, extra="forbid"):
    """All settings of an endpoint; none of them changes a reply."""

    http: HttpSettings = HttpSettings()
    retry: RetrySettings = RetrySettings()
    limits: LimitSettings = LimitSettings()
