"""Forces within and between rods, and their second derivatives."""
