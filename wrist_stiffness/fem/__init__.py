"""Solid finite elements of the wrist: shapes, meshes, condensed parts, the whole wrist, checks.

The only room that knows the mesher.  It makes `mechanism.components.ElasticComponents` offline;
a robot does not need it.
"""
