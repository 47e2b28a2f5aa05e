"""Writes the pages that are made from the code: keys of scenes, commands, Python; a hook of MkDocs.

Run: python docs/reference.py; they end in .markdown, those by hand in .md. After a build the site is searched for what
it would load from elsewhere.
"""

from __future__ import annotations

import argparse
import importlib
import inspect
import json
import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from incipient.commands.options import COMMANDS
from incipient.scene import schema

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig

PAGES = Path(__file__).parent / "reference"
BOUNDS = {
    "exclusiveMinimum": "> {}",
    "minimum": "≥ {}",
    "exclusiveMaximum": "< {}",
    "maximum": "≤ {}",
}
# What is public, module by module.
PUBLIC = {
    "incipient": "Scenes in, results out.",
    "incipient.sweep": "Many cases in one file.",
    "incipient.contact": "Both criteria, without a flow.",
    "incipient.results.result": "What a run gives back.",
    "incipient.thresholds.outcome": "What `incipient.threshold` gives back.",
}
# How annotations and defaults of calls are shortened to what a reader knows them by.
SHORTER = (
    (r"numpy\.ndarray\[typing\.Any, numpy\.dtype\[numpy\.float64\]\]", "Floats"),
    (r"<class '([^']*)'>", r"\1"),
    (r"<function [^=]*? at 0x[0-9a-f]+>|<factory>", "..."),
    (r"\b(?:[a-z_]\w*\.)+(?=[A-Z])", ""),
)
FOREIGN = re.compile(
    r"""<(?:script|img|link|iframe|source)\b[^>]*?\b(?:src|href)=["']?(?:https?:)?//""", re.I
)
FOREIGN_STYLE = re.compile(r"""(?:url\(|@import)\s*["']?(?:https?:)?//""")


def pages() -> dict[Path, str]:
    """The text of each page."""
    texts = {"scene": scene_page(), "commands": commands_page(), "python": python_page()}
    return {PAGES / f"{name}.markdown": text for name, text in texts.items()}


def on_post_build(config: MkDocsConfig) -> None:
    """Refuse a site that loads anything from another host."""
    from mkdocs.exceptions import PluginError

    for path in Path(config.site_dir).rglob("*"):
        pattern = {".html": FOREIGN, ".css": FOREIGN_STYLE}.get(path.suffix)
        link = pattern and pattern.search(path.read_text(encoding="utf-8"))
        if link:
            raise PluginError(f"{path}: would load from another host: {link[0]}")


# -- keys of scenes -----------------------------------------------------------------------------------------


def scene_page() -> str:
    """All keys of scenes, section by section."""
    stored = schema()
    parts = [
        "# Keys of a scene",
        "Every key that a scene file may have, made from the code that checks it. A key without a default must "
        "be given. `incipient schema` prints the same for editors; `incipient new` explains them in a scene.",
    ]
    for name, definition in stored["properties"].items():
        models = [stored["definitions"][one] for one in references(definition)]
        parts += [f"## `[{name}]`" if models else f"## `{name}`", f"{definition['description']}."]
        parts += section(models, stored["required"], name)
        for key, part in models[0]["properties"].items() if len(models) == 1 else ():
            for one in references(part):
                parts += [
                    f"### `[{name}.{key}]`",
                    keys(stored["definitions"][one], stored["definitions"][one]["properties"]),
                ]
    return "\n\n".join(parts) + "\n"


def references(node: Any) -> Iterator[str]:
    """Names of the definitions that a node of the schema refers to."""
    if isinstance(node, dict):
        if "$ref" in node:
            yield node["$ref"].rpartition("/")[2]
        for child in node.values():
            yield from references(child)
    elif isinstance(node, list):
        for child in node:
            yield from references(child)


def section(models: list[dict[str, Any]], required: list[str], name: str) -> Iterator[str]:
    """Tables of a section: keys that all its kinds have, then those of each kind."""
    if models:
        yield "This section must be there." if name in required else "This section may be left out."
    if len(models) == 1:
        yield keys(models[0], models[0]["properties"])
        return
    if not models:
        return
    tag = next(one for one in ("kind", "shape") if one in models[0]["properties"])
    common = set.intersection(*(set(model["properties"]) for model in models)) - {tag}
    differing = {
        key for key in common if len({json.dumps(model["properties"][key]) for model in models}) > 1
    }
    if common - differing:
        yield f"With every `{tag}`:"
        yield keys(models[0], [key for key in models[0]["properties"] if key in common - differing])
    alike: dict[str, list[dict[str, Any]]] = {}
    for model in models:  # those of the plane, those of space
        alike.setdefault(
            json.dumps([model["properties"][key] for key in sorted(differing)]), []
        ).append(model)
    for group in alike.values() if differing else ():
        yield f"With `{tag}` {', '.join(f'`{value_of(model, tag)}`' for model in group)}:"
        yield keys(group[0], [key for key in group[0]["properties"] if key in differing])
    for model in models:
        yield f"### `{tag} = {value_of(model, tag)}`"
        yield model["description"]
        own = [key for key in model["properties"] if key not in common and key != tag]
        if own:
            yield keys(model, own)


