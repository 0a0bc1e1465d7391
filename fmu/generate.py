"""C code from a variable table.

``variables.h`` has the struct, ``variables.c`` its start values and one row to each variable.
"""

import math

from table import FIRST_REFERENCE, STRING_SIZE, Table, Variable

C_TYPES = {"Float64": "double", "Boolean": "int", "String": "char"}
TABLE_NAMES = {"Float64": "reals", "Boolean": "booleans", "String": "strings"}


def quote(text: str) -> str:
    """A C string literal; everything but plain ASCII in octal, which ends after three digits."""
    plain = (
        chr(b) if 32 <= b < 127 and chr(b) not in '"\\?' else f"\\{b:03o}"
        for b in text.encode("utf-8")
    )
    return '"' + "".join(plain) + '"'


def number(value: float) -> str:
    """A C literal that reads back as the same double."""
    if math.isinf(value):
        return "INFINITY" if value > 0 else "-INFINITY"
    return repr(float(value))


def _comment(text: str) -> str:
    return text.replace("*/", "* /")


def header(table: Table) -> str:
    """The text of ``variables.h``."""
    reals = table.of_type("Float64")
    outputs = [i for i, v in enumerate(reals) if v.causality == "output"]
    lines = [
        "/* Generated from variables.toml by fmu/build.py. */",
        "#ifndef VARIABLES_H",
        "#define VARIABLES_H",
        "",
        f"#define MODEL_NAME {quote(table.model['name'])}",
        f"#define MODEL_CATEGORIES {len(table.model['log_categories'])}",
        f"#define MODEL_STRING_SIZE {STRING_SIZE}",
        f"#define MODEL_REALS {len(reals)}u /* the struct begins with them, by value reference */",
        f"#define MODEL_OUTPUTS_BEGIN {outputs[0] if outputs else 0}u /* real outputs */",
        f"#define MODEL_OUTPUTS_END {outputs[-1] + 1 if outputs else 0}u",
        "",
        "typedef struct {",
    ]
    for kind, c_type in C_TYPES.items():
        for f in (f for f in table.fields if f.type == kind):
            shape = f"[{f.count}]" if f.count > 1 else ""
            room = "[MODEL_STRING_SIZE]" if kind == "String" else ""
            lines.append(f"    {c_type} {f.name}{shape}{room}; /* {_comment(f.comment)} */")
    return "\n".join([*lines, "} Variables;", "", "#endif", ""])


def _role(variable: Variable) -> str:
    if variable.causality == "parameter":
        return f"PARAMETER_{variable.variability.upper()}"
    return variable.causality.upper()


def _start(variable: Variable) -> str:
    if isinstance(variable.start, str):
        return quote(variable.start)
    return number(variable.start) if variable.type == "Float64" else str(int(variable.start))


def source(table: Table, token: str) -> str:
    """The text of ``variables.c``."""
    lines = [
        "/* Generated from variables.toml by fmu/build.py. */",
        "#include <math.h>",
        '#include "table.h"',
        "",
        f"const char model_token[] = {quote(token)};",
        "",
        "const char *const model_categories[MODEL_CATEGORIES] = {",
        *(f"    {quote(name)}," for name, _ in table.model["log_categories"]),
        "};",
        "",
        "const Variables model_start = {",
        *(f"    .{v.field} = {_start(v)}," for v in table.variables if v.start),
        "};",
    ]
    for kind, name in TABLE_NAMES.items():
        rows = [
            f"    {{{quote(v.name)}, {quote(v.unit)}, offsetof(Variables, {v.field}), {_role(v)}, "
            f"{number(v.minimum)}, {number(v.maximum)}, {int(v.can_be_missing)}}},"
            for v in table.of_type(kind)
        ]
        lines += ["", f"static const VariableInfo {name}[] = {{", *rows]
        lines += [*(["    {0}, /* none */"] if not rows else []), "};"]
    lines += ["", "const VariableTable model_tables[3] = {"]
    lines += [
        f"    {{{name}, {len(table.of_type(kind))}, {FIRST_REFERENCE[kind]}}},"
        for kind, name in TABLE_NAMES.items()
    ]
    return "\n".join([*lines, "};", ""])
