"""The bundle's surface as triangles: cells of the section extruded along the rods, open where it is broken."""
