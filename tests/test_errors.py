import pickle

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.errors import (
    BusError,
    CosimError,
    FmuError,
    InputError,
    NetworkError,
    Place,
    Problem,
    did_you_mean,
    nearest,
)


def test_one_tree_with_the_documented_exit_codes():
    errors = (InputError, FmuError, NetworkError, BusError)
    assert {error: error.exit_code for error in errors} == {
        InputError: 2,
        FmuError: 3,
        NetworkError: 3,
        BusError: 3,
    }
    assert all(issubclass(error, CosimError) for error in errors)


def test_an_input_error_shows_every_problem_with_place_line_and_caret():
    place = Place("a.yaml", 7, 3, "  sped_kmh: 50", 8)
    error = InputError([Problem("no such field", place), Problem("and this")])
    assert str(error) == (
        "a.yaml:7:3: no such field\n     7 |   sped_kmh: 50\n       |   ^^^^^^^^\nand this"
    )


def test_carets_never_reach_beyond_the_line_and_follow_tabs():
    place = Place("a.yaml", 1, 2, "\tx: 1", 10_000)
    assert place.excerpt().splitlines()[-1] == "       | \t^^^^"


def test_an_input_error_survives_a_process_boundary():
    error = InputError([Problem("wrong", Place("a.yaml", 1, 1, "x", 1))])
    copy = pickle.loads(pickle.dumps(error))
    assert str(copy) == str(error)
    assert copy.problems == error.problems


@pytest.mark.parametrize(
    ("name", "expected"),
    [("agressive", "aggressive"), ("NORMAL", "normal"), ("def", "defensive"), ("zzz", None)],
)
def test_nearest(name, expected):
    assert nearest(name, ["aggressive", "normal", "defensive"]) == expected


@settings(deadline=None)
@given(st.sampled_from(["aggressive", "defensive", "hockenheim", "controllers"]), st.data())
def test_one_wrong_letter_is_always_recognised(word, data):
    index = data.draw(st.integers(0, len(word) - 1))
    wrong = word[:index] + "z" + word[index + 1 :]
    assert nearest(wrong, ["aggressive", "defensive", "hockenheim", "controllers"]) == word


def test_no_hint_without_a_near_choice():
    assert did_you_mean("zzz", ["aggressive"]) == ""
