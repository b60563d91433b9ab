"""A fault tree as XML of the Open-PSA model exchange format 2.0d, which SCRAM and others read."""

from __future__ import annotations

import re
from typing import Final
from xml.etree import ElementTree as ET

from rig.core.errors import BadInput
from rig.core.text import quoted
from rig.studies.safety.fault_tree import Event, FaultTree, Gate

NAME: Final = re.compile(r"[A-Za-z_]\w*(-\w+)*", re.ASCII)  # an NCName without dots, as the schema's Identifier


def require_name(where: str, name: str) -> None:
    """Raise BadInput unless ``name`` may name a gate or event; ``where`` says the file and key."""
    if not NAME.fullmatch(name):
        raise BadInput(
            f"{where}: {quoted(name)} cannot be a name in the tree's XML: letters, digits, _ and single hyphens "
            "within, a letter first"
        )


def open_psa(tree: FaultTree) -> str:
    """Return the XML of a tree, top gate first; rates are of the mission time that the reader is given."""
    root = ET.Element("opsa-mef", name=tree.name)
    within = ET.SubElement(root, "define-fault-tree", name=tree.name)
    for name in sorted(tree.gates, key=lambda name: name != tree.top):
        _gate(within, name, tree.gates[name], tree)
    data = ET.SubElement(root, "model-data")
    for name, event in tree.events.items():
        _event(data, name, event)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=False) + "\n"


def _gate(within: ET.Element, name: str, gate: Gate, tree: FaultTree) -> None:
    element = _defined(within, "gate", name, gate.label)
    if len(gate.inputs) > 1:
        least = {"min": str(gate.least)} if gate.kind == "atleast" else {}
        element = ET.SubElement(element, gate.kind, least)
    for each in gate.inputs:  # a gate of one input passes it through
        ET.SubElement(element, "gate" if each in tree.gates else "basic-event", name=each)


def _event(data: ET.Element, name: str, event: Event) -> None:
    element = _defined(data, "basic-event", name, event.label)
    if event.per_hour is None:
        ET.SubElement(element, "float", value=repr(event.chance))
        return
    exponential = ET.SubElement(element, "exponential")
    ET.SubElement(exponential, "float", value=repr(event.per_hour))
    ET.SubElement(exponential, "system-mission-time")


def _defined(within: ET.Element, what: str, name: str, label: str) -> ET.Element:
    element = ET.SubElement(within, f"define-{what}", name=name)
    if label:
        ET.SubElement(element, "label").text = label
    return element
