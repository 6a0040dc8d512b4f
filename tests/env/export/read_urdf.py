"""Prints what yourdfpy reads from a URDF file; runs in an environment of scripts/servers.

Usage: python read_urdf.py FILE '{"link": position of the joint above it, ...}'
"""

import json
import sys

import trimesh
import yourdfpy

robot = yourdfpy.URDF.load(sys.argv[1], load_meshes=False)
assert robot.validate(), robot.errors
told = {f"{link}_joint": value for link, value in json.loads(sys.argv[2]).items()}
followers = {name for name, joint in robot.joint_map.items() if joint.mimic}
robot.update_cfg({name: value for name, value in told.items() if name not in followers})
above = {joint.child: joint for joint in robot.joint_map.values()}
links = {}
for name, link in robot.link_map.items():
    pose = robot.get_transform(name) @ link.inertial.origin
    w, x, y, z = trimesh.transformations.quaternion_from_matrix(pose)
    links[name] = {
        "mass": link.inertial.mass,
        "inertia": link.inertial.inertia.diagonal().tolist(),
        "centre": pose[:3, 3].tolist(),
        "rotation": [x, y, z, w],
    }
    if name in above:
        links[name] |= {"kind": above[name].type, "axis": above[name].axis.tolist()}
print(json.dumps(links))
