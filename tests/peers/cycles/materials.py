"""Materials of Cycles's own nodes for those that need no `gltf.osl`: Lambertian surfaces, white mirrors and clear glass, which absorbs;
and a Phong lobe, by `phong.osl`. Backs of one-sided surfaces are black, as photoncard has them.
"""

import math

import bpy

import render


def make_native(scene):
    """Replaces the Principled BSDF of each material that is one of these."""
    for material in bpy.data.materials:
        tree = material.node_tree
        for principled in [node for node in tree.nodes if node.type == "BSDF_PRINCIPLED"]:
            surface = phong(scene, material, principled) or mirror(tree, principled) or lambertian(tree, principled)
            if surface and material.use_backface_culling:
                surface = front_only(tree, surface)
                # Otherwise Cycles samples backs, too.
                material.cycles.emission_sampling = "FRONT"
            surface = surface or glass(tree, principled)
            if surface:
                put(tree, principled, cut_out(tree, principled, surface))


def put(tree, principled, surface):
    """Puts a surface in the place of a Principled BSDF."""
    for link in list(principled.outputs["BSDF"].links):
        tree.links.new(surface, link.to_socket)
    tree.nodes.remove(principled)


def phong(scene, material, principled):
    """A Phong lobe over Lambertian reflection, or nothing if the material states none."""
    lobe = material.get("photoncard", {}).get("phong")
    if lobe is None:
        return None
    scene.cycles.shading_system = True
    script = render.script_node(material.node_tree, "phong.osl")
    take(material.node_tree, principled.inputs["Base Color"], script.inputs.new("NodeSocketColor", "Diffuse"))
    script.inputs.new("NodeSocketColor", "Specular").default_value = (*lobe["specular"], 1.0)
    script.inputs.new("NodeSocketFloat", "Exponent").default_value = lobe["exponent"]
    return script.outputs.new("NodeSocketShader", "BSDF")


def mirror(tree, principled):
    """A smooth white metal, or nothing."""
    if not has(principled, {"Metallic": 1.0, "Roughness": 0.0}) or not is_white(principled):
        return None
    surface = tree.nodes.new("ShaderNodeBsdfAnisotropic")
    surface.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    surface.inputs["Roughness"].default_value = 0.0
    return surface.outputs["BSDF"]


def lambertian(tree, principled):
    """Diffuse reflection, and emission if there is any; or nothing."""
    if not has(principled, {"Metallic": 0.0, "Specular IOR Level": 0.0, "Transmission Weight": 0.0}):
        return None
    surface = tree.nodes.new("ShaderNodeBsdfDiffuse")
    take(tree, principled.inputs["Base Color"], surface.inputs["Color"])
    if has(principled, {"Emission Strength": 0.0}):
        return surface.outputs["BSDF"]
    emission, both = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeAddShader")
    for name in ("Color", "Strength"):
        take(tree, principled.inputs[f"Emission {name}"], emission.inputs[name])
    tree.links.new(surface.outputs["BSDF"], both.inputs[0])
    tree.links.new(emission.outputs["Emission"], both.inputs[1])
    return both.outputs["Shader"]


def glass(tree, principled):
    """A smooth dielectric, and glTF's absorption behind it; or nothing."""
    if not has(principled, {"Metallic": 0.0, "Roughness": 0.0, "Transmission Weight": 1.0}) or not is_white(principled):
        return None
    for node in tree.nodes:
        if node.type == "VOLUME_ABSORPTION":
            absorb(node)
    surface = tree.nodes.new("ShaderNodeBsdfGlass")
    surface.inputs["Roughness"].default_value = 0.0
    surface.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    take(tree, principled.inputs["IOR"], surface.inputs["IOR"])
    return surface.outputs["BSDF"]


def absorb(volume):
    """Absorption of glTF's coefficient `-density ln(colour)`; Blender's, by the importer's colour and density, is `density (1 - colour)`."""
    colour, density = volume.inputs["Color"], volume.inputs["Density"]
    coefficients = [-density.default_value * math.log(max(value, 1e-6)) for value in colour.default_value[:3]]
    greatest = max(coefficients)
    if greatest > 0.0:
        density.default_value = greatest
        colour.default_value = (*(1.0 - value / greatest for value in coefficients), 1.0)


def front_only(tree, surface):
    """A surface whose back is black."""
    mix, side = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeNewGeometry")
    tree.links.new(side.outputs["Backfacing"], mix.inputs[0])
    tree.links.new(surface, mix.inputs[1])
    return mix.outputs["Shader"]


def cut_out(tree, principled, surface):
    """A surface with the holes that a Principled BSDF has."""
    if has(principled, {"Alpha": 1.0}):
        return surface
    mix, hole = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeBsdfTransparent")
    take(tree, principled.inputs["Alpha"], mix.inputs[0])
    tree.links.new(hole.outputs["BSDF"], mix.inputs[1])
    tree.links.new(surface, mix.inputs[2])
    return mix.outputs["Shader"]


def has(principled, values):
    """If inputs of a node have these values."""
    sockets = [principled.inputs[name] for name in values]
    return all(not socket.is_linked and socket.default_value == value for socket, value in zip(sockets, values.values(), strict=True))


def is_white(principled):
    """If the base colour is white."""
    socket = principled.inputs["Base Color"]
    return not socket.is_linked and min(socket.default_value[:3]) == 1.0


def take(tree, source, target):
    """Gives an input what another has."""
    if source.is_linked:
        tree.links.new(source.links[0].from_socket, target)
    else:
        target.default_value = source.default_value
