"""Rigid bodies with radial shapes that fall, meet and come to rest: how fruits lie in a pile or a bowl."""

from .settle import Body, Bowl, Pouring, Rest, settle

__all__ = ["Body", "Bowl", "Pouring", "Rest", "settle"]
