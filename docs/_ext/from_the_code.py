"""Directives whose text is made from the code: keys of campaigns, commands, variables, public names, device code."""

from __future__ import annotations

import argparse
import ast
import inspect
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

CHECKOUT = Path(__file__).parents[2]


class FromTheCode(SphinxDirective):
    """Markdown that a function makes, as if it stood in the page."""

    def lines(self) -> Iterator[str]:
        """The lines of Markdown; each kind of page has its own."""
        return iter(())

    def run(self) -> list[nodes.Node]:
        self.env.note_reread()  # the code may have changed
        return self.parse_text_to_nodes("\n".join(self.lines()), allow_section_headings=True)


def table(header: tuple[str, ...], rows: list[tuple[str, ...]]) -> Iterator[str]:
    """A table of Markdown."""
    for row in (header, tuple("---" for _ in header), *rows):
        yield "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in row) + " |"
    yield ""


def code(text: object) -> str:
    return f"`{text}`"


class ExclusionReference(FromTheCode):
    """What cannot be combined, and what needs what."""

    def lines(self) -> Iterator[str]:
        from warpimpact.scene.exclusions import EXCLUDED, NEEDS

        yield from table(("this", "excludes", "because"), [(code(a), code(b), why) for a, b, why in EXCLUDED])
        yield from table(("this", "needs", "because"), [(code(a), code(b), why) for a, b, why in NEEDS])


class MeasureReference(FromTheCode):
    """Every quantity and event that a measure may be of."""

    def lines(self) -> Iterator[str]:
        from warpimpact.measures.vocabulary import EVENTS, QUANTITIES
        from warpimpact.scene.units import STORED

        for what, entries in (("quantity", QUANTITIES), ("event", EVENTS)):
            rows = [
                (
                    code(f"{entry.name}@…" if entry.has_standoff else entry.name),
                    STORED[entry.units].shown,
                    {True: "more", False: "less", None: ""}[entry.higher_is_better],
                    entry.definition,
                )
                for entry in entries.values()
            ]
            yield from table((what, "unit", "better", "what it is"), rows)


# --- Keys of a campaign ---


