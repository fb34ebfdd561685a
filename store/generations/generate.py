"""The writing of one generation of a table: spectra of all samples and stages, their axes and descriptors.

Spectra lie uncompressed, contiguous and aligned, so that a reader maps them instead of loading them.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import h5netcdf  # type: ignore[import-untyped]
import numpy as np

from solver import __version__, quantities
from solver.arrays import Array
from solver.contract import Solver

from ..blending import methods
from ..blending.blend import Blender, powers
from ..blending.methods import products
from ..blending.methods.bands import Bands
from ..blending.methods.weights import Samples as Points
from ..canonical import canonical
from ..errors import MixedSamples, StorageFull
from ..store import Store
from ..surfaces import packed, spectra
from ..surfaces.measures import UNITS, Measures
from . import trust
from .generation import CONVERGENCE, DIMS, PACKED, combined, map_spectra
from .output import Output
from .samples import Samples

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Source", "Taken", "Written", "axis", "results", "spectra_of", "write"]

_PAGE = 4096
#: What a result says per stage: name -> values and attributes.
Rows = dict[str, "xr.Variable"]


class Taken(NamedTuple):
    """What a generation takes of a sample: its rows, and its waves (stage, component, m, k, part) in float64."""

    rows: Rows
    waves: Array


class Source(NamedTuple):
    """What a generation is made of: samples, and what is taken of each, one after the other, up to a band.

    `lost` is how far (rms, largest) [r1] packing has moved their surfaces already.
    """

    samples: Samples
    taken: Callable[[int], Iterator[Taken]]
    lost: tuple[float, float] = (0.0, 0.0)


class Written(NamedTuple):
    """What came of a file: the digest of its content and the names of the descriptors in it."""

    digest: str
    descriptors: tuple[str, ...]


def results(store: Store, samples: Samples) -> Source:
    """Return the results of samples as what a generation is made of.

    Raises:
        UnknownJob: when they are taken: a result is gone.
        CorruptShard: a result is damaged.
        MixedSamples: a result is not what its need says.

    """

    def taken(band: int) -> Iterator[Taken]:
        for key in samples.keys:
            result = store.get(key)
            yield Taken(_rows(result), spectra_of(result, key, samples.need, band))

    return Source(samples, taken)


def write(
    path: Path, source: Source, solver: Solver, band: int, dtype: Literal["int16", "float32", "float64"]
) -> Written:
    """Write the generation of a source to `path`, one sample in memory at a time.

    Raises:
        StorageFull: the disk is full.
        StoreError: as its source says.

    """
    samples = source.samples
    shape = (len(samples.keys), len(samples.need["stages"]), 3, band + 1, band + 1, 2)
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    if shutil.disk_usage(path.parent).free < size:
        raise StorageFull(f"a table of {size / 1e6:.0f} MB does not fit on the disk of {path}.", "Free space first.")
    rows: list[Rows] = []

    def blocks() -> Iterator[Array]:
        for sample in source.taken(band):
            rows.append(sample.rows)
            yield sample.waves

    total = hashlib.sha256()
    more: dict[str, Any] = {}
    stored: packed.Packed | None = None
    with (
        Output(path) as output,
        h5netcdf.File(output, "w", alignment_threshold=_PAGE, alignment_interval=_PAGE) as file,
    ):
        if dtype == "int16":
            whole = [block.astype(np.float32) for block in blocks()]
            codes, lost = _encoded(whole)
            file.dimensions = dict(zip(PACKED, codes.codes.shape, strict=True))
            target = _spectrum(file, PACKED, dtype)
            _state_loss(target, np.add(lost, source.lost))
            more, stored = _packing(codes), packed.Packed(codes)
            written: Iterable[Array] = codes.codes
        else:
            file.dimensions = dict(zip(DIMS, shape, strict=True))
            target = _spectrum(file, DIMS, dtype)
            if any(source.lost):
                _state_loss(target, source.lost)
            written = (block.astype(dtype) for block in blocks())
        for i, block in enumerate(written):
            total.update(block.data)
            target[i] = block
            output.check()
    output.check()
    small = _small(samples, rows, solver, band).assign(more)
    small = small.assign(_judge(map_spectra(path) if stored is None else stored, samples, solver))
    content = combined(small, total.hexdigest())
    small.attrs["digest"] = content
    _append(path, small)
    return Written(content, tuple(name for name in rows[0] if name in small and name not in CONVERGENCE))


def _encoded(whole: list[Array]) -> tuple[packed.Codes, tuple[float, float]]:
    """Pack spectra, and say what they lose.

    Of those that are all zero one wave is kept, for what has no bytes cannot be mapped.
    """
    codes, lost = packed.within(whole)
    if codes.place.size:
        return codes, lost
    return codes._replace(codes=np.zeros((*codes.codes.shape[:2], 1), np.int16), place=np.zeros(1, np.int32)), lost


def _append(path: Path, small: xr.Dataset) -> None:
    """Write what is beside the spectra into the file that holds them."""
    from xarray.backends import H5NetCDFStore

    encoding: dict[Any, dict[str, Any]] = {name: {"_FillValue": None} for name in small.variables}
    for name in ("key", "component", "part"):
        encoding[name]["dtype"] = "S1"
    with Output(path) as output, h5netcdf.File(output, "r+") as file:
        small.dump_to_store(H5NetCDFStore(file), encoding=encoding)
    output.check()


def _spectrum(file: Any, dims: tuple[str, ...], dtype: str) -> Any:
    target = file.create_variable("spectrum", dims, dtype)
    target.attrs["units"] = quantities.QUANTITIES["displacement"].units
    target.attrs["long_name"] = "double-Fourier-sphere amplitudes of the displacement, see `store.surfaces`" + (
        "; times wave_step of their shell" if dims == PACKED else ""
    )
    return target


def _state_loss(target: Any, lost: Iterable[float]) -> None:
    target.attrs["rms_loss"], target.attrs["max_loss"] = lost


def _packing(codes: packed.Codes) -> dict[str, xr.Variable]:
    """Return what packed spectra are read with."""
    import xarray as xr

    place = {"units": "1", "long_name": "place of a wave among the flat (component, m, k, part); all others are zero"}
    step = {
        "units": quantities.QUANTITIES["displacement"].units,
        "long_name": "what one step of the spectrum is, by the larger of m and k",
    }
    return {"wave_place": xr.Variable("wave", codes.place, place), "wave_step": xr.Variable("m", codes.step, step)}


def spectra_of(result: xr.Dataset, key: str, need: Mapping[str, Any], band: int) -> Array:
    """Return (stage, component, m, k, part) in float64 of a result.

    Raises:
        MixedSamples: it is not what its need says.

    """
    n = need["resolution"]
    stages = result["stage"].values
    if stages.shape != (len(need["stages"]),) or not np.allclose(stages, need["stages"], rtol=0, atol=1e-9):
        raise MixedSamples(
            f"the result {key} has the stages {stages.tolist()}, not {need['stages']}.",
            "Run it again, or leave it out by building from a plan without it.",
        )
    field = result["displacement"].transpose("stage", "component", "colatitude", "azimuth").values
    if field.shape[1:] != (3, n, 2 * n):
        raise MixedSamples(f"the result {key} is not on the lattice of {n}.", "Run it again over the whole surface.")
    waves = spectra.truncate(spectra.spectrum(field.astype(np.float64)), band)
    return np.ascontiguousarray(waves).view(np.float64).reshape(*waves.shape, 2)


def _rows(result: xr.Dataset) -> Rows:
    """Return what a result says per stage: convergence and descriptors, but not the wall time."""
    volatile = {name for name, quantity in quantities.QUANTITIES.items() if quantity.volatile}
    return {str(n): v.variable for n, v in result.data_vars.items() if v.dims == ("stage",) and n not in volatile}


def _small(samples: Samples, rows: list[Rows], solver: Solver, band: int) -> xr.Dataset:
    """Return all but the spectra as a dataset."""
    import xarray as xr

    waves = np.arange(band + 1)
    units = solver.axis_units()
    axes = {name: axis(samples, name, units) for name in samples.axes}
    common = [name for name in rows[0] if all(name in row for row in rows)]
    data = {
        name: (("sample", "stage"), np.array([row[name].values for row in rows]), dict(rows[0][name].attrs))
        for name in common
    }
    coords = {
        "stage": (
            "stage",
            np.array(samples.need["stages"]),
            quantities.attrs("stage") | {"units": solver.stages.units},
        ),
        "component": ("component", ["x", "y", "z"], quantities.attrs("component")),
        "m": ("m", waves, {"units": "1", "long_name": "azimuthal wavenumber"}),
        "k": ("k", waves, {"units": "1", "long_name": "colatitudinal wavenumber: cosine for even m, sine for odd m"}),
        "part": ("part", ["real", "imag"], {"long_name": "part of the complex amplitude"}),
        "key": ("sample", list(samples.keys), {"long_name": "key of the result"}),
        **axes,
    }
    attrs = {
        "title": f"look-up table of {solver.name}",
        "history": f"built from {len(samples.keys)} results by wizen {__version__}",
        "solver": solver.name,
        "solver_version": samples.version,
        "params": canonical(samples.template).decode(),
        "fixed": canonical(samples.fixed).decode(),
        "need": canonical(samples.need).decode(),
        "Conventions": "CF-1.11",
    }
    return xr.Dataset(data, coords, attrs)


def _judge(stored: packed.Stored, samples: Samples, solver: Solver) -> dict[str, xr.Variable]:
    """Return what look-ups want to know of the spectra: power by degree, products, errors, likeness of neighbours."""
    import xarray as xr

    power = _rounded(powers(stored))
    found = {
        "degree_power": xr.Variable(
            ("sample", "stage", "degree"),
            power,
            {"units": "1", "long_name": "mean square displacement by spherical-harmonic degree, in units of r1^2"},
        )
    }
    points, shapes = samples.points(), samples.fresh(solver.surface)
    if points is None or shapes is None:
        return found
    known = None
    if len(points) <= products.MOST:
        bands = Bands(stored.shape[-2] - 1)
        known = _rounded(products.all_of(stored, bands))
        about = {"units": "1", "long_name": "mean products of wrinkles by band, of a stage and with the next, in r1^2"}
        found["band_products"] = xr.Variable(("ahead", "stage", "sample", "other", "band"), known, about)
        about = {"units": "1", "long_name": "first spherical-harmonic degree of a band"}
        found["band"] = xr.Variable("band", bands.first, about)
    scattered, method = Points(points), methods.parse(methods.DEFAULT)
    blender = Blender(stored, scattered, power, known)
    told = {
        "left_out": (
            trust.leave_one_out(blender, stored, scattered, shapes, method),
            "of the sample predicted from the others",
        ),
        "skipped": (
            trust.skip_a_stage(blender, stored, scattered, shapes, samples.need["stages"], method),
            "of the stage predicted from those beside it",
        ),
    }
    found |= {
        f"{kind}_{name}": xr.Variable(
            ("sample", "stage"),
            _rounded(measures[..., i]),
            {**quantities.unit_attrs(UNITS[name]), "long_name": f"{name} {what}", "method": str(method)},
        )
        for kind, (measures, what) in told.items()
        if measures is not None
        for i, name in enumerate(Measures._fields)
    }
    likeness = trust.correlations(stored, scattered, shapes)
    about = {"units": "1", "long_name": "mean correlation of the radial wrinkles of neighbouring samples"}
    return found | {"neighbour_correlation": xr.Variable("stage", _rounded(likeness), about)}


def _rounded(values: Array) -> Array:
    """Keep five digits: the last bits of sums differ between processors, and the digest should not."""
    scale = 10.0 ** (4 - np.floor(np.log10(np.maximum(np.abs(values), 1e-300))))
    return (np.round(values * scale) / scale).astype(np.float32)


def axis(samples: Samples, name: str, units: Mapping[str, str]) -> tuple[str, Array, dict[str, str]]:
    """Return an axis of samples as a variable over them."""
    field, index = samples.axes[name]
    where = field if index is None else f"{field}[{index}]"
    attrs = {"long_name": f"parameter {where}"}
    if name in units:
        attrs |= quantities.unit_attrs(units[name])
    return "sample", np.array([values[name] for values in samples.values]), attrs
