"""Geometry that solvers and checks share: broad phase, crossings."""
