"""From one moment of a run to the next: the explicit scheme, scaled masses, equilibria."""
