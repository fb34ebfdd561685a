"""A fruit before it shrinks: its mesh, the part that stands for it, and what starts the buckles."""
