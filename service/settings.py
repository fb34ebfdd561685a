"""What an operator may set, from `WIZEN_*` variables."""

from __future__ import annotations

from pathlib import Path

import platformdirs
from pydantic import Field
from pydantic_settings import BaseSettings, SettingsConfigDict

from store.starter import own_or_starter

from .page import BUILT

__all__ = ["Settings"]


class Settings(BaseSettings):
    """Settings of the service; `WIZEN_PORT=9000` sets `port`."""

    model_config = SettingsConfigDict(env_prefix="WIZEN_", frozen=True, extra="ignore")

    store: Path = Field(
        default_factory=lambda: own_or_starter(platformdirs.user_data_path("wizen") / "store"),
        description="Directory of the store whose tables are served; without one, the table that comes with wizen",
    )
    host: str = Field("127.0.0.1", description="Address to listen on")
    port: int = Field(8765, ge=0, le=65535, description="Port to listen on")
    max_resolution: int = Field(512, ge=8, le=2048, description="Most colatitude samples of one shape")
    max_query: int = Field(4096, ge=64, description="Longest query string [bytes]")
    max_body: int = Field(1 << 20, ge=0, description="Largest request body [bytes]")
    timeout: float = Field(30.0, gt=0, description="Longest wait for an answer to begin [s]")
    threads: int = Field(8, ge=1, le=256, description="Shapes computed at the same time; each holds its arrays")
    reload_interval: float = Field(0.5, ge=0, description="How often a table's manifest is looked at, at most [s]")
    cache_age: int = Field(60, ge=0, description="How long a client may reuse a shape without asking again [s]")
    page: Path = Field(BUILT, description="Directory of the built web page; `make page` makes it")
    metrics: bool = Field(True, description="Serve /metrics in Prometheus' text format")
