"""Opens a .glb in Blender, and prints joints and vertices in some frames, in glTF's axes.

blender.py -- FILE FRAME...
"""

import json
import sys

import bpy

FPS = 30


def gltf_axes(point):
    """Blender has z up, glTF y."""
    x, y, z = point
    return [x, z, -y]


def main():
    file, *frames = sys.argv[sys.argv.index("--") + 1 :]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = FPS
    bpy.ops.import_scene.gltf(filepath=file)
    skeleton = next(item for item in bpy.data.objects if item.type == "ARMATURE")
    mesh = next(item for item in bpy.data.objects if item.type == "MESH" and item.data.shape_keys)
    result = []
    for frame in map(int, frames):
        bpy.context.scene.frame_set(frame)
        graph = bpy.context.evaluated_depsgraph_get()
        joints = {
            bone.name: gltf_axes((skeleton.matrix_world @ bone.matrix).to_translation()) for bone in skeleton.pose.bones
        }
        moved = mesh.evaluated_get(graph)
        vertices = [gltf_axes(moved.matrix_world @ vertex.co) for vertex in moved.to_mesh().vertices]
        correctives = [block.value for block in mesh.data.shape_keys.key_blocks[1:]]
        result.append({"joints": joints, "vertices": vertices, "correctives": correctives})
    # Blender writes on standard output, too.
    print("RESULT " + json.dumps(result))


main()
