"""Every registered solver is held to the contract of DESIGN.md."""

import functools
import json
import os
import pickle
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import xarray as xr

from solver import registry
from solver.contract import (
    Cancelled,
    Context,
    InvalidInput,
    Need,
    Params,
    Region,
    Solver,
    SolverError,
    Unstable,
    finish,
)
from solver.meshes import frame
from solver.quantities import QUANTITIES, Quantity, register

#: Per solver: small parameters, cheap stages, and more expensive stages to cancel.
SMALL = {
    "decay": ({"growth": 50.0}, (0.3, 0.6), (110.0,)),
    "growth": ({"step": 0.2, "thickness": 0.1}, (0.1, 0.25), (3.0,)),
    "dehydration": ({"te": 0.1, "gamma": 3.0}, (0.01, 0.02), (0.5,)),
    "wood": ({"rods": 8, "vertices": 16, "bend": 0.01, "length": 0.15}, (2e-4, 4e-4), (50.0,)),
}


@pytest.fixture(params=registry.names())
def solver(request: pytest.FixtureRequest) -> Solver:
    return registry.get(request.param)


def small(solver: Solver) -> tuple[Params, Need, Need]:
    values, cheap, dear = SMALL[solver.name]
    need = {"quality": "preview", "resolution": 16}
    return solver.parse(values), Need(stages=cheap, **need), Need(stages=dear, **need)


@functools.cache
def solved(name: str) -> xr.Dataset:
    """Return the cheap stages of the small parameters, solved once for all who look at them."""
    params, need, _ = small(registry.get(name))
    return registry.get(name).solve(params, need)


def same(a: xr.Dataset, b: xr.Dataset) -> bool:
    volatile = [n for n in a.variables if QUANTITIES[n].volatile]
    return a.drop_vars(volatile).identical(b.drop_vars(volatile))


def test_schema_says_units_and_meaning_of_every_field(solver):
    for name, field in solver.params.model_json_schema()["properties"].items():
        assert field.get("description"), name
        assert field.get("units"), name


def test_schema_says_every_default_however_deep(solver):
    """A form made of the schema puts something else where it says none, which may want a number from its reader."""
    schema = solver.params.model_json_schema()
    for name, group in {**schema.get("$defs", {}), "": schema}.items():
        optional = group.get("properties", {}).keys() - set(group.get("required", ()))
        assert {field for field in optional if "default" not in group["properties"][field]} == set(), name


def test_fields_and_defaults_are_known_quantities(solver):
    assert set(solver.default_fields) <= set(solver.fields) <= set(QUANTITIES)
    assert solver.stages.lowest <= min(solver.stages.default) <= max(solver.stages.default) <= solver.stages.highest


def test_presets_are_valid(solver):
    for preset in solver.presets:
        solver.parse({}, preset=preset)


def test_a_run_returns_exactly_what_was_needed_with_units_and_convergence(solver):
    params, need, _ = small(solver)
    result = solved(solver.name)
    assert result.stage.values.tolist() == list(need.stages)
    assert set(solver.default_fields) <= set(result.data_vars)
    assert {"converged", "residual", "iterations", "seconds"} <= set(result.data_vars)
    for name in result.variables:
        assert result[name].attrs.get("units"), name
        assert result[name].attrs.get("long_name"), name
    assert result.attrs["solver"] == solver.name
    assert solver.params.model_validate_json(result.attrs["params"]) == params
    assert "path" in result.attrs


def test_only_the_wanted_fields_are_there(solver):
    params, need, _ = small(solver)
    field = solver.fields[-1]
    result = solver.solve(params, need.model_copy(update={"fields": (field,)}))
    assert set(result.data_vars) & set(solver.fields) == {field}


def test_nothing_beyond_the_last_stage_is_solved(solver):
    params, need, _ = small(solver)
    steps = []
    for count in (1, 2):
        told: list[float] = []
        observer = Context(lambda fraction, _, told=told: told.append(fraction))
        solver.solve(params, need.model_copy(update={"stages": need.stages[:count]}), observer)
        steps.append(len(told))
    # every stage is told of
    assert steps[0] < steps[1]


