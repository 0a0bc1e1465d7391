"""What an FMU carries beside ``modelDescription.xml``: how to build it, its terminals, its page."""

import html
import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence

from describe import add, document, text
from table import Table, Variable

PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{name}</title>
<style>body{{font:15px sans-serif;margin:2em;max-width:75em}}
td,th{{text-align:left;padding:2px 12px 2px 0}}</style>
</head><body>
<h1>{name} {version}</h1>
<p>{description}</p>
<h2>Use</h2>
<p>Recommended communication step {step} s; inputs are held over a step, so no output depends on an
input at the same instant. Values are in the units of the table. A parameter beyond its range, a
value that is not finite and a call at the wrong time are refused with a message; a refused call
changes nothing. An input beyond its range acts at its limit, with one warning. A step past the stop
time is refused. Errors are always logged; warnings and information only while logging is on.</p>
<p>Licence: <a href="licenses/license.txt">licenses/license.txt</a>. The FMU needs nothing but the C
library. A reference experiment, if there is one, is in <a href="fmi-ls-ref.txt">fmi-ls-ref.txt</a>.
</p>
{notes}<h2>Building from source</h2>
<p><code>sources/buildDescription.xml</code> names the files to compile and the options that give
the results of the binary bit for bit. The headers of FMI {fmi}.0 come from the importer; those the
binary was built with are in <code>{headers}/</code>. In the folder <code>sources/</code>:</p>
<pre>cc {standard} -O3 -ffp-contract=off -fPIC -shared -I../{headers} *.c -lm \
  -o {identifier}.so</pre>
<p>To link the FMU statically beside others, define
<code>FMI{fmi}_FUNCTION_PREFIX={identifier}_</code> and use headers that heed it.</p>
<h2>Variables</h2>
<table><tr>{heads}</tr>
{rows}
</table></body></html>
"""


def standard(table: Table) -> str:
    """The compiler's option for the model's language, C99 or C11."""
    return f"-std={table.model['language'].lower()}"


def build_description(table: Table, sources: Sequence[str], options: Sequence[str]) -> bytes:
    """``sources/buildDescription.xml``: of FMI 3.0, and since 2.0.4 of FMI 2 too."""
    root = ET.Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    configuration = add(root, "BuildConfiguration", modelIdentifier=table.model["identifier"])
    files = add(
        configuration, "SourceFileSet", language=table.model["language"], compiler="gcc",
        compilerOptions=" ".join([standard(table), *options]),
    )  # fmt: skip
    for name in sources:
        add(files, "SourceFile", name=name)
    add(configuration, "Library", name="m", external=True, description="C mathematics library")
    return document(root)


def terminals(table: Table) -> bytes:
    """``terminalsAndIcons/terminalsAndIcons.xml``: variables that belong together."""
    root = ET.Element("fmiTerminalsAndIcons", {"fmiVersion": "3.0"})
    group = add(root, "Terminals")
    for name, terminal in table.terminals.items():
        element = add(
            group, "Terminal", name=name, matchingRule="plug",
            terminalKind=terminal.get("kind"), description=terminal.get("description"),
        )  # fmt: skip
        for member in terminal["members"]:
            add(
                element, "TerminalMemberVariable",
                variableName=member, memberName=member, variableKind="signal",
            )  # fmt: skip
    return document(root)


def _cells(variable: Variable) -> list[str]:
    limits = ["" if math.isinf(v) else f"{v:g}" for v in (variable.minimum, variable.maximum)]
    start = "" if variable.causality == "output" else text(variable.start)
    kind = variable.variability if variable.causality == "parameter" else variable.causality
    return [variable.name, kind, variable.unit, start, *limits, variable.description]


def index(table: Table, version: str, fmi: int, headers: str, notes: str) -> bytes:
    """``documentation/index.html``: what the model is, how to use and build it, every variable;
    `notes` is what the model has to say of itself, as HTML.
    """
    model = table.model
    rows = "\n".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in _cells(v)) + "</tr>"
        for v in table.variables
    )
    heads = ("name", "kind", "unit", "start", "min", "max", "description")
    page = PAGE.format(
        name=html.escape(model["name"]),
        version=html.escape(version),
        description=html.escape(model["description"]),
        step=model["step_size"],
        fmi=fmi,
        headers=headers,
        identifier=model["identifier"],
        standard=standard(table),
        notes=notes,
        heads="".join(f"<th>{head}</th>" for head in heads),
        rows=rows,
    )
    return page.encode()
