"""Shapes in the event loop take turns; the common question goes a shorter way and gets the same answer."""

from __future__ import annotations

import asyncio

import pytest

from service.errors import Overloaded
from service.shapes.turns import Turns
from store.store import Store
from store.tokens import Tokens

from .conftest import QUERY, SHAPE, client_of


def test_turns_are_taken_in_order_and_one_at_a_time() -> None:
    turns, seen, inside = Turns(10), [], 0

    async def one(i: int) -> None:
        nonlocal inside
        async with turns:
            inside += 1
            assert inside == 1
            seen.append(i)
            await asyncio.sleep(0)
            inside -= 1

    async def all_() -> None:
        await asyncio.gather(*(one(i) for i in range(8)))

    asyncio.run(all_())
    assert seen == list(range(8))
    assert turns.waiting == 0


def test_too_many_are_refused_and_the_others_served() -> None:
    turns = Turns(2)

    async def one() -> bool:
        async with turns:
            await asyncio.sleep(0.01)
            return True

    async def all_() -> list[bool | BaseException]:
        return await asyncio.gather(*(one() for _ in range(5)), return_exceptions=True)

    found = asyncio.run(all_())
    assert found.count(True) >= 3
    refused = [error for error in found if isinstance(error, Overloaded)]
    assert len(refused) + found.count(True) == 5
    assert refused
    assert "batch" in refused[0].advice


CHANGES = [({}, 200), ({"te": 9}, 422), ({"format": "gift"}, 422), ({"table": "none"}, 404), ({"max_error": 1e-9}, 422)]


@pytest.mark.parametrize(("change", "status"), CHANGES)
def test_the_short_way_answers_as_the_long_one(own: Store, change: dict, status: int) -> None:
    query = {**QUERY, "s": 0.21, "format": "npz", **change}
    secret = Tokens(own.root).create("reader", ["read"])[1]
    answers = []
    for public in (True, False):  # whoever must show a token goes the long way
        with client_of(own.root, public_read=public) as client:
            client.headers["Authorization"] = f"Bearer {secret}"
            client.get(SHAPE, params=QUERY)  # the table is open from here on
            answers.append(client.get(SHAPE, params=query))
            assert f'route="/v1/shapes/{{solver}}",status="{status}"' in client.get("/metrics").text
    short, long = answers
    assert short.status_code == long.status_code == status
    if status == 200:
        assert short.content == long.content
        assert short.headers["etag"] == long.headers["etag"]
    else:
        assert short.json()["detail"] == long.json()["detail"]
        assert short.json()["advice"] == long.json()["advice"]
