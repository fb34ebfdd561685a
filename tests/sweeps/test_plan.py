from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import xarray as xr

from solver import registry
from store import starter
from store.store import Store
from sweeps.errors import PlanError
from sweeps.planning import points
from sweeps.planning.plan import Plan

EXAMPLES = Path(__file__).parents[2] / "examples"


def plan(**tables: Any) -> Plan:
    return Plan.parse({"solver": "dehydration", "preset": "sphere", **tables})


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.toml")), ids=lambda path: path.stem)
def test_examples_are_valid(path: Path) -> None:
    read = Plan.load(path)
    assert read.name == path.stem
    assert len({job.key for job in read.jobs()}) == len(read.samples) > 1


def test_figure_7() -> None:
    read = Plan.load(EXAMPLES / "fig7-right.toml")
    assert read.axes == ("te", "gamma")
    points = [(p.axis("te"), p.axis("gamma")) for p in read.samples]
    assert points == [(te, gamma) for te in (0.03, 0.04) for gamma in (10, 30, 50)]
    assert read.need.stages == (0.05, 0.1, 0.15, 0.2, 0.25, 0.3)


def test_shared_samples_share_keys() -> None:
    listed = plan(axes={"te": [0.02, 0.04, 0.1]})
    ranged = plan(axes={"te": {"from": 0.01, "to": 0.04, "count": 4}})
    full = plan(axes={"exocarp_thickness": [0.02]}, set={"radii": [1] * 8})
    keys = [{job.key for job in p.jobs()} for p in (listed, ranged, full)]
    assert len(keys[0] & keys[1]) == 2
    assert keys[2] < keys[0]


def test_generated_values_are_the_ones_that_people_write() -> None:
    """A division leaves 0.060000000000000005, whose key is another than that of 0.06."""
    ranged = plan(axes={"te": {"from": 0.01, "to": 0.1, "count": 10}})
    written = [0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1]
    assert [sample.model_dump()["exocarp_thickness"] for sample in ranged.samples] == written


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"need": {"tolerance": 0.5, "quality": "preview"}}, "[need]: a tolerance picks the quality"),
        ({"set": {"te": 0.03, "exocarp_thickness": 0.05}}, "twice, as te and exocarp_thickness"),
        ({"set": {"te": True}}, "te: a truth value is no number"),
    ],
)
def test_what_contradicts_itself_is_refused(tables: dict[str, Any], said: str) -> None:
    with pytest.raises(PlanError) as caught:
        plan(axes={"gamma": [10, 20]}, **tables)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    "values",
    [["xyz", "xy"], [[0, 0, 1], [0, 0, 2]], [True, False], ["0.04", "0.05"]],
    ids=["words", "lists", "truth", "text"],
)
def test_axes_are_of_numbers(values: list[Any]) -> None:
    with pytest.raises(PlanError, match=r"axes.te: an axis is of numbers; .*\[\[samples\]\]") as caught:
        plan(axes={"te": values})
    assert str(caught.value).count("axes.te") == 1


def test_hours_are_the_stages_that_they_come_to() -> None:
    """As of `wizen solve --hours`; an error is in the words of a plan."""
    solver, page = registry.get("dehydration"), {"kinetics": "page", "rate": 0.1, "exponent": 1, "moisture": 0.8}
    read = plan(need={"hours": [5, 10], "under": page})
    assert read.need.stages == solver.stages_after([5, 10], page, "sphere")
    assert read.jobs()[0].key == plan(need={"stages": list(read.need.stages)}).jobs()[0].key
    for need, said in (
        ({"hours": [5]}, r"under = \{kinetics = \"grape\"\}"),
        ({"hours": [5], "under": {"kinetics": "jujube"}}, r"under = \{temperature = 60, air_speed = 1"),
        ({"hours": [5], "stages": [0.1]}, "exclude each other"),
        ({"under": page}, "there are none"),
        ({"hours": 5}, r"hours = \[24, 48\]"),
        ({"hours": [5], "under": 3}, "under is a table"),
    ):
        with pytest.raises(PlanError, match=said):
            plan(need=need)