def value_of(model: dict[str, Any], tag: str) -> str:
    """What the key that tells kinds apart says for one, as TOML has it."""
    choice = model["properties"][tag]
    return json.dumps(choice["const"] if "const" in choice else choice["enum"][0])


def keys(model: dict[str, Any], chosen: Any) -> str:
    """A table of keys of a section."""
    lines = ["| key | what | values | default |", "| --- | --- | --- | --- |"]
    for key in chosen:
        definition = model["properties"][key]
        default = (
            "must be given"
            if key in model.get("required", ())
            else shown(definition.get("default"))
        )
        what = escaped(definition.get("description", ""))
        lines.append(f"| `{key}` | {what} | {escaped(values(definition))} | {escaped(default)} |")
    return "\n".join(lines)


def shown(value: Any) -> str:
    """A default as TOML has it."""
    return "none" if value is None else f"`{json.dumps(value, ensure_ascii=False)}`"


def values(definition: dict[str, Any]) -> str:
    """What a key may be, in words."""
    if "$ref" in definition:
        return "table"
    if "anyOf" in definition:
        return ", or ".join(values(one) for one in definition["anyOf"] if one.get("type") != "null")
    if "enum" in definition or "const" in definition:
        return ", ".join(
            f"`{json.dumps(one)}`" for one in definition.get("enum", [definition.get("const")])
        )
    if definition.get("type") == "array":
        least, most = definition.get("minItems"), definition.get("maxItems")
        number = (
            f"{least} "
            if least == most and least
            else f"{least} to {most} "
            if least and most
            else ""
        )
        number = number or (f"at least {least} " if least else "")
        return f"list of {number}({values(definition['items'])})"
    words = {
        "number": "number",
        "integer": "whole number",
        "boolean": "`true`, `false`",
        "string": "text",
    }
    bounds = " and ".join(
        form.format(f"{definition[key]:g}") for key, form in BOUNDS.items() if key in definition
    )
    return f"{words[definition['type']]} {bounds}".strip()


def escaped(text: str) -> str:
    """A text within a table."""
    return text.replace("|", "\\|").replace("<", "&lt;").replace("\n", " ")


# -- commands -----------------------------------------------------------------------------------------------


def commands_page() -> str:
    """The help of all commands."""
    parts = [
        "# Commands",
        "What `incipient COMMAND --help` says, for all commands. Options that all have stand here once.",
    ]
    parts.append(
        "| option | what |\n| --- | --- |\n| `--log-level` | how much to say: debug, info, warning, error |"
    )
    for name, command in COMMANDS.items():
        parser = argparse.ArgumentParser(prog=f"incipient {name}", add_help=False)
        command.add_options(parser)
        usage = textwrap.fill(
            " ".join(parser.format_usage().split()).removeprefix("usage: "),
            96,
            subsequent_indent="    ",
        )
        parts += [
            f"## {name}",
            f"{command.text[0].upper()}{command.text[1:]}.",
            f"```text\n{usage}\n```",
        ]
        lines = []
        for one in parser._actions:
            if one.help == argparse.SUPPRESS:  # retired
                continue
            written = " ".join(filter(None, (", ".join(one.option_strings), argument(one))))
            lines.append(f"| `{written}` | {escaped(one.help or '')} |")
        if lines:
            parts.append("\n".join(["| | |", "| --- | --- |", *lines]))
    return "\n\n".join(parts) + "\n"


def argument(action: argparse.Action) -> str:
    """What is written for the value of an option, or for an argument."""
    if action.nargs == 0:
        return ""
    if action.metavar:
        return str(action.metavar)
    if action.choices:
        return "{" + ",".join(map(str, action.choices)) + "}"
    return action.dest.upper()


# -- Python -------------------------------------------------------------------------------------------------


