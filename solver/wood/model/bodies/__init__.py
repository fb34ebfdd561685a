"""Rigid bodies as laid: what their parameters say, as arrays and as meshes."""
