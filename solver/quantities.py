"""Every variable that may appear in a result: its units, its name in words and its symbol. Written here only.

Lengths are in units of the fruit's reference radius r1 = 1 (multiply by the real radius to get metres); stresses in
units of the sarcocarp's shear modulus. Units follow UDUNITS, so that CF readers understand them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

__all__ = ["QUANTITIES", "Quantity", "attrs", "in_words", "register", "unit_attrs"]

#: Tenths of a logarithm to the base of ten, as UDUNITS reads them.
_DECIBELS = "0.1 lg(re 1)"


class Quantity(NamedTuple):
    """Units, long name and symbol of one variable; `volatile` ones differ between identical runs (wall time).

    `share`: it runs from 0 to 1 by its meaning, so pictures of it need no other range unless it goes beyond.
    """

    units: str
    long_name: str
    symbol: str
    volatile: bool = False
    share: bool = False


QUANTITIES: dict[str, Quantity] = {}


def register(**entries: Quantity) -> None:
    """Add variables; a name has one meaning in the whole project.

    Raises:
        ValueError: the name is taken with another meaning.

    """
    for name, quantity in entries.items():
        if QUANTITIES.setdefault(name, quantity) != quantity:
            raise ValueError(f"{name} is already registered as {QUANTITIES[name]}")


def attrs(name: str) -> dict[str, str]:
    """Return the netCDF attributes of a variable.

    Raises:
        KeyError: the variable was never registered, so nobody said what it means.

    """
    quantity = QUANTITIES[name]
    return {"units": quantity.units, "long_name": quantity.long_name, "symbol": quantity.symbol}


def unit_attrs(units: str) -> dict[str, str]:
    """Return the netCDF attributes that say a unit in words that UDUNITS reads, as the CF conventions ask.

    A length over the fruit's own, `r1`, is a number: what it was divided by is named beside it. Decibels are tenths of
    a logarithm to the base of ten.
    """
    if units == "dB":
        return {"units": _DECIBELS}
    if "r1" in units or "shape's unit" in units:
        return {"units": "1", "normalised_by": units}
    return {"units": units}


def in_words(attrs: Mapping[str, Any]) -> str:
    """Return the unit that netCDF attributes say, as people write it: the other way round from `unit_attrs`."""
    said = str(attrs.get("normalised_by", attrs.get("units", "")))
    return "dB" if said == _DECIBELS else said


# axes and convergence data that every solver shares
register(
    stage=Quantity("1", "position on the solver's stage axis", "s"),
    colatitude=Quantity("radian", "colatitude of the spline parameter, from the pole y > 0", "theta"),
    azimuth=Quantity("radian", "azimuth about the y axis, from x towards z", "phi"),
    component=Quantity("1", "Cartesian component", "i"),
    converged=Quantity("1", "the stage met its limits of residual and motion", "-"),
    residual=Quantity(
        "1",
        "out-of-balance force over internal force or, if larger, rms share that rest volumes lag; or the largest error "
        "of a step, relative L2",
        "|r|/|f|",
    ),
    moved=Quantity("1", "how far relaxing moved a surface: rms of the radial motion over its roughness", "d/r"),
    residual_placed=Quantity("1", "residual of a surface as it was put on the mesh, before it was relaxed", "|r|/|f|"),
    drift=Quantity("1", "rms motion of the surface in its last 200 steps, in exocarp thicknesses", "d"),
    iterations=Quantity("1", "steps or iterations spent up to and including this stage", "n"),
    seconds=Quantity("s", "wall time spent up to and including this stage", "t", volatile=True),
)

# surface of a fruit
register(
    position=Quantity("1", "position of the outer surface, in units of r1", "x"),
    displacement=Quantity("1", "displacement of the outer surface from the fresh shape, in units of r1", "u"),
    mean_radius=Quantity("1", "mean distance from the centre, weighted by the fresh area, in units of r1", "r_mean"),
    roughness=Quantity("1", "rms of the radial wrinkle amplitude (degrees l >= 3), in units of r1", "A_rms"),
    dominant_degree=Quantity("1", "power-weighted mean spherical-harmonic degree of the wrinkles (l >= 3)", "l"),
    wavelength=Quantity(
        "1", "wavelength of the dominant degree on a sphere of the mean radius, in units of r1", "lambda"
    ),
    buckle_count=Quantity("1", "number of separate inward buckles", "N"),
    ridge_anisotropy=Quantity(
        "1", "anisotropy of the wrinkle slope: +1 ridges along meridians, 0 reticular, -1 rings", "a"
    ),
    penetration=Quantity("1", "deepest crossing of two triangles of the finite-element surface, in units of r1", "g"),
    crossings=Quantity("1", "pairs of triangles of the finite-element surface that cross", "n_x"),
    lattice_penetration=Quantity("1", "deepest crossing of two triangles of the delivered lattice, in r1", "g_l"),
    lattice_crossings=Quantity("1", "pairs of triangles of the delivered lattice that cross", "n_l"),
    lattice_evened=Quantity(
        "1", "farthest that a point of the delivered lattice was moved off the solved surface, r1", "e"
    ),
    least_jacobian=Quantity("1", "least elastic volume ratio J/Jd of all integration points; inverted below 0", "J"),
    strain_energy=Quantity("1", "strain energy of the settled fruit, in units of mu r1^3, mu of the sarcocarp", "E"),
    released_energy=Quantity("1", "strain energy that settling released, in units of mu r1^3", "dE"),
    volume=Quantity("1", "volume enclosed by the outer surface, in units of r1^3", "V"),
)

# decay: maps on the surface, and what they come to
register(
    rot=Quantity("1", "soft rot, over what a nutrient of 1 can feed", "r", share=True),
    rot_age=Quantity("day", "time since the soft rot's map reached 0.1, 0 where it has not", "t_r"),
    substrate=Quantity("1", "nutrient left in the flesh, what the rot lives on", "n_r", share=True),
    mould=Quantity("1", "mould, active and inactive, over what a nutrient of 1 can feed", "m", share=True),
    mould_active=Quantity("1", "active mould, over what a nutrient of 1 can feed", "u", share=True),
    nutrient=Quantity("1", "nutrient left in the skin, what the mould lives on", "n", share=True),
    rotten_share=Quantity("1", "share of the surface with rot of at least 0.1", "A_r"),
    mouldy_share=Quantity("1", "share of the surface with mould of at least 0.1", "A_m"),
    mean_rot=Quantity("1", "area-weighted mean of the soft rot", "r_mean"),
    mean_mould=Quantity("1", "area-weighted mean of the mould", "m_mean"),
    mean_nutrient=Quantity("1", "area-weighted mean of the nutrient in the skin", "n_mean"),
    budget_error=Quantity("1", "what is missing of theta n + u + v, over what there was and was added", "e"),
    body_residual=Quantity("1", "out-of-balance force of the body over the forces in it, relative L2", "|r|/|f|"),
    body_steps=Quantity("1", "Newton steps of the body in this stage", "n"),
    skin_residual=Quantity("1", "out-of-balance force of the skin over the forces in it, relative L2", "|r|/|f|"),
    skin_steps=Quantity("1", "quasi-Newton steps of the skin in this stage", "n"),
    mass=Quantity("1", "weight of the fruit, over the fresh weight", "m"),
    juice_lost=Quantity("1", "juice that leaked from collapsed rot, over the fresh weight", "j"),
    respired=Quantity("1", "flesh that rot turned to carbon dioxide, over the fresh weight", "c"),
    density=Quantity("1", "weight over volume of the surface, over that of the fresh fruit", "rho"),
    fruit=Quantity("1", "number of the fruit that a vertex is of, from 0", "-"),
    fruit_rotten=Quantity("1", "share of each fruit's surface with rot of at least 0.1", "A_r"),
    fruit_mass=Quantity("1", "weight of each fruit, over its fresh weight", "m"),
    fruit_damp=Quantity("percent", "what the other fruits add to the humidity about each one", "dH"),
    fruit_water_lost=Quantity("1", "water that each fruit has lost, over its fresh weight", "X"),
    fruit_juice_lost=Quantity("1", "juice that has run out of each fruit, over its fresh weight", "J"),
    fruit_respired=Quantity("1", "what the rot of each fruit has respired, over its fresh weight", "R"),
    fruit_species=Quantity("1", "number of the kind whose organism lives on each fruit, -1 while it is sound", "-"),
    fruit_kind=Quantity("1", "number of the kind of each fruit, from 0", "-"),
    fruit_size=Quantity("1", "r1 of each fruit, over that of the parameters' own", "-"),
    fruit_headroom=Quantity("1", "least room above each fruit's stem, in r1", "-"),
    pole_vertex=Quantity("1", "vertices at each fruit's stem and at its other end", "-"),
    kind=Quantity("1", "number of the kind of the fruit that a vertex is of, from 0", "-"),
    living=Quantity("1", "number of the kind whose organism lives, or would live, on the fruit of a vertex", "-"),
    lost=Quantity("1", "water that the fruit of a vertex has lost, over its fresh weight", "X"),
    fresh_position=Quantity("1", "place on the fresh fruit in its own frame, in r1", "x"),
    overlap=Quantity("1", "how deep one fruit of a heap is in another, in floor or bowl at most, in r1", "o"),
    puddle=Quantity("1", "radius of the puddle of juice that leaked, in units of r1", "R_j"),
    flesh=Quantity("1", "1 on bare flesh, 0 on skin", "-", share=True),
    browned=Quantity("1", "how brown bare flesh is, over what it comes to in the end", "b", share=True),
    roasted=Quantity("1", "browning of the skin in an oven, over the colour of what is burnt", "b_r", share=True),
    flesh_temperature=Quantity("degC", "temperature of a point of the flesh", "T"),
    flesh_position=Quantity("1", "position of a point of the flesh, in units of r1", "x"),
    flesh_cell=Quantity("1", "the four points of a tetrahedron of the flesh, from 0", "-"),
    flesh_rot=Quantity("1", "soft rot in the flesh, over what a nutrient of 1 can feed", "r", share=True),
    flesh_nutrient=Quantity("1", "nutrient left in the flesh, point by point", "n_r", share=True),
    flesh_water=Quantity("1", "water of the flesh, over what it had when fresh", "w", share=True),
    water_lost=Quantity("1", "water evaporated from skin, wounds and rot, over the fresh weight", "w"),
)

# triangle meshes of a solver's own (see `solver.meshes`)
register(
    mesh_position=Quantity("1", "position of a vertex, in the solver's unit of length", "x"),
    triangle=Quantity("1", "the three vertices of a triangle, from 0, counter-clockwise from outside", "-"),
    texture_count=Quantity("1", "number of texture coordinates of this stage's mesh", "n_t"),
    texture_coordinate=Quantity("1", "texture coordinates of a corner, v upwards", "uv"),
    texture_triangle=Quantity("1", "the texture coordinates of a triangle's three corners, from 0", "-"),
    face_material=Quantity("1", "the material of a triangle, from 0, as named in the attribute materials", "-"),
    group_weight=Quantity("1", "weight of a vertex in a group, as named in the attribute groups", "w"),
    quad=Quantity("1", "the four vertices of a face as solved, whose triangles are (0, 1, 2) and (0, 2, 3)", "-"),
    vertex_count=Quantity("1", "number of vertices of this stage's mesh", "n_v"),
    face_count=Quantity("1", "number of triangles of this stage's mesh", "n_f"),
)

# growth: thin shells
register(
    elastic_strain=Quantity(
        "1", "mean principal stretch of the membrane less 1, averaged over a vertex's triangles", "e"
    ),
    sheet_thickness=Quantity("1", "thickness of the sheet at a vertex, in the start shape's unit", "h"),
    red=Quantity("1", "red of the surface, linear light", "R", share=True),
    green=Quantity("1", "green of the surface, linear light", "G", share=True),
    blue=Quantity("1", "blue of the surface, linear light", "B", share=True),
    rest_area=Quantity("1", "area of the grown rest state, in the start shape's unit squared", "A_g"),
    mesh_area=Quantity("1", "area of the shape, in the start shape's unit squared", "A"),
    stored_energy=Quantity("1", "elastic energy, membrane and bending, in units of mu l^2", "E"),
)

# wood: rods and bonds
register(
    kinetic_energy=Quantity("J", "kinetic energy of what is not held, bodies with a mass among it", "E_k"),
    elastic_energy=Quantity("J", "energy of stretching, bending, twist, bonds and contacts", "E_e"),
    lost_energy=Quantity("J", "energy lost by breaks, friction and damping since the start", "E_l"),
    work=Quantity("J", "work of loads, weight, grips and bodies on paths since the start", "W"),
    broken_rods=Quantity("1", "breaks of rods since the start", "n_r"),
    broken_bonds=Quantity("1", "bonds broken or left without a rod since the start", "n_b"),
    impulse=Quantity("N s", "impulse that the rigid bodies received from the rods since the start", "J"),
    body_impulse=Quantity("N s", "impulse that each rigid body received from the rods since the start", "J"),
    body_moment=Quantity(
        "N m s", "moment of impulse about its pivot that each rigid body received from the rods since the start", "L"
    ),
    grip_impulse=Quantity("N s", "impulse that each grip put in since the start", "J"),
    grip_moment=Quantity("N m s", "moment of impulse about its pivot that each grip put in since the start", "L"),
    body_force=Quantity("N", "mean force of the rods on each rigid body since the stage before", "F"),
    body_torque=Quantity("N m", "mean moment of the rods on each body about its pivot since the stage before", "M"),
    body_shift=Quantity("m", "mean way of each rigid body from its place at time 0, since the stage before", "u"),
    body_place=Quantity("m", "place of each rigid body's pivot, by default its centre", "x_b"),
    body_turn=Quantity("radian", "attitude of each rigid body: rotation vector, no longer than half a turn", "phi"),
    body_velocity=Quantity("m s-1", "velocity of each rigid body's pivot", "v"),
    body_spin=Quantity("radian s-1", "angular velocity of each rigid body", "omega"),
    grip_force=Quantity("N", "mean force that each grip put in since the stage before", "F"),
    grip_torque=Quantity("N m", "mean moment about its pivot that each grip put in since the stage before", "M"),
    grip_shift=Quantity("m", "mean way of each grip from its place at time 0, since the stage before", "u"),
    grip_turn=Quantity(
        "radian", "mean rotation vector of each grip from its attitude at time 0, since the stage before", "phi"
    ),
    fragments=Quantity("1", "pieces that hang together by whole rods and bonds", "n_f"),
    fragment_mass=Quantity("kg", "masses of the 32 heaviest fragments, the heaviest first; 0 where there is none", "m"),
    fragment_place=Quantity("m", "middles of mass of the 32 heaviest fragments; 0 where there is none", "x_f"),
    fragment_length=Quantity(
        "m", "lengths of the 32 heaviest fragments where they are longest; 0 where there is none", "l_f"
    ),
    fracture_energy=Quantity("J", "energy that breaks of rods and bonds took since the start", "E_f"),
    crushing_energy=Quantity("J", "energy that crushing of rods took since the start", "E_c"),
    crack_area=Quantity(
        "m2", "area of the cracks along the grain, what is damaged by the share of its energy that is spent", "A_c"
    ),
    tip_position=Quantity("m", "mean position of the rods' far ends, weighted with their sections", "x_tip"),
    rod_position=Quantity("m", "positions of both ends of every edge of the rods", "x"),
    rod_cut=Quantity("1", "where an edge is cut, 0 to 1 from its first end; -1 where it is not", "c"),
    rod_strain=Quantity("1", "strain along every edge; 0 where it is severed", "eps"),
    rod_crushed=Quantity("1", "by how much every edge stays shorter, over its length, where it was crushed", "eps_p"),
    rod_stress=Quantity("Pa", "tensile stress of every edge where its outer fibre is drawn out most", "sigma"),
    bond_position=Quantity("m", "middles of the bonds between rods", "x_b"),
    bond_tension=Quantity("Pa", "stress along every bond, across the grain; negative under pressure", "sigma_b"),
    bond_shear=Quantity("Pa", "shear stress of every bond along the grain", "tau_b"),
    bond_damage=Quantity("1", "0 where a bond is whole, 1 where it is broken", "D"),
    body=Quantity("1", "1 on the rigid bodies, 0 on the wood", "b"),
    inside=Quantity("1", "0 on the bark, 1 on ends, cracks and broken faces", "i"),
    rod=Quantity("1", "number of the rod that an edge belongs to", "-"),
)
