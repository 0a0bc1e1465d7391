"""The table of a model's state, from its header."""

from __future__ import annotations

import json
from importlib import import_module

import pytest
from fmu_face import variables

states = import_module("states")

HEADER = """
typedef struct {
    Vec place; /* m; "double" in a comment */
    double q[4], rack;
    Four travel;
    double spin[CORNERS];
} State;
typedef struct {
    State x;
    int flag;
    double steer;
    int hint[CORNERS + 1];
} Memory;
"""


def test_names_in_their_order() -> None:
    names = states.state_names(HEADER)
    assert names[:8] == ["place.x", "place.y", "place.z", "q.0", "q.1", "q.2", "q.3", "rack"]
    assert names[8:] == [f"{n}.{c}" for n in ("travel", "spin") for c in ("FL", "FR", "RL", "RR")]


def test_places_count_the_padding() -> None:
    """An int, padded to the double behind it, then five ints padded to eight bytes."""
    table = json.loads(states.state_table(HEADER) or b"")
    assert table["doubles"][0] == "place.x"
    assert table["bytes_before_end"] == 16 * 8 + 8 + 8 + 24


def test_a_model_without_a_state_has_no_table() -> None:
    assert states.state_table("typedef struct { int a; } Other;") is None


@pytest.mark.parametrize("field", ["float a;", "Road *road;", "double a : 3;"])
def test_fields_that_cannot_be_read_are_named(field: str) -> None:
    with pytest.raises(variables.TableError, match="State: "):
        states.state_table(f"typedef struct {{ {field} }} State;")
