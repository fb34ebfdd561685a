"""What an operator may set, from `WIZEN_*` variables."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Literal

import platformdirs
from pydantic import Field, field_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from store.starter import own_or_starter

from .page import BUILT

__all__ = ["Settings", "page"]

_ORIGIN = re.compile(r"https?://[^/?#\s]+")


class Settings(BaseSettings):
    """Settings of the service; `WIZEN_PORT=9000` sets `port`."""

    model_config = SettingsConfigDict(env_prefix="WIZEN_", frozen=True, extra="ignore")

    store: Path = Field(
        default_factory=lambda: own_or_starter(platformdirs.user_data_path("wizen") / "store"),
        description="Directory of the store whose tables are served; without one, the table that comes with wizen",
    )
    host: str = Field("127.0.0.1", description="Address to listen on")
    port: int = Field(8765, ge=0, le=65535, description="Port to listen on")
    workers: int = Field(1, ge=1, le=256, description="Processes of `wizen serve` that answer")
    max_resolution: int = Field(512, ge=8, le=2048, description="Most colatitude samples of one shape")
    max_batch: int = Field(4096, ge=1, description="Most shapes of one batch")
    max_batch_samples: int = Field(1 << 25, ge=128, description="Most lattice points of one batch, over all its shapes")
    max_export_samples: int = Field(
        1 << 22, ge=128, description="Most vertices, over all stages, of a result's file; textures count their pixels"
    )
    max_map: int = Field(4096, ge=2, le=8192, description="Most pixels of a map or texture, along and down")
    max_query: int = Field(4096, ge=64, description="Longest query string [bytes]")
    max_body: int = Field(1 << 20, ge=0, description="Largest request body [bytes]")
    timeout: float = Field(30.0, gt=0, description="Longest wait for an answer to begin [s]")
    body_timeout: float = Field(10.0, gt=0, description="Longest time that a request's body may take to arrive [s]")
    head_timeout: float = Field(10.0, gt=0, description="Longest time that a request's head may take to arrive [s]")
    max_head: int = Field(32768, ge=1024, description="Longest head of a request: its line and headers [bytes]")
    max_headers: int = Field(100, ge=8, description="Most headers of a request")
    max_connections: int = Field(
        8192,
        ge=1,
        description="Most open connections, in each process: as far as the system's limit on open files allows",
    )
    max_connections_per_client: int = Field(
        256, ge=1, description="Most open connections from one address, in each process; a proxy counts as one client"
    )
    max_delay: float = Field(
        1.0, gt=0, description="Longest expected wait for a shape or a result; what would wait longer gets a 503 [s]"
    )
    max_waiting: int = Field(1024, ge=1, description="Most small shapes that wait to be computed, in each process")
    threads: int = Field(8, ge=1, le=256, description="Shapes computed at the same time; each holds its arrays")
    reload_interval: float = Field(0.5, ge=0, description="How often a table's manifest is looked at, at most [s]")
    cache_age: int = Field(60, ge=0, description="How long a client may reuse a shape without asking again [s]")
    cache_bytes: int = Field(
        16 << 20, ge=0, description="Answers kept for those who ask again, in each process [bytes]"
    )
    cors_origins: Annotated[tuple[str, ...], NoDecode] = Field(
        (),
        description="Pages elsewhere that may ask, by origin, e.g. `https://a.example,https://b.example`; `*`: all",
    )
    compress: Literal["off", "elsewhere", "always"] = Field(
        "elsewhere",
        description="Whose answers are compressed (zstd, br, gzip): `off`, none; `elsewhere`, those to other machines; "
        "`always`, all",
    )
    root_path: str = Field(
        "", pattern=r"^(/[A-Za-z0-9._~-]+)*$", description="Where a proxy serves this, e.g. `/wizen`"
    )
    public_read: bool = Field(True, description="Serve shapes, tables, solvers and the state of jobs without a token")
    jobs_workers: int = Field(
        1, ge=0, le=1024, description="Processes that run jobs; 0 leaves them to `wizen work` or another service"
    )
    scheduler: str | None = Field(None, description="A Dask scheduler whose workers run jobs, e.g. tcp://10.0.0.1:8786")
    max_jobs: int = Field(1000, ge=1, description="Most jobs that wait or run at once")
    max_jobs_per_token: int = Field(100, ge=1, description="Most jobs of one token that wait or run at once")
    max_seconds_per_token: float | None = Field(
        None, gt=0, description="Most solver time that one token may ask for within `WIZEN_QUOTA_HOURS` [s]; none: any"
    )
    max_seconds_per_client: float | None = Field(
        None,
        gt=0,
        description="The same of one address, whatever its tokens [s]",
    )
    quota_hours: float = Field(24.0, gt=0, description="For how long solver time that was asked for counts [h]")
    max_job_seconds: float = Field(3600.0, gt=0, description="Longest expected time of one job [s]")
    max_job_bytes: float = Field(8e9, gt=0, description="Largest expected memory or result of one job [bytes]")
    max_listeners: int = Field(64, ge=1, description="Most open streams of job events")
    max_listeners_per_client: int = Field(8, ge=1, description="Most open streams of job events of one client")
    max_sessions: int = Field(4, ge=0, description="Most live sessions, over all processes; 0: none")
    max_sessions_per_token: int = Field(2, ge=1, description="Most live sessions of one token, over all processes")
    session_idle: float = Field(900.0, gt=0, description="After how long without an input a live session ends [s]")
    session_kept: float = Field(120.0, gt=0, description="How long a live session waits for a lost connection [s]")
    session_seconds: float = Field(3600.0, gt=0, description="Most processor time of one live session [s]")
    page: Path = Field(BUILT, description="Directory of the built web page; `make page` makes it")
    metrics: bool = Field(True, description="Serve /metrics in Prometheus' text format")

    @field_validator("cors_origins", mode="before")
    @classmethod
    def _origins(cls, value: object) -> object:
        """Take a list with commas, and name what no browser sends as an origin."""
        parts = [part.strip() for part in value.split(",") if part.strip()] if isinstance(value, str) else value
        for part in parts if isinstance(parts, list | tuple) else ():
            if part != "*" and not _ORIGIN.fullmatch(str(part)):
                raise ValueError(
                    f"{part!r} is no origin: write scheme, host and port alone, e.g. https://a.example:8443"
                )
        return parts

    def kept(self, seconds: int) -> str:
        """Return the Cache-Control of what may be used again for so long; by its asker alone, if that takes a token."""
        return f"{'public' if self.public_read else 'private'}, max-age={seconds}"


def page() -> str:
    """Return docs/settings.md: every setting with its default and its meaning."""
    rows = []
    for name, field in Settings.model_fields.items():
        default = "" if field.default_factory or field.default in (BUILT, ()) else f"`{field.default}`"
        rows.append(f"| `WIZEN_{name.upper()}` | {default} | {field.description} |")
    return "\n".join(
        [
            "# Settings of the service",
            "",
            "`wizen serve` reads them from the environment. `python -m service.settings` printed this page.",
            "",
            "| variable | default | |",
            "|---|---|---|",
            *rows,
            "",
        ]
    )


if __name__ == "__main__":
    print(page(), end="")
