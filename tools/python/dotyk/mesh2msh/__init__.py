"""Meshes of other programs made gmsh's format MSH 4.1, the one that dotyk reads."""
