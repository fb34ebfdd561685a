"""Geometry that solvers and checks share: closest points, broad phase, crossings."""