def python_page() -> str:
    """The public functions and classes with their docstrings."""
    parts = [
        "# Python",
        "The public functions and classes, made from the code. Scenes are built from the classes of `incipient.scene`, "
        'one for each section; their keys are those of [the scene file](scene.markdown). "Collective" is said of '
        "functions that all ranks of an MPI run must call together.",
    ]
    for name, what in PUBLIC.items():
        module = importlib.import_module(name)
        parts += [f"## `{name}`", what]
        for public in sorted(
            exported(module), key=lambda one: (one[0].isupper() or one[0] == one[0].upper(), one)
        ):
            parts += documented(public, getattr(module, public))
    return "\n\n".join(parts) + "\n"


def exported(module: Any) -> list[str]:
    """Names that a module gives: those it says, or those it defines."""
    named = getattr(module, "__all__", None)
    names = named or [name for name in vars(module) if not name.startswith("_")]
    here = [
        name
        for name in names
        if named or getattr(getattr(module, name), "__module__", "") == module.__name__
    ]
    return [name for name in here if callable(getattr(module, name))]


def documented(name: str, thing: Any) -> Iterator[str]:
    """A function with its signature, or a class with its own methods."""
    yield f"### `{name}`"
    if inspect.isclass(thing) and issubclass(thing, Exception):
        yield docstring(thing)
        return
    if (
        not inspect.isclass(thing)
        or "__init__" in vars(thing)
        or hasattr(thing, "__dataclass_fields__")
    ):
        yield f"```python\n{signature(name, thing)}\n```"
    yield docstring(thing)
    yield from described_fields(thing)
    if not inspect.isclass(thing) or hasattr(thing, "model_fields"):
        return
    for method, member in vars(thing).items():
        if not method.startswith("_") and (
            inspect.isfunction(member) or isinstance(member, property | classmethod)
        ):
            member = member.__func__ if isinstance(member, classmethod) else member
            text = textwrap.indent(docstring(member), "    ").strip()
            yield f"- `{method}{'' if isinstance(member, property) else '()'}`: {text}"


def described_fields(thing: Any) -> Iterator[str]:
    """The fields of a dataclass with the comments beside or above them."""
    if not inspect.isclass(thing) or not hasattr(thing, "__dataclass_fields__"):
        return
    lines, above = [], []
    for line in map(str.strip, inspect.getsource(thing).splitlines()[1:]):
        if line.startswith(("def ", "@")):
            break
        if line.startswith("#"):
            above.append(line.lstrip("# "))
            continue
        field = re.match(r"(\w+): [^#]*(?:#\s*(.*))?$", line)
        comment = (field and field[2]) or " ".join(above)
        if field and field[1] in thing.__dataclass_fields__ and comment:
            lines.append(f"- `{field[1]}`: {escaped_html(comment)}")
        above = []
    if lines:
        yield "\n".join(lines)


def signature(name: str, thing: Any) -> str:
    """A call on as many lines as it needs."""
    try:
        call = inspect.signature(thing)
    except (TypeError, ValueError):
        return name
    parameters = [re.sub(r": '([^']*)'", r": \1", str(one)) for one in call.parameters.values()]
    returned = call.return_annotation
    result = (
        "" if returned is inspect.Signature.empty or inspect.isclass(thing) else f" -> {returned}"
    )
    for long, short in SHORTER:
        parameters = [re.sub(long, short, one) for one in parameters]
        result = re.sub(long, short, result)
    line = f"{name}({', '.join(parameters)}){result}"
    return (
        line if len(line) <= 96 else f"{name}(\n    " + ",\n    ".join(parameters) + f",\n){result}"
    )


def docstring(thing: Any) -> str:
    """A docstring as Markdown: lists of arguments and errors as lists, tables of attributes as they are."""
    text = inspect.getdoc(thing) or ""
    lines: list[str | None] = []
    listed = False
    for line in text.replace("``", "`").splitlines():
        heading = re.fullmatch(r"(Args|Raises|Returns|Results):", line)
        item = re.match(r"^(?:    )?(\w+(?:, \w+)*):\s+(\S.*)$", line)
        if heading:
            lines += ["", f"**{heading[1]}**", ""]
        elif item:
            lines += ["" if not listed else None, f"- `{item[1]}`: {item[2]}"]
        else:
            lines.append(line)
        listed = bool(item) or (listed and line.startswith(" "))
    return escaped_html("\n".join(line for line in lines if line is not None))


def escaped_html(text: str) -> str:
    """Angle brackets outside of code as entities."""
    parts = re.split(r"(`[^`\n]*`)", text)
    return "".join(part if part.startswith("`") else part.replace("<", "&lt;") for part in parts)


if __name__ == "__main__":
    for page, content in pages().items():
        page.write_text(content, encoding="utf-8")
