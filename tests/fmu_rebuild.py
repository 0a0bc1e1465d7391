"""FMUs with one function of the standard replaced: a defect whose place the rest does not know.

The FMU's own sources are compiled once and their functions renamed; a few lines of C stand in front
of the ones that a mutant breaks, and all others lead straight on. Linux and GNU binutils only.
"""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Final

import fmpy
import pytest
from fmu_face import build, toolchain
from fmu_mutants import mutate

from cosim.check.symbols import standard_functions

FLAGS: Final = ("-std=gnu11", "-O0", "-fPIC", "-fvisibility=hidden", "-w")
NEEDS_BINUTILS: Final = pytest.mark.skipif(
    sys.platform != "linux" or not shutil.which("objcopy"), reason="needs Linux and objcopy"
)

# Parameters of the functions that mutants replace, by the names that both versions share
_VALUES: Final = {
    2: "void *c, const unsigned vr[], size_t n, {0} v[]",
    3: "void *c, const unsigned vr[], size_t n, {0} v[], size_t m",
}
_STOP: Final = "double tolerance, double start, {0} limited, double stop"
PARAMETERS: Final[dict[str, dict[int, str]]] = {
    "Instantiate": {
        2: "fmi2String name, fmi2Type type, fmi2String token, fmi2String resources, "
        "const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging",
        3: "fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, "
        "fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early, "
        "const fmi3ValueReference vr[], size_t n, fmi3InstanceEnvironment environment, "
        "fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update",
    },
    "Experiment": {
        2: "void *c, fmi2Boolean with, " + _STOP.format("fmi2Boolean"),
        3: "void *c, fmi3Boolean with, " + _STOP.format("fmi3Boolean"),
    },
    "DoStep": {
        2: "void *c, double t, double h, fmi2Boolean forward",
        3: "void *c, double t, double h, fmi3Boolean forward, fmi3Boolean *event, "
        "fmi3Boolean *end, fmi3Boolean *early, double *last",
    },
    "GetReal": {2: _VALUES[2].format("double"), 3: _VALUES[3].format("double")},
    "SetReal": {2: _VALUES[2].format("const double"), 3: _VALUES[3].format("const double")},
    "GetState": dict.fromkeys((2, 3), "void *c, void **state"),
    "SetState": dict.fromkeys((2, 3), "void *c, void *state"),
    "StateSize": dict.fromkeys((2, 3), "void *c, void *state, size_t *size"),
    "Deserialize": {
        2: "void *c, const fmi2Byte bytes[], size_t size, void **state",
        3: "void *c, const fmi3Byte bytes[], size_t size, void **state",
    },
    **{
        name: dict.fromkeys((2, 3), "void *c")
        for name in ("ExitInitializationMode", "Terminate", "Reset", "FreeInstance")
    },
    "GetVersion": {2: "void", 3: "void"},
}
_NAMES: Final = {
    2: {"Experiment": "SetupExperiment", "GetState": "GetFMUstate", "SetState": "SetFMUstate",
        "StateSize": "SerializedFMUstateSize", "Deserialize": "DeSerializeFMUstate"},
    3: {"Instantiate": "InstantiateCoSimulation", "Experiment": "EnterInitializationMode",
        "GetReal": "GetFloat64", "SetReal": "SetFloat64", "GetState": "GetFMUState",
        "SetState": "SetFMUState", "StateSize": "SerializedFMUStateSize",
        "Deserialize": "DeserializeFMUState"},
}  # fmt: skip
_RESULTS: Final = {
    "Instantiate": "void *", "FreeInstance": "void", "GetVersion": "const char *",
}  # fmt: skip
Functions = Mapping[str, str]  # function and the body in its place; "top" for what stands before

_HEAD: Final = """\
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include "fmi{0}Functions.h"
typedef fmi{0}Status Status;
enum {{ OK, WARNING, DISCARD, ERROR }};
#if {0} == 2
static fmi2CallbackLogger logger;
#define SAY(c, words) logger(NULL, "checked", fmi2Error, "logStatusError", words)
#define MORE
#else
static fmi3LogMessageCallback logger;
#define SAY(c, words) logger(NULL, fmi3Error, "logStatusError", words)
#define MORE , 1
#endif
#define REFUSE(words) {{ SAY(c, words); return ERROR; }}
Status inner_{1}(void *, const unsigned *, size_t, double *{3});
Status inner_{2}(void *, const unsigned *, size_t, const double *{3});
static double get(void *c, unsigned vr) {{ double v = 0; inner_{1}(c, &vr, 1, &v MORE); return v; }}
static void set(void *c, unsigned vr, double v) {{ inner_{2}(c, &vr, 1, &v MORE); }}
"""


