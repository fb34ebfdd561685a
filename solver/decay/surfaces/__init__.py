"""The surfaces that decay runs on: fruits, dried shapes and meshes of one's own."""
