"""Rules of the Slicer Execution Model: check_xml.py FILE...; with --defaults FILE the flags at their defaults."""

import re
import sys
import xml.etree.ElementTree as xml

HEAD = ["category", "title", "description", "version", "license", "contributor"]
ORDER = ["name", "flag", "longflag", "index", "description", "label", "default", "channel", "constraints", "element"]
KINDS = {"integer", "double", "boolean", "string", "string-enumeration", "file", "directory"}


def parameters(root):
    return [p for group in root.findall("parameters") for p in group if p.tag in KINDS]


def complain(path, what):
    print(f"FAILED: {path}: {what}")
    complain.count += 1


complain.count = 0


def check(path):
    root = xml.parse(path).getroot()
    tags = [child.tag for child in root]
    if root.tag != "executable" or tags[:6] != HEAD or set(tags[6:]) != {"parameters"}:
        complain(path, f"its parts are {tags}")
    for group in root.findall("parameters"):
        inner = [child.tag for child in group]
        if inner[:2] != ["label", "description"] or not set(inner[2:]) <= KINDS or len(inner) < 3:
            complain(path, f"a group holds {inner}")
        if group.get("advanced") not in (None, "true", "false"):
            complain(path, "advanced")
    names, flags, places = [], [], []
    for p in parameters(root):
        text = {child.tag: child.text for child in p}
        name = text.get("name") or ""
        names.append(name)
        if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
            complain(path, f"no name for a variable: {name}")
        if not text.get("label") or not text.get("description"):
            complain(path, f"{name} is not described")
        if ("index" in text) == ("longflag" in text):
            complain(path, f"{name} has neither or both of place and flag")
        if "longflag" in text:
            flags.append(text["longflag"])
            if not re.fullmatch(r"--[a-z0-9_]+", text["longflag"]):
                complain(path, f"flag {text['longflag']}")
        else:
            places.append(int(text["index"]))
        order = [child.tag for child in p]
        if order != sorted(order, key=ORDER.index):  # the schema wants this one
            complain(path, f"{name} holds {order}")
        if p.tag in ("file", "directory") and text.get("channel") not in ("input", "output"):
            complain(path, f"{name} goes neither in nor out")
        if p.tag in ("integer", "double"):
            if p.find("constraints/step") is None:
                complain(path, f"{name} has no step")
            least, most = (float(p.find(f"constraints/{k}").text) for k in ("minimum", "maximum"))
            if not least <= float(text["default"]) <= most:
                complain(path, f"{name}: {text['default']} is not in {least} .. {most}")
            if p.tag == "integer":
                int(text["default"])
        if p.tag == "string-enumeration" and text["default"] not in [e.text for e in p.findall("element")]:
            complain(path, f"{name}: its default is none of its words")
    if len(set(names)) != len(names) or len(set(flags)) != len(flags):
        complain(path, "a name or flag is there twice")
    if sorted(places) != list(range(len(places))):
        complain(path, f"places {places}")


if sys.argv[1] == "--defaults":
    for p in parameters(xml.parse(sys.argv[2]).getroot()):
        if p.tag in ("integer", "double", "string-enumeration"):
            print(p.find("longflag").text)
            print(p.find("default").text)
else:
    for path in sys.argv[1:]:
        check(path)
    sys.exit(1 if complain.count else 0)
