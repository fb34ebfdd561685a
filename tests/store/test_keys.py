from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from solver.contract import Need
from solver.fruit import Fruit
from store.keys import canonical, is_key, key

NEED = Need(fields=("displacement",), stages=(0.1, 0.25), resolution=64)


def test_golden() -> None:
    # results on disks are found by this key: when it changes on purpose, everything stored is computed again
    assert key("golden", "1", Fruit(), NEED) == "da9d6f0f1dce0a956c219ede917bdefcd47198b81bb556166e58061b9ed65dcd"


def test_one_spelling_per_value() -> None:
    assert canonical({"b": (1.0, -0.0), "a": np.float64(0.5)}) == b'{"a":0.5,"b":[1,0]}'
    assert canonical([1, 2.0, True, None, "é", 1e300]) == b'[1,2,true,null,"\\u00e9",1e+300]'
    assert canonical(2**63 - 1) == b"9223372036854775807"


# a busy machine is no fault of the values: an example has 0.2 s unless told otherwise
@settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@given(st.dictionaries(st.text(), st.floats(allow_nan=False, allow_infinity=False) | st.integers() | st.text()))
def test_order_does_not_matter_and_values_do(values: dict[str, object]) -> None:
    assert canonical(values) == canonical(dict(reversed(values.items())))
    for name in values:
        assert canonical(values) != canonical({**values, name: ["changed"]})


@pytest.mark.parametrize("value", [float("nan"), [float("inf")], {"a": {1, 2}}, {1: 2}, object()])
def test_what_has_no_canonical_form_is_refused(value: object) -> None:
    with pytest.raises((TypeError, ValueError)):
        canonical(value)


def test_every_part_of_the_question_counts() -> None:
    fruits = Fruit(), Fruit(exocarp_thickness=0.05), Fruit(seed=1)
    needs = NEED, NEED.model_copy(update={"resolution": 32}), NEED.model_copy(update={"stages": (0.1,)})
    questions = itertools.product(("a", "b"), ("1", "2"), fruits, needs)
    keys = [key(*question) for question in questions]
    assert len(set(keys)) == len(keys)
    assert all(map(is_key, keys))


def test_integers_in_float_fields_do_not_matter() -> None:
    whole = Fruit(radii=(1, 1, 1, 1, 1, 1, 1, 1))
    assert key("a", "1", whole, NEED) == key("a", "1", Fruit(radii=(1.0,) * 8), NEED)
    assert key("a", "1", Fruit.parse({"r2": 1}), NEED) == key("a", "1", Fruit(), NEED)


@pytest.mark.parametrize("change", [{"fields": ()}, {"stages": ()}, {"resolution": None}, {"tolerance": 0.1}])
def test_an_unsettled_need_has_no_key(change: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="settle"):
        key("a", "1", Fruit(), NEED.model_copy(update=change))
