"""Geometry file, kinematics and the influence G of a small screw at a component.

Conventions, used everywhere in the project:

* frame F (`wrist_base`): origin O, the point in which all joint axes meet; x along motor axis 1;
* a 6-vector is (translation; rotation) or (force; moment) **at O in F**, SI units;
* `theta` has shape (..., 2): motor angles [rad], zero at the home axes, right-handed about a1, a2;
* a component's screw is the displacement of its platform side relative to its motor side.
"""
