"""Text of an MJCF file with includes: bodies and joints with file and line.

Bodies and joints are in the compiler's order: depth first, includes in their place. A stranger's
file may not refer to files outside of its folder, and MuJoCo only compiles the parts relevant for
the joints' motion.

The format: mujoco.readthedocs.io, XML reference.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from xml.etree.ElementTree import Element, SubElement, tostring

from checked_files.xml_file import DEEPEST, XmlFile

if TYPE_CHECKING:
    from checked_files.yaml_file import FileError

WRITTEN_OUT = {"replicate", "attach", "composite", "flexcomp"}
"""Elements that generate bodies."""
MOST_INCLUDES = 100
"""Maximum number of files in a model."""
_KEPT = {"compiler", "default", "worldbody"}
"""Sections passed to MuJoCo's compiler, in addition to gravity and meshes."""
_WITHIN = {"default", "body", "frame", "joint", "freejoint", "inertial", "geom", "mesh"}
"""Elements passed to the compiler within these sections."""
_FOLDERS = {"assetdir", "meshdir", "texturedir", "strippath"}


class Placed(NamedTuple):
    """Element with its file."""

    file: XmlFile
    element: Element
    children: list[Placed]
    """Children of the element, with the contents of included files in place."""

    def wrong(self, what: str) -> FileError:
        """Return an error about the element, with file and line."""
        return self.file.wrong(self.element, what)


