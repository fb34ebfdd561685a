"""Two threads do what one does: the same factors and solutions to the last bit, the same errors, no work after one."""

from __future__ import annotations

import _thread
import contextlib
import gc
import importlib
import signal
import threading
import time
import weakref
from collections.abc import Generator

import numpy as np
import pytest

from solver import shell
from solver.linalg import abreast, multifrontal, substitution
from solver.linalg.cholesky import factor
from solver.linalg.dissection import dissect
from solver.linalg.multifrontal import factorise
from solver.linalg.substitution import substitute
from solver.shell import halves

from .shell._meshes import ball
from .shell.test_barrier import crumpled, hairpin, near_in
from .test_linalg import order, springs

# of the function's name the package knows the function
searching = importlib.import_module("solver.shell.contact.search")
MODULES = (abreast, halves, multifrontal, searching, substitution)


@pytest.fixture
def use(monkeypatch):
    """Choose how many threads may be used, however few cores there are, and however small the matrix is."""

    def choose(count: int) -> None:
        for module in MODULES:
            monkeypatch.setattr(module, "two", lambda: count == 2)
        monkeypatch.setattr(multifrontal, "_WORTH", 0)
        for module in (halves, searching, substitution):
            monkeypatch.setattr(module, "_MANY", 0)

    return choose


@pytest.fixture(params=[2, 1])
def threads(request, use):
    use(request.param)
    return request.param


def started(monkeypatch) -> list[str]:
    names: list[str] = []
    begin = threading.Thread.start
    monkeypatch.setattr(threading.Thread, "start", lambda self: (names.append(self.name), begin(self))[1])
    return names


