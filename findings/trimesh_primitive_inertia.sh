#!/usr/bin/env bash
# trimesh 5.2.0: the inertia of a steel shaft is that of a shaft of density one.
#
# Input: a cylinder (radius 0.1 m, length 1 m), a sphere, a box and a capsule from
# trimesh.primitives, the shapes of URDF and MJCF files; density = 7850 kg/m^3.
#
# Expected: mass and moment_inertia both belong to steel. `density` is documented
# as "the density of the mesh used in inertia calculations".
#
# Seen: the mass of all four is right. moment_inertia of box and capsule is right;
# that of cylinder and sphere stays at density one, 7850 times too small: 0.0027
# instead of 21 kg m^2 across the shaft. The same object gives the right tensor by
# mass_properties, by moment_inertia_frame and after conversion to a mesh, and
# the wrong one by principal_inertia_components. In a link of several shapes only
# the own inertias of shafts and balls are missing, so the sum stays plausible.
#
# Documentation: "The analytic inertia tensor of the cylinder primitive" and of the
# sphere; no word of density.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check trimesh==5.2.0 numpy==2.4.6 scipy==1.17.1
venv/bin/python -W ignore - <<'EOF'
import sys

import numpy as np
import trimesh
from trimesh.primitives import Box, Capsule, Cylinder, Sphere

STEEL = 7850.0
shapes = {
    "cylinder": Cylinder(radius=0.1, height=1.0),
    "sphere": Sphere(radius=0.1),
    "box": Box(extents=(1.0, 0.2, 0.1)),
    "capsule": Capsule(radius=0.1, height=1.0),
}
ratios, others = {}, []
for name, shape in shapes.items():
    mesh = trimesh.Trimesh(shape.vertices, shape.faces, process=False)
    for body in (shape, mesh):
        body.density = STEEL
    by_shape, by_mesh = np.diag(shape.moment_inertia), np.diag(mesh.moment_inertia)
    ratios[name] = by_mesh[1] / by_shape[1], mesh.mass / shape.mass
    others += [
        np.allclose(shape.mass_properties.inertia, mesh.moment_inertia, rtol=1e-6),
        np.allclose(shape.moment_inertia_frame(np.eye(4)), mesh.moment_inertia, rtol=1e-6, atol=1e-6),
    ]
    print(
        f"{name:8s}: mass {shape.mass:.1f} kg, moment_inertia about y {by_shape[1]:.3g} kg m^2,"
        f" as a mesh {mesh.mass:.1f} kg and {by_mesh[1]:.3g} kg m^2"
    )

shaft = shapes["cylinder"]
exact = np.pi * 0.1**2 * STEEL * (3 * 0.1**2 + 1) / 12
print(f"cylinder about y by the formula: {exact:.1f} kg m^2")
print(f"principal_inertia_components of the cylinder: {np.max(shaft.principal_inertia_components):.3g} kg m^2")

as_described = (
    all(np.isclose(mass, 1.0) for _, mass in ratios.values())
    and all(np.isclose(ratios[name][0], STEEL, rtol=0.02) for name in ("cylinder", "sphere"))
    and all(np.isclose(ratios[name][0], 1.0) for name in ("box", "capsule"))
    and all(others)
    and np.max(shaft.principal_inertia_components) < 0.003
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
