"""Floating-point errors raise in tests; warnings are errors (pyproject.toml). On several workers, who runs what."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import pytest

if TYPE_CHECKING:
    from xdist.remote import Producer
    from xdist.scheduler import LoadFileScheduling

#: Files that call dehydration's loop, on both back ends, or the kernels of contact that it is compiled from. No disk
#: keeps these, but the loops alone (a minute for each process): one worker runs them all. The first file compiles the
#: loop, and whoever has done that has its parts as well.
TOGETHER = {
    f"tests/solver/{name}.py"
    for name in (
        *("test_dehydration", "test_contact_search", "test_contact", "test_kernel"),
        *("geometry/test_broad_phases", "geometry/test_closest"),
    )
}

#: Files that begin a run on several workers, in this order. The first ones compile a solver each, so that workers that
#: begin at once do not compile the same kernels; the contract, which runs all solvers, comes when they are done.
#: Then what takes long for its number of tests, so that no worker is left with it at the end.
FIRST = (
    "solver/wood/test_runs.py",
    "solver/test_dehydration.py",
    "solver/test_contact_search.py",
    "solver/test_contact.py",
    "solver/geometry/test_broad_phases.py",
    "solver/geometry/test_closest.py",
    "solver/test_kernel.py",
    "solver/growth/test_growth.py",
    "solver/decay/test_within.py",
    "solver/wood/test_crushing.py",
    "solver/test_onset.py",
    "solver/growth/test_coarser.py",
    "solver/wood/test_fibres.py",
    "solver/test_contract.py",
    "documents/test_commands.py",
    "store/test_faults.py",
    "service/test_jobs.py",
    "sweeps/test_cli_tables.py",
    "sweeps/test_every_table.py",
    "install/test_new_solver.py",
    "service/scenes/test_scenes.py",
    "service/test_fuzz.py",
    "solver/test_loading.py",
    "solver/test_stress.py",
    "solver/decay/test_oven.py",
    "solver/decay/test_heap.py",
    "solver/decay/test_kinds.py",
    "solver/growth/test_matter.py",
    "sweeps/test_stopping.py",
    "sweeps/test_cli.py",
    "sweeps/test_score.py",
    "sweeps/test_results.py",
    "sweeps/test_runner.py",
    "sweeps/test_executors.py",
    "sweeps/test_simulation.py",
    "store/test_audit.py",
    "store/test_tables.py",
    "service/test_reload.py",
    "service/test_doctor.py",
    "service/sessions/test_refused.py",
    "service/matching/test_match.py",
    "documents/test_figures.py",
    "solver/wood/test_bench_causes.py",
)


#: What several workers begin with: they share the cores, and BLAS threads that spin until another worker's are done
#: made a dozen processor seconds of one. Whether numbers hang on threads, `test_contract` asks for itself.
SHARED = {"OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "OMP_WAIT_POLICY": "passive"}


def pytest_configure(config: pytest.Config) -> None:
    """Libraries read these when they load: workers, and what they start, inherit them."""
    if config.getoption("numprocesses", None):
        for name, value in SHARED.items():
            os.environ.setdefault(name, value)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> LoadFileScheduling | None:
    """Hand workers whole files (--dist loadfile), and those of TOGETHER as one."""
    from xdist.scheduler import LoadFileScheduling

    class Files(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            name = super()._split_scope(nodeid)
            return "together" if name in TOGETHER else name

    return Files(config, log) if config.getoption("dist") == "loadfile" else None


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Order files for workers, which take one after the other: long ones first, others by their number of tests.

    `make test` tells pytest-xdist to keep this order (--no-loadscope-reorder). One process keeps pytest's own.
    """
    if not hasattr(config, "workerinput"):
        return
    places = {config.rootpath / "tests" / name: n for n, name in enumerate(FIRST)}
    tests = Counter(item.path for item in items)
    items.sort(key=lambda item: (places.get(item.path, len(places)), -tests[item.path], str(item.path)))


@pytest.fixture(autouse=True)
def floating_point_errors_raise() -> Iterator[None]:
    with np.errstate(divide="raise", over="raise", invalid="raise"):
        yield