@pytest.mark.parametrize("leaf_size", [3, 20, 10_000])
def test_single_factors_and_what_they_solve_are_the_same(leaf_size, use, monkeypatch):
    x, pattern, blocks, _ = springs(n=400)
    row = np.repeat(np.arange(len(x)), np.diff(pattern.indptr))
    parts = np.column_stack([row, pattern.indices])[row <= pattern.indices]
    fronts = dissect(parts, x[parts].mean(axis=1), len(x), leaf_size)
    rng = np.random.default_rng(0)
    matrices = [np.ascontiguousarray(blocks[:, d, d]) for d in (0, 1)]
    normals, right = rng.normal(size=(len(x), 3)), rng.normal(size=(len(x), 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    found = {}
    for count in (1, 2):
        use(count)
        names = started(monkeypatch)
        work = abreast.abreast(*(factor(fronts, pattern.indptr, pattern.indices, data) for data in matrices))
        factors, solved = abreast.finished(work), np.empty_like(right)
        substitute(right, normals, fronts, *factors, solved)
        found[count] = [part.tobytes() for part in (*factors, solved)]
        # one leaf has no halves to share
        assert bool(names) == (count == 2)
        assert len(names) >= (3 if leaf_size < 100 else 1) or count == 1
    assert found[1] == found[2]


@pytest.mark.parametrize("varied", [False, True])
def test_energy_and_gradient_of_a_sheet_are_the_same(varied, use, monkeypatch):
    x, triangles = ball(500)
    mesh, rng = shell.topology(triangles, len(x)), np.random.default_rng(0)
    g = shell.metric(x, triangles)
    moved = x + rng.normal(0, 0.01, x.shape)
    thick = rng.uniform(0.5, 2, len(triangles)) if varied else None
    rest, stiffness = rng.normal(0, 0.1, len(mesh.hinges)), rng.uniform(0.1, 1, len(mesh.hinges))
    found = {}
    for count in (1, 2):
        use(count)
        names, sheet = started(monkeypatch), shell.Halves(mesh)
        for _ in range(2):  # what is kept between calls counts once
            gradient = np.ones_like(x)
            energy = sheet(moved, g, 1.5, thick, rest, stiffness, gradient)
        found[count] = energy, gradient.tobytes()
        assert len(names) == 2 * (count - 1)
    wanted = np.ones_like(x)
    energy = shell.membrane(moved, triangles, g, 1.5, wanted, thick)
    energy += shell.bending(moved, mesh.hinges, rest, stiffness, wanted)
    assert found[1] == found[2] == (energy, wanted.tobytes())


@pytest.mark.parametrize("near", [True, False])
def test_what_a_search_for_contact_finds_is_the_same(near, use, monkeypatch):
    """Of legs of one strip, near each other along it, and of two sheets that are not."""
    x, *flat, mesh = hairpin() if near else crumpled()
    beside, found = near_in(flat[0] if near else x, mesh, 0.56 if near else 0.05), {}
    for count in (1, 2):
        use(count)
        names = started(monkeypatch)
        found[count] = shell.search(x, mesh, beside, 0.05, 0.05, 0.05, 0.1)
        assert len(names) == count - 1
    assert len(found[1].kinds) > 50
    assert (found[1].near > 0) == near
    assert all(np.array_equal(one, other) for one, other in zip(*found.values(), strict=True))


@pytest.mark.parametrize("leaf_size", [5, 40, 10_000])
@pytest.mark.parametrize("shift", [0.0, 0.9])
def test_whole_factors_are_the_same(leaf_size, shift, use):
    x, pattern, blocks, _ = springs(n=400)
    blocks[pattern.diagonal] -= shift * np.eye(3)
    right, found = np.random.default_rng(1).normal(size=3 * len(x)), {}
    for count in (1, 2):
        use(count)
        done = factorise(order(x, pattern, leaf_size), blocks)
        found[count] = done.negative, done.solve(right).tobytes()
    assert found[1] == found[2]


@pytest.mark.parametrize("leaf_size", [5, 40])
def test_the_halves_of_an_analysis_are_apart_and_all_but_its_end(leaf_size):
    x, pattern, _, _ = springs(n=400)
    found = order(x, pattern, leaf_size)
    first, second = found.halves()
    assert first.start == 0
    assert first.stop == second.start
    assert len(second) > 0
    for half in (first, second):
        assert all(child in half for f in half for child in found.fronts[f].children)
    inner, outer = (
        np.concatenate([found.fronts[f].nodes[: found.fronts[f].own] for f in half]) for half in (first, second)
    )
    coupled = np.zeros(len(x), np.bool_)
    coupled[inner] = True
    assert not any(coupled[pattern.indices[pattern.indptr[v] : pattern.indptr[v + 1]]].any() for v in outer)


def test_what_ends_one_half_ends_the_other(threads):
    """Within a moment: the rest of a large factor would take minutes."""
    x, pattern, blocks, _ = springs(n=400)
    seen = []

    def watch() -> None:
        seen.append(threading.current_thread())
        if len(seen) == 3:
            raise TimeoutError("asked to stop")

    with pytest.raises(TimeoutError, match="asked to stop"):
        factorise(order(x, pattern, 5), blocks, watch)
    # whoever watches is not asked from another thread
    assert set(seen) == {threading.main_thread()}
    assert not [thread for thread in threading.enumerate() if thread.name == "wizen-abreast"]


def test_an_indefinite_matrix_is_refused_in_whichever_half(threads):
    x, pattern, blocks, _ = springs(n=400)
    found = order(x, pattern, 20)
    halves = found.halves()
    for half in halves:
        bad = blocks.copy()
        front = found.fronts[half[0]]
        bad[pattern.diagonal[front.nodes[0]]] -= 100 * np.eye(3)
        with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
            factorise(found, bad, definite=True)


def test_both_raise_what_either_raises():
    def fail(_=None):
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        abreast.both(fail, lambda _: 1)
    with pytest.raises(ValueError, match="no"):
        abreast.both(lambda: 1, fail)


def test_the_other_hears_that_one_has_failed():
    def fail():
        raise ValueError("no")

    heard = []
    with pytest.raises(ValueError, match="no"):
        abreast.both(fail, lambda ended: heard.append(ended.wait(60)))
    assert heard == [True]


def test_who_is_interrupted_while_he_waits_leaves_nobody_at_work():
    """Ctrl-C comes to the first thread, which may be done with its own half."""
    heard = []

    def there(ended: threading.Event) -> None:
        _thread.interrupt_main()
        heard.append(ended.wait(60))

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # what a shell starts with `&` ignores it
    try:
        with pytest.raises(KeyboardInterrupt):
            abreast.both(lambda: 1, there)
    finally:
        signal.signal(signal.SIGINT, before)
    assert heard == [True]
    assert not [thread for thread in threading.enumerate() if thread.name == "wizen-abreast"]


@pytest.mark.parametrize("who", ["here", "there", "both"])
def test_what_failed_is_let_go_at_once(who):
    """Not when the garbage collector finds a ring: a large factor's fronts are in these frames."""

    class Fronts:
        pass

    kept = []

    def fail(_=None):
        fronts = Fronts()
        kept.append(weakref.ref(fronts))
        raise ValueError("no")

    is_on = gc.isenabled()
    gc.disable()
    try:
        with contextlib.suppress(ValueError):
            abreast.both(fail if who != "there" else lambda: 1, fail if who != "here" else lambda _: 1)
        assert kept
        assert [fronts() for fronts in kept] == [None] * len(kept)
    finally:
        if is_on:
            gc.enable()


def test_one_comes_after_the_other_where_no_thread_can_start(monkeypatch):
    """A container may have all the threads that it may have, and an interpreter that ends starts none."""

    def start(self: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", start)
    done = []
    assert abreast.both(lambda: done.append("here") or 1, lambda ended: done.append("there") or 2) == (1, 2)
    assert done == ["here", "there"]


@pytest.mark.parametrize("what", ["raise", "ignore"])
def test_both_halves_take_an_overflow_alike(what):
    with np.errstate(over=what):
        assert abreast.both(np.geterr, lambda _: np.geterr()) == (np.geterr(), np.geterr())


def test_both_run_at_once():
    """Each waits for the other."""
    meet = threading.Barrier(2, timeout=60)
    assert abreast.both(lambda: meet.wait() >= 0, lambda _: meet.wait() >= 0) == (True, True)


def count_to(number: int, pieces: list[float]) -> Generator[None, None, int]:
    for _ in range(number):
        pieces.append(time.monotonic())
        yield
    return number


@pytest.mark.parametrize(("one", "other"), [(3, 3), (2, 5), (5, 2), (0, 4)])
def test_generators_of_any_length_come_to_their_end(one, other, threads):
    pieces: list[float] = []
    assert abreast.finished(abreast.abreast(count_to(one, pieces), count_to(other, pieces))) == (one, other)
    assert len(pieces) == one + other
