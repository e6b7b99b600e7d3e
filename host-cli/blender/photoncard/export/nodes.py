"""Follows links of shader nodes, through groups, reroutes and muted nodes."""

from __future__ import annotations

from typing import NamedTuple

import bpy


class Unsupported(Exception):
    """A node that glTF has no counterpart of."""

    def __init__(self, node: bpy.types.Node, reason: str = "") -> None:
        kind = node.bl_rna.name or node.bl_idname
        label = kind if node.name.startswith(kind) else f"{node.name}, {kind}"
        super().__init__(f"node {label}{': ' + reason if reason else ''}")


class Place(NamedTuple):
    """A socket, and the group nodes that its tree is inside of, the innermost last."""

    socket: bpy.types.NodeSocket
    groups: tuple[bpy.types.Node, ...]


Path = tuple[str, ...]
"""An input in any copy of a tree: names of the group nodes and of the node, and the socket's identifier."""


def path_of(place: Place) -> Path:
    """The path of an input."""
    socket = place.socket
    return (*(group.name for group in place.groups), socket.node.name, socket.identifier)


def has_nodes(owner: bpy.types.Material | bpy.types.World) -> bool:
    """True if nodes state a material or a world. Since Blender 5.0 they always do."""
    return owner.node_tree is not None and (bpy.app.version >= (5, 0, 0) or owner.use_nodes)


def active_output(tree: bpy.types.NodeTree) -> bpy.types.Node | None:
    """The output node that Cycles renders."""
    return tree.get_output_node("CYCLES")


def resolve(place: Place) -> Place:
    """The output of a node that feeds an input, or the unlinked input whose value counts."""
    socket, groups = place
    while True:
        link = next((link for link in socket.links if link.is_valid and not link.is_muted), None)
        if link is None:
            return Place(socket, groups)
        source, node = link.from_socket, link.from_node
        if node.mute:
            inner = next((inner for inner in node.internal_links if inner.to_socket == source), None)
            if inner is None:
                return Place(socket, groups)
            socket = inner.from_socket
        elif node.bl_idname == "NodeReroute":
            socket = node.inputs[0]
        elif node.bl_idname == "ShaderNodeGroup" and node.node_tree:
            output = _group_output(node.node_tree)
            if output is None:
                return Place(socket, groups)
            groups = (*groups, node)
            socket = _by_identifier(output.inputs, source.identifier)
        elif node.bl_idname == "NodeGroupInput" and groups:
            socket = _by_identifier(groups[-1].inputs, source.identifier)
            groups = groups[:-1]
        else:
            return Place(source, groups)


def input_of(end: Place, name: str) -> Place:
    """The input of a name or identifier, of the node whose output `end` is."""
    sockets = end.socket.node.inputs
    found = sockets.get(name) or next(socket for socket in sockets if socket.identifier == name)
    return Place(found, end.groups)


def is_linked(place: Place) -> bool:
    """True if a node feeds an input."""
    return resolve(place).socket.is_output


def _group_output(tree: bpy.types.NodeTree) -> bpy.types.Node | None:
    outputs = [node for node in tree.nodes if node.bl_idname == "NodeGroupOutput"]
    return next((node for node in outputs if node.is_active_output), None)


def _by_identifier(sockets: bpy.types.NodeInputs, identifier: str) -> bpy.types.NodeSocket:
    return next(socket for socket in sockets if socket.identifier == identifier)
