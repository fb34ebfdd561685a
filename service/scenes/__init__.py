"""Scenes: a camera, items and a budget become one file in which every distinct shape is there once."""
