"""What the net of bonds across the grain stands for: shear of the section, twisted and bent."""