class CampaignReference(FromTheCode):
    """Every key of a campaign file, table by table, from its JSON schema."""

    def lines(self) -> Iterator[str]:
        from warpimpact.campaign.campaign import Campaign
        from warpimpact.campaign.schema import campaign_schema, file_schema
        from warpimpact.scene.scatter import Distribution

        self.schema = file_schema(Campaign, "") | {"properties": campaign_schema()["properties"]}
        yield from self.file()
        yield from ["## Distributions", "", "A distribution in the place of a value: each shot draws its own.", ""]
        names = [one.__name__ for one in subclasses(Distribution)]
        for name in names:
            if name in self.schema["$defs"]:
                yield from self.variant(self.schema["$defs"][name], "distribution")

    def file(self) -> Iterator[str]:
        yield from ["## Tables of the file", ""]
        yield from self.keys(self.schema)
        for name, part in self.schema["properties"].items():
            yield from self.of_table(name, part)

    def definition(self, part: dict[str, Any]) -> dict[str, Any]:
        found: dict[str, Any] = self.schema["$defs"].get(part.get("$ref", "").rpartition("/")[2], {})
        return found

    def tables(self, part: dict[str, Any]) -> list[dict[str, Any]]:
        """The tables that a part of the schema may be, or a list of which."""
        if "anyOf" in part or "items" in part:
            inner = [*part.get("anyOf", []), *([part["items"]] if "items" in part else [])]
            return [table for one in inner for table in self.tables(one)]
        return [found] if "properties" in (found := self.definition(part)) else []

    def of_table(self, name: str, part: dict[str, Any], depth: str = "##") -> Iterator[str]:
        """A table of the file, and those within it."""
        models = self.tables(part)
        if not models or name == "layer.pattern":  # which is that of the plate
            return
        yield from [f"{depth} `[{name}]`", "", part.get("description", "").capitalize(), ""]
        decided = [key for key in ("shape", "name") if "const" in models[0]["properties"].get(key, {})]
        if len(models) > 1 and decided:
            shared = self.shared(models)
            yield from self.keys(shared)
            for model in models:
                own = {key: one for key, one in model["properties"].items() if key not in shared["properties"]}
                yield from self.variant(model | {"properties": own}, decided[0], depth + "#")
            return
        for model in models:
            yield from [model.get("description", ""), ""]
            yield from self.keys(model)
            for key, inner in model["properties"].items():
                yield from self.of_table(f"{name}.{key}", inner, depth)

    def shared(self, models: list[dict[str, Any]]) -> dict[str, Any]:
        """The keys that all of some models have alike."""
        first, *others = models
        alike = {
            key: part
            for key, part in first["properties"].items()
            if all(other["properties"].get(key) == part for other in others)
        }
        required = [key for key in first.get("required", []) if all(key in one.get("required", []) for one in others)]
        return {"properties": alike, "required": required}

    def variant(self, model: dict[str, Any], key: str, depth: str = "###") -> Iterator[str]:
        name = model["properties"][key]["const"]
        yield from [f'{depth} `{key} = "{name}"`', "", model.get("description", ""), ""]
        yield from self.keys(model, without=key)

    def keys(self, model: dict[str, Any], without: str = "") -> Iterator[str]:
        required = model.get("required", [])
        rows = [
            (
                code(key),
                self.kind(part),
                "**required**" if key in required else self.default(part),
                self.bounds(part),
                self.meaning(key, part),
            )
            for key, part in model["properties"].items()
            if key != without
        ]
        if rows:
            yield from table(("key", "unit or type", "default", "allowed", "meaning"), rows)

    def kind(self, part: dict[str, Any]) -> str:
        if "anyOf" in part:
            return " or ".join(dict.fromkeys(map(self.kind, part["anyOf"])))
        if "unit" in part:
            return str(part["unit"])
        if "enum" in part or "const" in part:
            return "word" if isinstance(part.get("const", part.get("enum", [""])[0]), str) else "integer"
        if part.get("type") == "array":
            inner = part.get("items") or part["prefixItems"][0]
            return f"list of {self.kind(inner)}"
        if "$ref" in part:
            found = self.definition(part)
            return "table" if "properties" in found else self.kind(found)
        kinds = part.get("type", "string")
        names = {"string": "text", "boolean": "true or false", "object": "table"}
        return "number" if isinstance(kinds, list) else names.get(kinds, kinds)

    def default(self, part: dict[str, Any]) -> str:
        default = part.get("default")
        first = default[0] if isinstance(default, list) and default else default
        if first in (None, []) or isinstance(first, dict):
            return ""
        unit = part.get("unit", "") or part.get("items", {}).get("unit", "")
        shown = (
            str(default).lower() if isinstance(default, bool) else f'"{default}"' if isinstance(default, str) else ""
        )
        if not shown and isinstance(default, list):
            shown = ", ".join(f"{one:g}" for one in default)
        return code(f"{shown or format(default, 'g')} {unit if default != 0 else ''}".strip())

    def bounds(self, part: dict[str, Any]) -> str:
        inner = part.get("items") or part.get("prefixItems", [part])[0]
        words = [f'"{one}"' if isinstance(one, str) else str(one) for one in inner.get("enum", [])]
        limits = [", ".join(map(code, words))] if words else []
        for name, sign in (("exclusiveMinimum", ">"), ("minimum", "≥"), ("exclusiveMaximum", "<"), ("maximum", "≤")):
            if name in inner:
                limits.append(f"{sign} {short(inner[name])}")
        if "multipleOf" in inner:
            limits.append(f"a multiple of {inner['multipleOf']}")
        if "maxItems" in part and part["maxItems"] == part.get("minItems"):
            limits.append(f"{part['maxItems']} items")
        elif "maxItems" in part:
            limits.append(f"at most {part['maxItems']} items")
        return ", ".join(limits)

    def meaning(self, key: str, part: dict[str, Any]) -> str:
        from warpimpact.scene.quantities import SCATTERED

        description = str(part.get("description", ""))
        return f"{description} May [scatter](#distributions)." if key in SCATTERED else description


def subclasses(model: type) -> Iterator[type]:
    """All classes below a class."""
    for one in model.__subclasses__():
        yield one
        yield from subclasses(one)


def short(number: float) -> str:
    power = math.log2(number) if number > 0 else 0.5
    return f"2^{power:g}" if power >= 16 and power == int(power) else f"{number:g}"


