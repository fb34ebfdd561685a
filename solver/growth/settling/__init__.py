"""The search for equilibrium after a step of growth."""
