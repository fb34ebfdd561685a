"""Meshes of one's own: read, checked, and with their texture coordinates and materials."""