class FiringReference(CampaignReference):
    """Every key of a test file, table by table, from its JSON schema."""

    def lines(self) -> Iterator[str]:
        from warpimpact.campaign.schema import file_schema
        from warpimpact.firing.simulate import FiringTest

        self.schema = file_schema(FiringTest, "")
        yield from self.file()

    def meaning(self, key: str, part: dict[str, Any]) -> str:
        return str(part.get("description", ""))  # nothing in a test file has a distribution


class DesignReference(CampaignReference):
    """Every key of a design file beside those of a campaign, table by table, from its JSON schema."""

    def lines(self) -> Iterator[str]:
        from warpimpact.campaign.campaign import Campaign
        from warpimpact.optimisation.design import design_schema

        self.schema = design_schema()
        own = {key: part for key, part in self.schema["properties"].items() if key not in Campaign.model_fields}
        self.schema["properties"] = own
        yield from self.file()


# --- Commands ---


class CommandReference(FromTheCode):
    """Every command with its arguments, from the parsers."""

    def lines(self) -> Iterator[str]:
        from warpimpact.cli import parser

        for action in parser()._actions:
            if isinstance(action, argparse._SubParsersAction):
                for name, command in action.choices.items():
                    yield from self.of_command(name, command)

    def of_command(self, name: str, command: argparse.ArgumentParser) -> Iterator[str]:
        usage = " ".join(command.format_usage().removeprefix("usage: ").split())
        yield from [f"## {name}", "", prose(command.description or ""), "", "```text", usage, "```", ""]
        rows = [(self.written(one), prose(self.helped(one))) for one in command._actions if one.dest != "help"]
        yield from table(("argument", "meaning"), rows)
        if command.epilog:
            yield from ["```text", command.epilog.removeprefix("example: "), "```", ""]

    def written(self, action: argparse.Action) -> str:
        value = str(action.metavar or "") or ("|".join(map(str, action.choices)) if action.choices else "")
        names = action.option_strings or [value]
        return ", ".join(code(f"{name} {value}".strip() if action.option_strings else name) for name in names)

    def helped(self, action: argparse.Action) -> str:
        return (action.help or "") % (vars(action) | {"prog": "warpimpact"})


def prose(text: str) -> str:
    """Text of a help as Markdown: what Markdown would take for marks is spelt out."""
    return re.sub(r"([*_\[\]<>])", r"\\\1", text)


# --- Variables of results ---


class VariableReference(FromTheCode):
    """Variables of a hit map, with dimensions and units."""

    def lines(self) -> Iterator[str]:
        from warpimpact.records import variables
        from warpimpact.records.variables import RECORDS

        groups = {
            "Coordinates": variables.COORDINATES,
            "Impact": variables.SHOT_VARIABLES,
            "Hit point": (variables.EDGE_DISTANCE,),
            "Plate and core, where they scatter": variables.SCATTER_VARIABLES,
            **RECORDS,
        }
        for title, group in groups.items():
            yield from [f"## {title}", ""]
            rows = [(code(str(one)), ", ".join(one.dims), one.units, one.long_name) for one in group]
            yield from table(("variable", "dimensions", "units", "meaning"), rows)


class StatusReference(FromTheCode):
    """How a shot may end."""

    def lines(self) -> Iterator[str]:
        from warpimpact.kernels.status import Status

        rows = [(code(status.name.lower()), str(status.value), status.sentence) for status in Status]
        yield from table(("status", "code", "meaning"), rows)


# --- Names in Python ---


