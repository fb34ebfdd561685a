"""Fields on the skin: rot, mould, water and nutrient, how they react, spread and step through time."""
