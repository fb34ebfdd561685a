"""What weakens wood, against what is published: compression along the grain, knots."""
