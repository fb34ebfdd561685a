"""What Blender makes of clips of wood."""
