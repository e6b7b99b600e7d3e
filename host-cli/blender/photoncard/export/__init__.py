"""Exports an evaluated scene of Blender to glTF with the extras of photoncard."""
