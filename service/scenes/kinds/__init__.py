"""What a scene is made of: distinct shapes, looked up in tables or read from stored runs, as meshes of any fineness."""

from .choice import distinct
from .kind import RUNGS, Kind
from .runs import Ask, Asked, Missing, Runs

__all__ = ["RUNGS", "Ask", "Asked", "Kind", "Missing", "Runs", "distinct"]