def full_name(function: str, version: int) -> str:
    """Return the standard's name of a function as mutants call it."""
    return f"fmi{version}{_NAMES[version].get(function, function)}"


def rebuilt(
    fmu: Path, folder: Path, functions: Functions, without: Sequence[str] = (), **others: object
) -> Path:
    """Write the FMU as `folder`/mutant.fmu with other bodies of functions, or without them.

    In a body, INNER is the call of the function proper, VR(name) the value reference of a variable,
    TOKEN the FMU's token, REFUSE("words") an answer of Error; `get` and `set` reach real variables.
    `others` goes to `mutate`.
    """
    version = _version(fmu)
    (folder / "outer.c").write_text(_outer(fmu, version, functions))
    replaced = {full_name(name, version) for name in ("Instantiate", *functions) if name != "top"}
    names = set(standard_functions(version)) - {f"fmi{version}{n}" for n in without}
    leads = [f"-Wl,--defsym,{name}=inner_{name}" for name in sorted(names - replaced)]
    exports = "; ".join(sorted(names))
    (folder / "exports").write_text(f"{{ global: {exports}; local: *; }};")
    run(
        [*build.compiler(None), *FLAGS, f"-I{_headers()}", "-shared", "outer.c",
         *map(str, objects(fmu)), *leads, "-Wl,--version-script,exports", "-lm", "-o", "linked.so"],
        folder,
    )  # fmt: skip
    content = (folder / "linked.so").read_bytes()
    return mutate(fmu, folder / "mutant.fmu", files={_binary(fmu): content}, **others)


@cache
def objects(fmu: Path) -> tuple[Path, ...]:
    """Return the FMU's compiled sources with their functions renamed to inner_."""
    folder, version = Path(mkdtemp(prefix="fmu-objects-")), _version(fmu)
    with zipfile.ZipFile(fmu) as archive:
        names = [n for n in archive.namelist() if n.startswith("sources/") and "." in n]
        for name in names:
            (folder / Path(name).name).write_bytes(archive.read(name))
    renames = [f"--redefine-sym={n}=inner_{n}" for n in standard_functions(version)]
    made = []
    for file in sorted(folder.glob("*.c")):
        target = file.with_suffix(".o")
        includes = f"-I{_headers()}"
        run([*build.compiler(None), *FLAGS, includes, "-c", file.name, "-o", target.name], folder)
        run(["objcopy", *renames, target.name], folder)
        made.append(target)
    return tuple(made)


def _outer(fmu: Path, version: int, functions: Functions) -> str:
    """The C code that stands before the FMU's own."""
    values = "" if version == 2 else ", size_t"
    getter, setter = full_name("GetReal", version), full_name("SetReal", version)
    text = _HEAD.format(version, getter, setter, values) + functions.get("top", "") + "\n"
    keep = f"logger = {'functions->logger' if version == 2 else 'log'};"
    bodies = {"Instantiate": "return INNER;", **functions}
    bodies["Instantiate"] = f"{keep} {bodies['Instantiate']}"
    for name, body in bodies.items():
        if name != "top":
            text += _function(name, body, version)
    description = fmpy.read_model_description(str(fmu))
    known = {v.name: v.valueReference for v in description.modelVariables}
    text = re.sub(r"VR\(([\w.]+)\)", lambda m: str(known[m[1]]), text)
    return text.replace("TOKEN", f'"{description.guid}"')


def _function(name: str, body: str, version: int) -> str:
    parameters, result = PARAMETERS[name][version], _RESULTS.get(name, "Status")
    names = [re.findall(r"\w+", part)[-1] for part in parameters.split(",")]
    call = f"inner_{full_name(name, version)}({', '.join(n for n in names if n != 'void')})"
    inner = body.replace("INNER", call)
    once = f"{result} inner_{full_name(name, version)}({parameters});\n"
    repeated = "" if name in ("GetReal", "SetReal") else once
    return f"{repeated}{result} {full_name(name, version)}({parameters}) {{ {inner} }}\n"


@cache
def _version(fmu: Path) -> int:
    return int(fmpy.read_model_description(str(fmu), validate=False).fmiVersion[0])


def _binary(fmu: Path) -> str:
    with zipfile.ZipFile(fmu) as archive:
        return next(n for n in archive.namelist() if n.startswith("binaries/"))


def _headers() -> str:
    return str(toolchain.header_directory())


def run(command: list[str], folder: Path) -> None:
    """Run a tool; its words are the failure's."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{shlex.join(command)}\n{done.stderr}"