def test_a_stage_does_not_depend_on_the_other_stages_asked_for(solver):
    params, need, _ = small(solver)
    both = solved(solver.name)
    last = solver.solve(params, need.model_copy(update={"stages": need.stages[-1:]}))
    if "vertex_count" in both:
        assert all(np.array_equal(a, b) for a, b in zip(frame(both, -1)[:2], frame(last, -1)[:2], strict=True))
    both, last = both.isel(stage=-1), last.isel(stage=-1)
    for name in solver.default_fields:
        if "vertex" in both[name].dims:
            continue  # end to end with those of other stages: compared as a frame
        assert np.array_equal(both[name], last[name]), name


def test_same_seed_same_bytes_and_another_seed_differs(solver):
    params, need, _ = small(solver)
    first, again = solved(solver.name), solver.solve(params, need)
    assert same(first, again)
    other = solver.solve(params.model_copy(update={"seed": params.seed + 1}), need)
    assert not same(first, other)


PROBE = """
import json
from tests.solver.test_contract import small
from solver import registry
from store.shards import digest
found = {}
for name in registry.names():
    params, need, _ = small(registry.get(name))
    found[name] = digest(registry.get(name).solve(params, need))
print(json.dumps(found))
"""


@functools.cache
def digests(threads: str) -> dict[str, str]:
    """Return all solvers' digests of a process of its own, which has so many threads."""
    names = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    environment = os.environ | dict.fromkeys(names, threads)
    command = [sys.executable, "-c", PROBE]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    found: dict[str, str] = json.loads(done.stdout)
    return found


def test_same_bytes_whatever_the_number_of_threads(solver):
    """A sweep on one worker and on many stores the same results."""
    assert digests("1")[solver.name] == digests("2")[solver.name] != ""


def test_an_unknown_field_is_refused_before_any_work(solver):
    params, _, dear = small(solver)

    def working(*_: object) -> bool:
        raise AssertionError("it began")

    with pytest.raises(InvalidInput, match="no field 'colour'"):
        solver.solve(params, dear.model_copy(update={"fields": ("colour",)}), Context(working, working))


def test_a_stage_off_the_axis_is_refused(solver):
    params, need, _ = small(solver)
    with pytest.raises(InvalidInput, match="outside"):
        solver.solve(params, need.model_copy(update={"stages": (solver.stages.highest + 1,)}))


@pytest.mark.parametrize("bad", [{"no_such_name": 1}, {"seed": float("nan")}, {"seed": "x"}])
def test_bad_parameters_are_refused(solver, bad):
    with pytest.raises(InvalidInput):
        solver.parse(bad)


def test_cancellation_is_seen_within_two_seconds_and_keeps_what_converged(solver):
    params, need, dear = small(solver)
    solved(solver.name)  # compile before the clock runs
    stop = threading.Event()
    asked: list[float] = []

    def observe(fraction: float, message: str) -> None:
        assert 0 <= fraction <= 1
        if "settled" in message and not asked:
            asked.append(time.process_time())
            stop.set()

    stages = need.stages[:1] + dear.stages
    with pytest.raises(Cancelled) as caught:
        solver.solve(params, need.model_copy(update={"stages": stages}), Context(observe, stop.is_set))
    # its own time: what else the machine does is not the solver's doing
    assert time.process_time() - asked[0] < 2
    assert caught.value.partial is not None
    assert caught.value.partial.stage.values.tolist() == list(need.stages[:1])
    assert caught.value.last_stage == need.stages[0]


def test_a_partial_result_survives_pickling(solver):
    error = Unstable("it blew up.", advice="Ask for less.", partial=solved(solver.name), last_stage=0.1)
    back = pickle.loads(pickle.dumps(error))
    assert type(back) is Unstable
    assert str(back) == "it blew up. Ask for less."
    assert back.partial.identical(error.partial)


@pytest.mark.parametrize("azimuth", [(80, 250), (-80, 40)])
def test_region_returns_a_part_of_the_whole(solver, azimuth):
    params, need, _ = small(solver)
    asked = need.model_copy(update={"region": Region(colatitude=(30, 90), azimuth=azimuth)})
    whole = solved(solver.name)
    if "colatitude" not in whole.dims:
        with pytest.raises(InvalidInput, match=r"no lattice|colatitude"):
            solver.solve(params, asked)
        return
    part = solver.solve(params, asked)
    assert 0 < part.sizes["colatitude"] < whole.sizes["colatitude"]
    cut = whole.sel(colatitude=part.colatitude, azimuth=part.azimuth)
    fields = [name for name in part.data_vars if "colatitude" in part[name].dims]
    assert fields
    for name in fields:
        assert np.array_equal(cut[name], part[name]), name