class MjcfText:
    """Files of an MJCF model: bodies, joints and equalities in the compiler's order.

    Attributes
    ----------
    bodies : list of (Placed, list of Placed)
        Bodies with their joints; the first is the world, which has no element.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.files = path, {path: XmlFile(path)}
        root = self.files[path].root
        if root.tag != "mujoco":
            raise self.files[path].wrong(root, f"<{root.tag}> must be <mujoco>: this is no MJCF")
        self._root = self._read_element(self.files[path], root)
        self.bodies: list[tuple[Placed, list[Placed]]] = [(self._root, [])]
        self.equalities = [each for part in self._parts("equality") for each in part.children]
        for each in self._parts("worldbody"):
            self._walk(each, self.bodies[0][1])

    def _parts(self, tag: str) -> list[Placed]:
        return [each for each in self._root.children if each.element.tag == tag]

    def _read_element(self, file: XmlFile, element: Element, depth: int = 1) -> Placed:
        """Read an element with all descendants, also from included files."""
        children: list[Placed] = []
        if depth > DEEPEST:
            raise file.wrong(
                element,
                f"<{element.tag}> is nested more than {DEEPEST} deep with the files that include"
                " it; flatten them",
            )
        for child in element:
            if child.tag != "include":
                children.append(self._read_element(file, child, depth + 1))
                continue
            here = Placed(file, child, [])
            name = child.get("file") or ""
            places = [folder / name for folder in (self.path.parent, file.path.parent)]
            found = next((place for place in places if place.is_file()), None)
            if found is None or found in self.files or len(self.files) >= MOST_INCLUDES:
                raise here.wrong(f"includes {name!r}, which does not exist or is included twice")
            self._refuse_outside(here, found)
            self.files[found] = XmlFile(found)
            included = self.files[found]
            children += self._read_element(included, included.root, depth).children
        return Placed(file, element, children)

    def _walk(self, parent: Placed, joints: list[Placed]) -> None:
        for each in parent.children:
            tag = each.element.tag
            if tag in WRITTEN_OUT:
                raise each.wrong(
                    f"<{tag}> stands for bodies that are not written out; compile the file and save"
                    " it, with mujoco.mj_saveLastXML"
                )
            if tag == "body":
                own: list[Placed] = []
                self.bodies.append((each, own))
                self._walk(each, own)
            elif tag == "frame":
                self._walk(each, joints)
            elif tag in ("joint", "freejoint"):
                joints.append(each)

    def _refuse_outside(self, element: Placed, found: Path) -> None:
        """Refuse an included file outside the folder of the MJCF."""
        folder = self.path.parent.resolve()
        if not found.resolve().is_relative_to(folder):
            raise element.wrong(
                f"{found} is outside of {folder}, the folder of the MJCF; copy it there"
            )

    @property
    def compiler(self) -> dict[str, str]:
        """Settings of the compiler; the last section takes precedence."""
        return dict(item for each in self._parts("compiler") for item in each.element.items())

    @property
    def uses_geom_inertias(self) -> bool:
        """True if inertias of geoms replace stated inertials."""
        return self.compiler.get("inertiafromgeom") == "true"

    def reduce(self) -> tuple[str, dict[str, bytes]]:
        """Return the content for MuJoCo's compiler: bodies, joints and sources of inertia.

        A few characters may declare huge textures, height fields or tables, or name any file. These
        do not affect joints and are omitted. Meshes are read here, except those of the world and
        of bodies with an inertial.

        Returns
        -------
        text : str
            Text without includes.
        assets : dict of str to bytes
            Meshes by their names in the text.

        Raises
        ------
        FileError
            A required mesh is missing, outside of the folder, or made by MuJoCo.
        """
        root, geoms = Element("mujoco"), list[tuple[Element, str]]()
        for each in self._parts("option"):
            gravity = {k: v for k, v in each.element.items() if k == "gravity"}
            SubElement(root, "option", gravity)
        for each in self._root.children:
            if (tag := each.element.tag) in _KEPT:
                attributes = {k: v for k, v in each.element.items() if k not in _FOLDERS}
                self._copy(each, SubElement(root, tag, attributes), geoms)
        meshes = {
            mesh.element.get("name", Path(mesh.element.get("file", "")).stem): mesh
            for each in self._parts("asset")
            for mesh in each.children
            if mesh.element.tag == "mesh"
        }
        assets, given = SubElement(root, "asset"), dict[str, bytes]()
        needed = {geom.get("mesh", ""): body for geom, body in geoms}
        if not any(needed.values()):  # no geom is left that takes a mesh of its class
            for geom, _ in geoms:
                geom.attrib.pop("mesh", None)
            needed = {}
        for name in sorted(needed.keys() & meshes.keys()):
            element = SubElement(assets, "mesh", {**meshes[name].element.attrib, "name": name})
            if "builtin" in element.attrib:
                what = f"mesh {name!r} is made by MuJoCo; state the inertials of its bodies"
                raise meshes[name].wrong(what)
            if file := element.get("file"):
                element.set("file", f"{len(given)}{Path(file).suffix}")
                given[element.get("file", "")] = self._mesh(meshes[name], file, needed[name])
        return tostring(root, encoding="unicode"), given

    def _copy(
        self, source: Placed, target: Element, geoms: list[tuple[Element, str]], body: str = ""
    ) -> None:
        """Copy the relevant part of an element, and list geoms needed for inertias.

        The world has no inertia; `body` names the body whose inertia comes from geoms, if any.
        """
        for each in source.children:
            tag, attributes = each.element.tag, dict(each.element.items())
            of_class = source.element.tag == "default"
            needless = tag == "geom" and not (body or of_class)
            if tag not in _WITHIN or "hfield" in attributes or needless:
                continue
            attributes.pop("material", None)
            copied = SubElement(target, tag, attributes)
            geoms += [(copied, body)] if tag == "geom" else []
            made = body
            if tag == "body":
                stated = any(child.element.tag == "inertial" for child in each.children)
                name = repr(attributes.get("name", "without name"))
                made = "" if stated and not self.uses_geom_inertias else name
            self._copy(each, copied, geoms, made)

    def _mesh(self, mesh: Placed, file: str, body: str) -> bytes:
        compiler = self.compiler
        inside = compiler.get("meshdir") or compiler.get("assetdir") or ""
        places = [each.path.parent / inside / file for each in (self, mesh.file)]
        found = next((place for place in places if place.is_file()), None)
        if found is None:
            whose = f"body {body}" if body else "a body"
            raise mesh.wrong(
                f"{file!r} does not exist, and the inertia of {whose} comes from this mesh; "
                "put the file there, or state the inertial of the body"
            )
        self._refuse_outside(mesh, found)
        return found.read_bytes()
