"""The surroundings of a model: a camera, one lamp and a dim sky, at places that follow from the model's size."""

import numpy as np

# Names by which Blender finds them again.
CAMERA, LAMP = "stage camera", "stage lamp"
# Radiance of the sky and of the lamp's front, W/(sr m^2).
SKY, LAMP_RADIANCE = 0.2, 10.0
FIELD_OF_VIEW = np.radians(30.0)
VIEW_FROM, LIGHT_FROM = (0.6, 0.45, 1.0), (-0.6, 1.0, 0.3)
# Distance and side of the lamp, over the radius of the sphere around the model.
LAMP_DISTANCE, LAMP_SIDE = 3.0, 1.6


def put(document, view_from=VIEW_FROM):
    """Puts camera and lamp around the model of a document, in place of its own."""
    for node in document.json["nodes"]:
        node.pop("camera", None)
        node.get("extensions", {}).pop("KHR_lights_punctual", None)
    document.json.pop("cameras", None)
    document.json.get("extensions", {}).pop("KHR_lights_punctual", None)
    for key in ("extensionsUsed", "extensionsRequired"):
        if "KHR_lights_punctual" in document.json.get(key, []):
            document.json[key].remove("KHR_lights_punctual")
    low, high = document.bounds()
    middle, radius = (low + high) / 2.0, np.linalg.norm(high - low) / 2.0
    add_camera(document, middle, radius, direction(view_from))
    add_lamp(document, middle, radius)


def add_camera(document, middle, radius, towards_eye):
    """A camera that has the sphere around the model in view."""
    distance = radius / np.sin(FIELD_OF_VIEW / 2.0)
    camera = {
        "type": "perspective",
        "perspective": {"aspectRatio": 1.0, "yfov": FIELD_OF_VIEW, "znear": distance / 100.0, "zfar": distance * 3.0},
    }
    place = look(middle + towards_eye * distance, towards_eye)
    node = {"name": CAMERA, "camera": document.add("cameras", camera), "matrix": place.T.ravel().tolist()}
    document.roots().append(document.add("nodes", node))


def add_lamp(document, middle, radius):
    """A square that emits from its front, and reflects nothing."""
    away = direction(LIGHT_FROM)
    half = LAMP_SIDE * radius / 2.0
    corners = np.array([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], dtype=np.float32)
    material = {
        "name": LAMP,
        "emissiveFactor": [1.0, 1.0, 1.0],
        "pbrMetallicRoughness": {"baseColorFactor": [0.0, 0.0, 0.0, 1.0], "metallicFactor": 0.0},
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": LAMP_RADIANCE},
            "KHR_materials_specular": {"specularFactor": 0.0},
        },
    }
    used = document.json.setdefault("extensionsUsed", [])
    used += [name for name in material["extensions"] if name not in used]
    primitive = {
        "attributes": {"POSITION": document.accessor(corners, "VEC3")},
        "indices": document.accessor(np.array([0, 1, 2, 0, 2, 3], dtype=np.uint32), "SCALAR"),
        "material": document.add("materials", material),
    }
    # The square's front is its +z.
    place = look(middle + away * LAMP_DISTANCE * radius, -away)
    mesh = document.add("meshes", {"name": LAMP, "primitives": [primitive]})
    document.roots().append(document.add("nodes", {"name": LAMP, "mesh": mesh, "matrix": place.T.ravel().tolist()}))


def direction(vector):
    """A unit vector."""
    return np.array(vector) / np.linalg.norm(vector)


def look(place, back):
    """The matrix of a node at a place whose +z is `back`."""
    right = direction(np.cross((0.0, 1.0, 0.0), back))
    result = np.eye(4)
    result[:3] = np.stack([right, np.cross(back, right), back, place], axis=1)
    return result
