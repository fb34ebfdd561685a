"""Many fruits in one run: they lie on each other in a bowl or on a floor, shrink, sag, and infect each other."""
