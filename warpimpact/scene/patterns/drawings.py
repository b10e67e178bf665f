"""SVG drawings: what is refused before a drawing is drawn, because it is not understood or has no bound."""

import re
import xml.etree.ElementTree as xml
from pathlib import Path

from ..files import check_file
from ..units import brief

_NOT_UNDERSTOOD = {"text", "image", "foreignObject", "clip-path", "mask"}
_MOST_BYTES, _MOST_DEEP, _MOST_ELEMENTS, _MOST_NUMBERS = 2**22, 32, 20_000, 40_000
_NUMBER = re.compile(r"\d+")
_GEOMETRY = ("d", "points", "transform")


def check_drawing(path: Path) -> None:
    """Refuse a file that is no drawing, and a drawing that is too large or has something that is not understood.

    Raises:
        ValueError: names the file and what is wrong with it.
    """
    check_file(path, _MOST_BYTES)
    root = _parsed(path)
    if _tag(root) != "svg":
        raise ValueError(f'{path.name} is not an SVG drawing: it begins with "{brief(_tag(root))}"')
    elements = list(root.iter())
    for element in elements:
        for name in _NOT_UNDERSTOOD & {_tag(element), *element.attrib}:
            raise ValueError(f"{path.name} has {name}, which is not supported; give filled paths and plain shapes")
    elements += _used(path, elements)
    if len(elements) > _MOST_ELEMENTS:
        raise ValueError(f"{path.name} has {len(elements)} shapes, but a drawing has at most {_MOST_ELEMENTS}")
    numbers = sum(_numbers(element) for element in elements)
    if numbers > _MOST_NUMBERS:
        raise ValueError(f"{path.name} has {numbers} numbers in its paths, but a drawing has at most {_MOST_NUMBERS}")


def _parsed(path: Path) -> xml.Element:
    """The root of a drawing whose groups are not too deep for whoever walks through it."""
    depth, root = 0, None
    try:
        if b"<!ENTITY" in path.read_bytes():
            raise ValueError(f"{path.name} declares entities, which are not supported; save it as a plain SVG")
        for event, element in xml.iterparse(path, ("start", "end")):
            root = element if root is None else root
            depth += 1 if event == "start" else -1
            if depth > _MOST_DEEP:
                raise ValueError(f"{path.name} has groups in groups, more than {_MOST_DEEP} deep")
    except (xml.ParseError, UnicodeDecodeError, LookupError, OSError) as error:
        raise ValueError(f"{path.name} is not an SVG drawing: {brief(str(error))}") from None
    assert isinstance(root, xml.Element)  # a file without elements is no XML
    return root


def _used(path: Path, elements: list[xml.Element]) -> list[xml.Element]:
    """What is drawn again by `use`, once for each; not more than is refused anyhow."""
    by_name = {element.attrib["id"]: element for element in elements if "id" in element.attrib}
    again: list[xml.Element] = []
    for element in elements:
        if _tag(element) != "use":
            continue
        names = [value for name, value in element.attrib.items() if name.rpartition("}")[2] == "href"]
        targets = [by_name[name[1:]] for name in names if name[1:] in by_name]
        inner = [one for target in targets for one in target.iter()]
        if any(_tag(one) == "use" for one in inner):
            raise ValueError(f"{path.name} has a use of another use, which is not supported; give plain shapes")
        again += inner
        if len(again) > _MOST_ELEMENTS:
            break
    return again


def _numbers(element: xml.Element) -> int:
    return sum(len(_NUMBER.findall(element.attrib.get(name, ""))) for name in _GEOMETRY)


def _tag(element: xml.Element) -> str:
    return str(element.tag).rpartition("}")[2]