@pytest.mark.parametrize(
    ("region", "words"),
    [
        ({"colatitude": (-10, 90)}, "colatitude runs from -10 to 90"),
        ({"colatitude": (90, 190)}, "Stay within 0 to 180"),
        ({"azimuth": (-400, -300)}, "azimuth runs from -400 to -300"),
        ({"azimuth": (-10, 360)}, "Take a turn at most"),
        ({"azimuth": (700, 730)}, "within -360 to 720"),
        # between the points of the lattice
        ({"colatitude": (0, 1e-3)}, "no point of the lattice of 16 colatitudes"),
        ({"azimuth": (1, 2)}, "points are 11.2 degrees apart"),
        ({"azimuth": (-2, -1)}, "points are 11.2 degrees apart"),
    ],
)
def test_a_region_that_would_lose_points_is_refused_before_any_work(region, words):
    solver = registry.get("dehydration")
    with pytest.raises(InvalidInput) as caught:
        solver.settle(Need(resolution=16, region=Region(**region)))
    assert words in str(caught.value)
    solver.settle(Need(resolution=16, region=Region()))


def test_a_tolerance_picks_the_cheapest_quality_that_was_measured_to_reach_it(solver):
    settled = solver.settle(Need(tolerance=max(solver.tolerances.values())))
    assert settled.quality == "preview"
    with pytest.raises(InvalidInput, match="finest setting"):
        solver.settle(Need(tolerance=1e-9))


def test_a_tolerance_beside_a_quality_is_refused(solver):
    both = Need.parse({"tolerance": max(solver.tolerances.values()), "quality": "preview"})
    with pytest.raises(InvalidInput, match="picks the quality"):
        solver.settle(both)
    # what is settled names the quality that was picked, and may be settled again
    settled = solver.settle(Need.parse({"tolerance": max(solver.tolerances.values())}))
    assert solver.settle(settled) == settled


@pytest.mark.parametrize(
    ("position", "steps", "words"),
    [
        (
            np.full((8, 16, 3), np.nan),
            None,
            "the surface has points that are not finite. Give the position of a look-up",
        ),
        (np.ones((8, 16, 3)), 0, "steps = 0 are none. Give one or more, or leave them out"),
    ],
)
def test_what_cannot_be_relaxed_is_refused_before_any_work(position, steps, words):
    solver = registry.get("dehydration")
    with pytest.raises(InvalidInput, match=words):
        solver.relaxed(small(solver)[0], position, 0.1, steps=steps)


def test_a_field_of_the_whole_mesh_is_refused_beside_a_region():
    solver = registry.get("dehydration")
    with pytest.raises(InvalidInput, match="mesh_position is of the whole mesh"):
        solver.settle(Need(fields=("mesh_position", "volume"), region=Region(colatitude=(0, 90))))
    solver.settle(Need(fields=("position",), region=Region(colatitude=(0, 90))))


def test_a_value_by_two_names_is_refused():
    solver = registry.get("dehydration")
    for preset in (None, "plum1"):
        with pytest.raises(InvalidInput) as caught:
            solver.parse({"te": 0.03, "exocarp_thickness": 0.05}, preset)
        assert str(caught.value) == "a value is given twice, as te and exocarp_thickness. Leave one of them out."


def test_what_is_said_goes_over_a_preset_by_whatever_name():
    solver = registry.get("dehydration")
    short, long = ({**solver.presets["plum1"], "te": 0.05}, {"te": 0.05, "r2": 0.9, "gamma": 30.0})
    assert solver.parse({"te": 0.05}, "plum1").axis("te") == 0.05
    assert solver.params.over(short, {"exocarp_thickness": 0.03}) == {
        **solver.presets["plum1"],
        "exocarp_thickness": 0.03,
    }
    assert solver.params.over(long, {"radii": [1.0] * 8}) == {"te": 0.05, "gamma": 30.0, "radii": [1.0] * 8}
    # an entry leaves the rest of its field
    assert solver.params.over({"radii": [1.0] * 8}, {"r2": 0.9}) == {"radii": [1.0] * 8, "r2": 0.9}
    assert solver.parse({"stone": [0.3, 0.3], "rs1": 0.35}).stone == (0.35, 0.3)


