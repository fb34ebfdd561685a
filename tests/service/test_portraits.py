"""Pictures of presets that come with wizen: they are there, of what they say, and of the solvers as they are."""

from __future__ import annotations

import io

import httpx
import numpy as np
import pytest
from PIL import Image

from benchmarks.portraits import portrait
from service import portraits
from solver import registry
from solver.contract import InvalidInput
from store import starter, tables
from store.families import stored
from store.lookup import ShapeTable
from store.store import Store
from sweeps import families

from ._asking import checked


def test_every_preset_that_says_so_has_its_picture(client: httpx.Client) -> None:
    seen = set()
    for name in registry.names():
        solver = registry.get(name)
        page = client.get(f"/v1/solvers/{name}").json()
        assert page["portraits"].keys() == portraits.said(name).keys() & solver.presets.keys()
        for preset, what in page["portraits"].items():
            answer = client.get(what["href"])
            assert answer.headers["content-type"] == "image/png"
            picture = Image.open(io.BytesIO(answer.content)).convert("RGB")
            assert picture.size == (192, 192)
            # something is drawn in the middle of it, and nothing at its upper corners
            levels = np.asarray(picture, float)
            assert levels[60:130, 60:130].std() > 4, preset
            assert levels[:4, :4].std(axis=(0, 1)).max() < 1, preset
            again = client.get(what["href"], headers={"If-None-Match": answer.headers["etag"]})
            assert again.status_code == 304
            low, high = solver.stages.lowest, solver.stages.highest
            assert low <= what["stage"] <= high
            seen.add(answer.content)
    assert len(seen) >= 40  # no two are the same


def test_pictures_are_of_the_solvers_as_they_are() -> None:
    """A picture of another version would show what a run no longer makes: python -m benchmarks.portraits."""
    for name in registry.names():
        versions = {what["version"] for what in portraits.said(name).values()}
        assert versions <= {registry.get(name).version}


def test_each_table_of_the_package_has_its_picture_as_the_service_would_draw_it() -> None:
    store = Store.open(starter.ROOT)
    digests = {tables.info(store, name).digest for name in store.table_names()}
    there = {path.stem for path in portraits.table_file("").parent.glob("*.png")}
    assert there == {digest[:12] for digest in digests}
    table = ShapeTable.open(store, "sphere-02", surfaces=registry.surface)
    known = stored.families(store, registry.get(table.info.solver))
    here, drawn = (
        np.asarray(Image.open(io.BytesIO(data or b"")).convert("RGB"), float)
        for data in (portraits.of_table(table.digest), families.drawn(table, known, store))
    )
    # another processor rounds a pixel at the edge otherwise
    assert np.abs(here - drawn).mean() < 0.5


@pytest.mark.parametrize("address", ["decay/presets/apple-on-mars", "wood/presets/.."])
def test_another_picture_is_refused(client: httpx.Client, address: str) -> None:
    solver = address.partition("/")[0]
    answer = client.get(f"/v1/solvers/{solver}/presets/apple-on-mars/portrait.png")
    problem = checked(answer, 404, "unknown-preset")
    assert next(iter(portraits.said(solver))) in problem["advice"]
    assert client.get(f"/v1/solvers/{address}/portrait.png").status_code == 404


def test_what_takes_long_is_refused_before_it_is_solved() -> None:
    with pytest.raises(InvalidInput, match="expected to take"):
        portrait(registry.get("dehydration"), "wolfberry", 1.0)
