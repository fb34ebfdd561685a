"""Behind a proxy, below a path: every link leads somewhere, whether the proxy strips the path or not."""

from __future__ import annotations

import httpx
import pytest

from service.settings import Settings
from store.store import Store

from ._jobs import bearer
from .conftest import QUERY, client_of


@pytest.mark.parametrize("stripped", [True, False])
def test_links_below_a_path(own: Store, stripped: bool) -> None:
    with client_of(own.root, root_path="/fruits/v2", jobs_workers=0) as client:

        def get(link: str, **more: object) -> httpx.Response:
            assert link.startswith("/fruits/v2/"), link
            return client.get(link.removeprefix("/fruits/v2") if stripped else link, **more)  # type: ignore[arg-type]

        index = get("/fruits/v2/", headers={"Accept": "application/json"}).json()
        assert get(index["links"]["health"]).json()["status"] == "ok"
        page = get(index["links"]["schema"]).json()
        assert page["servers"][0]["url"] == "/fruits/v2"
        (table,) = get(index["links"]["tables"]).json()["tables"]
        assert get(table["links"]["self"]).json() == table
        (first, *_) = get(index["links"]["solvers"]).json()["solvers"]
        assert get(first["href"]).status_code == 200
        for _ in range(2):  # the second time by the short ways
            shape = get("/fruits/v2/v1/shapes/dehydration", params={**QUERY, "format": "json"}).json()
            assert get(shape["links"]["glb"]).content[:4] == b"glTF"
        need = {"stages": [0.05], "quality": "preview"}
        address = "/v1/jobs" if stripped else "/fruits/v2/v1/jobs"
        asked = {"solver": "dehydration", "preset": "sphere", "need": need}
        job = client.post(address, json=asked, headers=bearer(own))
        assert get(job.headers["location"]).json()["id"] == job.json()["id"]
        assert get(job.json()["links"]["self"]).status_code == 200
        # what only looks alike is not ours
        assert client.get("/fruits/v22/healthz").status_code == 404


def test_paths_that_cannot_be() -> None:
    for path in ("fruits", "/fruits/", "/a b", "//", "/a?b"):
        with pytest.raises(ValueError, match="root_path"):
            Settings(root_path=path)
