"""The layout of a model's state, from its header: what makes a serialised FMU state readable.

A model whose header declares ``State`` (doubles only) and ``Memory``, which begins with it and is
what the FMI layer saves last, gets a table of the state's doubles in its FMUs. With it a tool can
linearise the model (cosim/linearise).
"""

import json
import re

from variables import TableError

STATE_TABLE = "extra/org.suspension-cosim/states.json"
CORNERS = ("FL", "FR", "RL", "RR")
PARTS = {"double": ("",), "Vec": ("x", "y", "z"), "Four": CORNERS}
SIZES = {"double": 8, "int": 4}
CHECKSUM_AT = 64  # in serialised bytes, behind the token (common/state.c): FNV-1a of all behind it


def fields(header: str, struct: str) -> list[tuple[str, str, str]]:
    """Type, name and array length (or "") of each field of ``typedef struct {...} NAME;``."""
    plain = re.sub(r"/\*.*?\*/", "", header, flags=re.DOTALL)
    found = re.search(rf"typedef struct \{{([^{{}}]*)\}} {struct};", plain)
    result = []
    for declaration in filter(str.strip, found[1].split(";") if found else []):
        kind, _, names = declaration.strip().partition(" ")
        for name in names.split(","):
            word = re.fullmatch(r"\s*(\w+)(?:\[([^\]]*)\])?\s*", name)
            if word is None:
                raise TableError(f"{struct}: '{declaration.strip()}' is not a plain field.")
            result.append((kind, word[1], word[2] or ""))
    return result


def state_names(header: str) -> list[str]:
    """The names of the state's doubles in their order; empty if the header has no ``State``."""
    names = []
    for kind, name, length in fields(header, "State"):
        if kind not in PARTS:
            raise TableError(f"State: {name} is a {kind}; only {', '.join(PARTS)} can be saved.")
        parts = PARTS[kind]
        if length:
            parts = CORNERS if length == "CORNERS" else tuple(str(i) for i in range(int(length)))
        names += [f"{name}.{part}" if part else name for part in parts]
    return names


def bytes_behind(header: str) -> int:
    """How many bytes follow the state in ``Memory``, padding included."""
    size = 0
    for kind, name, length in fields(header, "Memory")[1:]:
        if kind not in SIZES:
            raise TableError(f"Memory: {name} is a {kind}; it has {' and '.join(SIZES)} only.")
        words = [word.strip() for word in length.split("+") if word]
        count = sum(len(CORNERS) if word == "CORNERS" else int(word) for word in words) or 1
        size += -size % SIZES[kind] + SIZES[kind] * count
    return size + -size % 8


def state_table(header: str) -> bytes | None:
    """``states.json``: the names of the state's doubles, how many bytes before the end of a
    serialised state the first one stands, and where the checksum is that has to go with them.
    """
    names = state_names(header)
    if not names:
        return None
    table = {
        "doubles": names,
        "bytes_before_end": bytes_behind(header) + 8 * len(names),
        "fnv1a_checksum_at": CHECKSUM_AT,
    }
    return (json.dumps(table, indent=1) + "\n").encode()