@pytest.mark.parametrize("values", [{"gamma": True}, {"seed": True}, {"rs1": False}, {"stone": [True, 0.4]}])
def test_a_truth_value_is_no_number(values):
    with pytest.raises(InvalidInput, match=f"{next(iter(values))}: a truth value is no number"):
        registry.get("dehydration").parse(values)


def test_a_truth_value_is_one_where_one_is_wanted():
    assert registry.get("growth").parse({"curved": True}).curved


def test_cost_grows_with_quality(solver):
    params, need, dear = small(solver)
    cheap = solver.cost(params, solver.settle(need))
    costly = solver.cost(params, solver.settle(dear.model_copy(update={"quality": "fine"})))
    assert 0 <= cheap.seconds < costly.seconds
    assert 0 < cheap.bytes < costly.bytes


def test_no_nan_leaves(solver):
    params, need, _ = small(solver)
    result = solved(solver.name)
    broken = result.assign(residual=result.residual * np.nan)
    with pytest.raises(Unstable, match="residual"):
        finish(broken, solver, params, solver.settle(need))


def test_errors_carry_code_and_advice():
    for kind in SolverError.__subclasses__():
        assert kind.code != SolverError.code
    assert str(InvalidInput("no.", advice="Yes.")) == "no. Yes."


@pytest.mark.parametrize(
    ("values", "advice"),
    [
        ({"te": 9}, "Give te (exocarp_thickness) at most 0.2."),
        ({"exocarp_thickness": 9}, "Give exocarp_thickness at most 0.2."),
        ({"r4": -1}, "Give r4 (radii.3) at least 0.2."),
        (
            {"te": "thin", "gamma": -1},
            "Give te (exocarp_thickness) a finite number. Give gamma (modulus_ratio) at least 1.",
        ),
        ({"seed": 1.5}, "Give seed a whole number."),
        ({"gamma": float("nan")}, "Give gamma (modulus_ratio) a finite number."),
    ],
)
def test_what_is_off_its_bounds_says_what_to_give(values, advice):
    with pytest.raises(InvalidInput) as found:
        registry.get("dehydration").parse(values)
    assert found.value.advice == advice
    with pytest.raises(InvalidInput) as found:
        Need.parse({"resolution": 2})
    assert found.value.advice == "Give resolution at least 4."


def test_a_quantity_has_one_meaning():
    with pytest.raises(ValueError, match="already registered"):
        register(residual=Quantity("m", "something else", "r"))


def test_unknown_solver_and_preset_get_a_hint():
    with pytest.raises(InvalidInput, match="did you mean 'dehydration'"):
        registry.get("dehydratoin")
    with pytest.raises(InvalidInput, match="did you mean 'sphere'"):
        registry.get("dehydration").parse({}, preset="spere")


def test_a_path_into_a_group_is_no_name_and_gets_a_hint():
    wood = registry.get("wood")
    with pytest.raises(InvalidInput, match=r"grain is one value, grain={\"spiral\": ...}, an object of") as found:
        wood.parse({"grain.spiral": 1.0})
    assert "known:" not in str(found.value)
    with pytest.raises(InvalidInput, match=r"'rods\.spiral'; known: "):
        wood.parse({"rods.spiral": 1.0})


@pytest.mark.parametrize(
    ("tool", "said"),
    [
        (
            {"kind": "spott", "at": [0, 0, 1]},
            r"tools\.0: there is no kind 'spott'; did you mean 'spot'\? known: spot, ",
        ),
        ({"at": [0, 0, 1]}, r"tools\.0: it does not say of which kind it is\. Give tools\.0 a kind\."),
        ({"kind": "surface", "where": {"kind": "x"}}, r"where: there is no kind 'x'; known: everywhere, "),
    ],
)
def test_a_wrong_kind_is_told_with_those_that_there_are(tool: dict[str, object], said: str) -> None:
    with pytest.raises(InvalidInput, match=said):
        registry.get("growth").parse({"tools": [tool]})