class PublicReference(FromTheCode):
    """All names of warpimpact, in groups by their kind."""

    def lines(self) -> Iterator[str]:
        from pydantic import BaseModel

        import warpimpact

        named = {name: getattr(warpimpact, name) for name in warpimpact.__all__ if not name.startswith("_")}
        titles = ("Functions", "Catalogue", "Models", "Results and values", "Errors")
        kinds: dict[str, list[str]] = {title: [] for title in titles}
        for name, one in named.items():
            if inspect.ismodule(one):  # the page has its figures
                continue
            if not inspect.isroutine(one) and not inspect.isclass(one):
                kinds["Catalogue"].append(name)
            elif inspect.isfunction(one):
                kinds["Functions"].append(name)
            elif issubclass(one, Exception):
                kinds["Errors"].append(name)
            else:
                kinds["Models" if issubclass(one, BaseModel) else "Results and values"].append(name)
        for title, names in kinds.items():
            yield from [f"## {title}", "", "```{eval-rst}"]
            special = {"Functions": "autofunction", "Errors": "autoexception"}
            for name in names:
                if title == "Catalogue":
                    text = inspect.cleandoc(type(named[name]).__doc__ or "")
                    yield from [
                        f".. py:data:: warpimpact.{name}",
                        "",
                        *(f"   {line}" for line in text.splitlines()),
                        "",
                    ]
                    continue
                kind = special.get(title, "autoclass")
                yield from [f".. {kind}:: warpimpact.{name}", ""]
                if title in ("Models", "Results and values"):
                    yield from ["   :members:", "   :exclude-members: model_copy, model_config, model_post_init", ""]
            yield from ["```", ""]


def signature_of_a_model(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, signature: str | None, returned: str | None
) -> tuple[str | None, str | None] | None:
    """Fields of a model by their names; the docstring tells what they take."""
    from pydantic import BaseModel

    if what == "class" and isinstance(obj, type) and issubclass(obj, BaseModel):
        fields = (key if one.is_required() else f"{key}=…" for key, one in obj.model_fields.items())
        return f"({', '.join(('*', *fields))})", None
    return None


# --- Device code ---


class KernelReference(FromTheCode):
    """Functions and structures of the device code, from their source: Warp replaces them when it builds them."""

    def lines(self) -> Iterator[str]:
        kernels = CHECKOUT / "kernels"
        for path in (*sorted(kernels.glob("*.py")), *sorted(kernels.glob("continuum/*.py"))):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            if path.stem == "__init__":
                continue
            yield from [f"## {path.stem}", "", ast.get_docstring(tree) or "", ""]
            for node in ast.walk(tree):
                if isinstance(node, ast.FunctionDef | ast.ClassDef) and (mark := device_mark(node)):
                    yield from self.entry(node, mark)

    def entry(self, node: ast.FunctionDef | ast.ClassDef, mark: str) -> Iterator[str]:
        if isinstance(node, ast.ClassDef):
            fields = [one for one in node.body if isinstance(one, ast.AnnAssign)]
            signature = ", ".join(ast.unparse(one).replace("'", "") for one in fields)
        else:
            signature = ast.unparse(node.args)
        kind = {"struct": "structure", "kernel": "kernel"}.get(mark, "function")
        yield from [f"`{node.name}` ({kind})", "", f": {' '.join((ast.get_docstring(node) or '').split())}", ""]
        yield from [f"  `{node.name}({signature})`", ""]


class ConstantReference(FromTheCode):
    """The table of the constants of the device code."""

    def lines(self) -> Iterator[str]:
        from warpimpact.kernels import constants
        from warpimpact.kernels.continuum import choices

        yield from ["| constant | value | unit | reason | § | test |", "|---|---|---|---|---|---|"]
        for name, row in (*vars(constants).items(), *vars(choices).items()):
            if isinstance(row, constants.Constant):
                test = f"`{row.test}`" if row.test else ""
                yield f"| `{name}` | {row.value:.6g} | {row.unit} | {row.reason} | {row.section} | {test} |"
        yield ""


def device_mark(node: ast.FunctionDef | ast.ClassDef) -> str | None:
    """Which decorator of Warp a definition has: func, func_native, struct or kernel."""
    for one in node.decorator_list:
        call = one.func if isinstance(one, ast.Call) else one
        if isinstance(call, ast.Attribute) and ast.unparse(call.value) == "wp":
            return call.attr
    return None


def setup(app: Sphinx) -> dict[str, bool]:
    for name, directive in {
        "campaign-reference": CampaignReference,
        "firing-reference": FiringReference,
        "design-reference": DesignReference,
        "exclusion-reference": ExclusionReference,
        "command-reference": CommandReference,
        "variable-reference": VariableReference,
        "measure-reference": MeasureReference,
        "status-reference": StatusReference,
        "public-reference": PublicReference,
        "constant-reference": ConstantReference,
        "kernel-reference": KernelReference,
    }.items():
        app.add_directive(name, directive)
    app.connect("autodoc-process-signature", signature_of_a_model)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