def test_an_empty_plan_says_how_to_begin() -> None:
    with pytest.raises(PlanError, match='begin with a line such as solver = "dehydration"'):
        Plan.parse({})


PATTERN = {"sample": {"te": 0.03}, "stage": 0.1, "controls": [{"te": 0.02}]}


def test_a_pattern_runs_first_and_is_part_of_the_samples_keys() -> None:
    axes = {"te": [0.02, 0.04]}
    read, cold = plan(axes=axes, pattern=PATTERN), plan(axes=axes)
    assert [part.name for part in read.parts()] == ["plan-pattern", "plan", "plan-controls"]
    first, samples, controls = (part.jobs() for part in read.parts())
    assert first[0].need["stages"] == [0.1]
    assert all(job.params["pattern"] == {"key": first[0].key, "stage": 0.1, "amplitude": 0.2} for job in samples)
    assert not {job.key for job in samples} & {job.key for job in cold.jobs()}
    assert {job.key for job in controls} < {job.key for job in cold.jobs()}
    assert cold.parts() == (cold,)


def test_a_pattern_in_the_package_is_begun_from_if_its_version_is_answered_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A new version keeps the wrinkles of the tables that it still answers from."""
    monkeypatch.setattr(starter, "ROOT", tmp_path / "package")
    package, solver = Store.open(starter.ROOT, create=True), registry.get("dehydration")

    def begun(version: str, tables_of: tuple[str, ...]) -> str:
        monkeypatch.setattr(registry, "get", lambda name: replace(solver, version=version, tables_of=tables_of))
        first, samples, _ = plan(axes={"te": [0.02]}, pattern=PATTERN).parts()
        (job,), (sample,) = first.jobs(), samples.jobs()
        assert sample.params["pattern"]["key"] == job.key
        assert sample.version == version
        if job.version == version:
            return "its own"
        assert package.has(job.key)
        return f"that of {job.version}"

    (pattern,) = plan(axes={"te": [0.02]}, pattern=PATTERN).parts()[0].jobs()
    assert begun("98", (solver.version,)) == "its own"  # there is none
    package.put(pattern.key, xr.Dataset())
    assert begun("98", (solver.version,)) == f"that of {solver.version}"
    assert begun("98", ()) == "its own"  # of other equations
    assert begun(solver.version, ()) == "its own"


@pytest.mark.parametrize(
    ("pattern", "message"),
    [
        (PATTERN | {"sample": {"tee": 0.03}}, r"\[pattern.sample\]: dehydration has no parameter 'tee'"),
        (PATTERN | {"controls": [{"x": 1}]}, r"\[pattern.controls 1\]"),
        (PATTERN | {"stage": 3.0}, r"\[pattern\]: stage 3 lies outside"),
        (PATTERN | {"amplitude": 7.0}, r"\[pattern\]: pattern.amplitude"),
        (PATTERN | {"stge": 3.0}, "unknown name 'pattern.stge'"),
    ],
)
def test_wrong_patterns_are_refused(pattern: dict[str, Any], message: str) -> None:
    with pytest.raises(PlanError, match=message):
        plan(axes={"te": [0.02]}, pattern=pattern)


def test_jobs_are_repeatable_and_distinct() -> None:
    read = plan(axes={"te": [0.02, 0.02, 0.03], "seed": [0, 1]})
    assert [job.key for job in read.jobs()] == [job.key for job in read.jobs()]
    assert len(read.samples) == 4
    assert read.repeated == 2
    assert read.jobs()[1].params["seed"] == 1


def test_logarithmic_range() -> None:
    read = plan(axes={"gamma": {"from": 1, "to": 100, "count": 3, "scale": "log"}})
    assert [p.axis("gamma") for p in read.samples] == [1, 10, 100]


def test_sobol_stays_inside_and_grows() -> None:
    axes = {"te": {"from": 0.01, "to": 0.04}, "gamma": {"from": 1, "to": 100, "scale": "log"}, "rs1": [0.3, 0.5]}
    few = plan(axes=axes, sampling={"kind": "sobol", "count": 5, "seed": 3})
    many = plan(axes=axes, sampling={"kind": "sobol", "count": 16, "seed": 3})
    assert many.samples[:5] == few.samples
    for sample in many.samples:
        assert 0.01 <= sample.axis("te") <= 0.04
        assert 1 <= sample.axis("gamma") <= 100
        assert 0.3 <= sample.axis("rs1") <= 0.5
    # a logarithmic axis has as many samples below its middle as above
    assert sum(p.axis("gamma") < 10 for p in many.samples) == 8
    other = plan(axes=axes, sampling={"kind": "sobol", "count": 5, "seed": 4})
    assert other.samples != few.samples


def test_listed_samples() -> None:
    read = plan(sampling={"kind": "list"}, samples=[{"te": 0.02, "gamma": 30}, {"te": 0.03}])
    assert [(p.axis("te"), p.axis("gamma")) for p in read.samples] == [(0.02, 30), (0.03, 10)]
    assert read.axes == ("te", "gamma")


def test_impossible_samples_are_skipped_only_when_told() -> None:
    axes = {"rs1": [0.4, 0.99], "te": [0.03, 0.04]}
    with pytest.raises(PlanError, match=r"rs1 = 0.99, te = 0.03: the stone .* skip_invalid"):
        plan(axes=axes)
    assert plan(axes=axes, sampling={"skip_invalid": True}).skipped == 2
    with pytest.raises(PlanError, match=r"none of the 1 combinations .* too little flesh"):
        plan(axes={"rs1": [0.99]}, sampling={"skip_invalid": True})
    # no range would help
    free = {"axes": {"r2": [0.8, 0.9]}, "set": {"mirrors": "xyz"}, "sampling": {"skip_invalid": True}}
    with pytest.raises(PlanError, match=r"none of the 2 .* leave y out of mirrors"):
        plan(**free)


@pytest.mark.parametrize(("low", "high", "waste"), [(0.6, 1.2, 0.7), (0.7, 1.1, 0.2)])
def test_no_sample_of_free_radii_is_wasted(low: float, high: float, waste: float) -> None:
    axes = {f"r{i}": {"from": low, "to": high} for i in range(2, 8)}
    sampling = {"kind": "sobol", "count": 12, "skip_invalid": True}
    read = plan(axes=axes, sampling=sampling)
    assert len(read.samples) == 12
    # this share of the points was lost before, or refused the plan
    assert read.skipped / (read.skipped + 12) > waste
    assert plan(axes=axes, sampling={**sampling, "count": 5}).samples == read.samples[:5]
    with pytest.raises(PlanError, match="skip_invalid"):
        plan(axes=axes, sampling={**sampling, "skip_invalid": False})


def test_radii_of_which_none_is_possible() -> None:
    axes = {"r2": [0.2, 0.25], "r4": [1.9, 2.0]}
    with pytest.raises(PlanError, match="none of the 200"):
        plan(axes=axes, sampling={"kind": "sobol", "count": 1, "skip_invalid": True})


def test_a_value_out_of_range_is_never_skipped() -> None:
    with pytest.raises(PlanError, match=r"te = 0\.9"):
        plan(axes={"te": [0.02, 0.9]}, sampling={"skip_invalid": True})


def test_a_plan_without_axes_is_one_sample() -> None:
    assert len(plan().jobs()) == 1


def test_the_need_is_settled() -> None:
    need = plan(need={"quality": "preview"}).need
    assert need.resolution == 64
    assert need.fields == tuple(sorted(registry.get("dehydration").default_fields))


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"solver": "dehydratoin"}, "did you mean 'dehydration'"),
        ({"solver": 3}, "solver:"),
        ({"preset": "spere"}, "did you mean 'sphere'"),
        ({"axis": {"te": [0.02]}}, "Did you mean 'axes'"),
        ({"axes": {"gama": [10]}}, "Did you mean 'gamma'"),
        ({"set": {"thickness": 1}}, "Did you mean 'exocarp_thickness'"),
        ({"axes": {"te": {"from": 0.01, "to": 0.02, "cuont": 4}}}, "Did you mean 'count'"),
        ({"axes": {"te": {"from": 0.01, "to": 0.02}}}, "needs a count"),
        ({"axes": {"te": {"from": 0.02, "to": 0.01, "count": 2}}}, "smaller to a larger"),
        ({"axes": {"te": {"from": 0, "to": 0.01, "count": 2, "scale": "log"}}}, "above zero"),
        ({"axes": {"te": {"from": 0.01, "to": 0.02, "count": 10**9}}}, "samples, more than"),
        ({"axes": {"te": []}}, "no values"),
        ({"axes": {"te": "thin"}}, "a list of numbers, or"),
        ({"axes": {"te": ["thin"]}}, "axes.te: an axis is of numbers"),
        ({"axes": {"te": [float("nan")]}}, "axes.te.0"),
        ({"axes": {"te": [0.02]}, "set": {"exocarp_thickness": 0.03}}, "under .set. and under .axes."),
        ({"axes": {"te": [0.02], "exocarp_thickness": [0.03]}}, "same parameter"),
        ({"axes": {"te": [0.9]}}, "te = 0.9"),
        ({"need": {"stage": [0.1]}}, "did you mean 'stages'"),
        ({"need": {"stages": [0.9]}}, "lies outside"),
        ({"need": {"fields": ["displacment"]}}, "did you mean 'displacement'"),
        ({"sampling": {"kind": "random"}}, "sampling.kind"),
        ({"sampling": {"kind": "sobol"}, "axes": {"te": [0.01, 0.02]}}, "needs a count"),
        ({"sampling": {"kind": "sobol", "count": 4}}, "needs .axes."),
        ({"sampling": {"kind": "sobol", "count": 4}, "axes": {"te": [0.01]}}, "two ends"),
        ({"sampling": {"count": 4}}, "belong to"),
        ({"sampling": {"kind": "list"}}, "at least one"),
        ({"samples": [{"te": 0.01}]}, 'need kind = "list"'),
        ({"sampling": {"kind": "list"}, "samples": [{"te": 0.01, "gama": 3}]}, "samples 1.*Did you mean 'gamma'"),
    ],
)
def test_errors_say_where_and_what(tables: dict[str, Any], said: str) -> None:
    with pytest.raises(PlanError, match=said) as caught:
        plan(**tables)
    assert caught.value.code == "invalid-plan"
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("most", "fits"), [(6, True), (5, False)])
@pytest.mark.parametrize("kind", ["grid", "range", "sobol"])
def test_a_plan_may_have_so_many_samples(monkeypatch: pytest.MonkeyPatch, kind: str, most: int, fits: bool) -> None:
    monkeypatch.setattr(points, "MAX_SAMPLES", most)
    box = {"te": {"from": 0.02, "to": 0.06}}
    asked: dict[str, Any] = {
        "grid": {"axes": {"te": [0.02, 0.03], "gamma": [10, 20, 30]}},
        "range": {"axes": {"te": {**box["te"], "count": 6}}},
        "sobol": {"axes": box, "sampling": {"kind": "sobol", "count": 6}},
    }[kind]
    if fits:
        assert len(plan(**asked).samples) == 6
    else:
        with pytest.raises(PlanError, match="6 samples, more than 5"):
            plan(**asked)


def test_files_that_are_no_plans(tmp_path: Path) -> None:
    with pytest.raises(PlanError, match="there is no plan"):
        Plan.load(tmp_path / "missing.toml")
    with pytest.raises(PlanError, match="cannot be read"):
        Plan.load(tmp_path)
    for content in (b"solver = ", b"\xff\xfe"):
        (tmp_path / "bad.toml").write_bytes(content)
        with pytest.raises(PlanError, match="is not TOML"):
            Plan.load(tmp_path / "bad.toml")


@pytest.mark.parametrize("name", ["queue", "queue:refined"])
def test_no_plan_joins_the_service_s_queue(tmp_path: Path, name: str) -> None:
    path = tmp_path / f"{name}.toml"
    path.write_text('solver = "dehydration"\n')
    for read in (lambda: Plan.load(path), lambda: plan(name=name), lambda: replace(plan(), name=name)):
        with pytest.raises(PlanError, match="Say another `name`"):
            read()
    assert plan(name="queues").name == "queues"
