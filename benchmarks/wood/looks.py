"""A stick that snaps and one that tears, drawn and in numbers: python -m benchmarks.wood.looks [--picture OUT.png].

`examples/wood/brash.toml` and `fibrous.toml` are bent over a knee. Of each seed: how far along the stick rods broke
(between the tenth and the ninetieth percentile of the places, as laid), how far apart breaks of rods that stood beside
each other are in the mean, which is how long the splinters are, over the stick's thickness; and the area of cracks
along the grain over that of the section. What crumbles under the grips, within 2 cm of the ends, is left out of places
and splinters. --picture draws the first seed and keeps nothing.
"""

from __future__ import annotations

import argparse
import time
import tomllib
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.spatial import cKDTree

from benchmarks.figures import ROOT, Sheet
from solver.contract import Need
from solver.wood import SOLVER, WoodParams
from solver.wood.model.bundle import lay

_STICKS, _STAGES = ("brash", "fibrous"), (0.02, 0.04, 0.06)
_FIELDS = ("broken_rods", "broken_bonds", "crack_area", "rod_position", "rod_cut", "fragments", "fragment_length")
_HEAD = ("stick", "seed", "breaks of rods", "of bonds", "rods broke within [mm]", "splinters [mm]",
         "over the thickness", "cracks along over the section", "fragments over 1 cm", "CPU s")  # fmt: skip
#: Ends of edges farther apart than this [m] are parted.
_PARTED = 1e-9
#: How far from the ends [m] grips crush rods.
_GRIPPED = 0.02


def stick(name: str, seed: int) -> WoodParams:
    """Return the parameters of a stick."""
    values = tomllib.loads((ROOT / "examples" / "wood" / f"{name}.toml").read_text())
    params = SOLVER.parse({**values, "seed": seed})
    assert isinstance(params, WoodParams)
    return params


def breaks(found: xr.Dataset, params: WoodParams) -> tuple[np.ndarray, np.ndarray]:
    """Return rod (n,) and place along the stick as laid (n,) [m] of every break at the last stage."""
    wood = lay(params, found.attrs["vertices"])
    real = wood.rods.k > 0
    rod, first = wood.rod[real], wood.straight[wood.rods.a[real], 0]
    last, cut = wood.straight[wood.rods.b[real], 0], found.rod_cut.values[-1]
    ends = found.rod_position.values[-1]
    severed = np.flatnonzero(cut >= 0)
    gap = np.linalg.norm(ends[1:, 0] - ends[:-1, 1], axis=1)
    split = np.flatnonzero((gap > _PARTED) & (rod[1:] == rod[:-1]) & (cut[1:] < 0) & (cut[:-1] < 0))
    places = np.append(first[severed] + cut[severed] * (last - first)[severed], last[split])
    whose, held = np.append(rod[severed], rod[split]), _GRIPPED
    free = (places > held) & (places < params.length - held)
    return whose[free], places[free]


def splinters(rod: np.ndarray, place: np.ndarray, params: WoodParams, vertices: int) -> float:
    """Return the mean way along [m] from a break to the nearest one of each rod that stands beside."""
    wood = lay(params, vertices)
    feet = wood.straight[wood.grid[:, 0], 1:]
    near = 1.7 * float(np.median(cKDTree(feet).query(feet, 2)[0][:, 1]))
    ways = []
    for one, other in cKDTree(feet).query_pairs(near):
        mine, theirs = place[rod == one], place[rod == other]
        if len(mine) and len(theirs):
            ways.append(np.abs(mine[:, None] - theirs[None]).min(1).mean())
    return float(np.mean(ways)) if ways else 0.0


def main(seeds: list[int]) -> None:
    """Print a row for every stick and seed."""
    sheet = Sheet("wood-looks", _HEAD, "wood")
    for name in _STICKS:
        for seed in seeds:
            params, begun = stick(name, seed), time.process_time()
            found = SOLVER.solve(params, Need(stages=_STAGES, quality="preview", fields=_FIELDS))
            cpu = time.process_time() - begun
            rod, place = breaks(found, params)
            zone = float(np.subtract(*np.percentile(place, (90, 10))))
            long = splinters(rod, place, params, found.attrs["vertices"])
            cracks = float(found.crack_area[-1]) / (np.pi * params.radius**2)
            pieces = int((found.fragment_length.values[-1] > 0.01).sum())
            broken, bonds = int(found.broken_rods[-1]), f"{int(found.broken_bonds[-1])} of {found.attrs['bonds']}"
            sheet.add(
                (name, seed, broken, bonds, f"{1e3 * zone:.0f}", f"{1e3 * long:.1f}",
                 f"{long / (2 * params.radius):.2f}", f"{cracks:.1f}", pieces, f"{cpu:.0f}"),
                stick=name, seed=seed, broken_rods=broken, broken_bonds=int(found.broken_bonds[-1]), zone_m=zone,
                splinter_m=long, cracks_over_section=cracks, fragments=pieces, balance=float(found.residual.max()),
                cpu_s=cpu,
            )  # fmt: skip
            sheet.keep()


def _drawn(out: Path) -> None:
    """Draw both sticks at all stages, a row each."""
    from sweeps.outputs import triangles
    from sweeps.pictures.sheet import sheet

    need = Need(stages=_STAGES, quality="preview", fields=("mesh_position", "inside", "body"))
    rows = [list(triangles(SOLVER.solve(stick(name, 0), need))) for name in _STICKS]
    above = [f"t = {stage:g} s" for stage in _STAGES]
    out.write_bytes(sheet(rows, title="Snapped and torn", row_labels=list(_STICKS), column_labels=above, pixels=300))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2])
    parser.add_argument("--picture", type=Path, help="draw the first seed; keep nothing")
    asked = parser.parse_args()
    if asked.picture:
        _drawn(asked.picture)
    else:
        main(asked.seeds)
