"""What a bundle is: its rods, bonds and bodies as arrays, how it is laid, and the state of a run."""
