"""The ledger of the gates and its page."""

from __future__ import annotations

from pathlib import Path

import gates
import numpy as np
import pytest
from gates import Study, at_least, at_most, between, gate


@pytest.fixture(autouse=True)
def _own_ledger(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("LEDGER", "STUDIES", "PLOTS"):
        monkeypatch.setattr(gates, name, type(getattr(gates, name))())


def test_a_gate_that_holds_is_a_line_of_its_section() -> None:
    gate("Tyres", "stiffness [kN]", "a book", np.array([1.5, 2.25]), between(1.0, 3.0))
    page = gates.page()
    assert "## 4. Tyres" in page
    assert "| stiffness [kN] | a book | 1 to 3 | 1.5 2.25 | yes |" in page
    assert "## 5." not in page


@pytest.mark.parametrize(
    ("value", "limit"),
    [(1.1, at_most(1.0)), (0.9, at_least(1.0)), ([1.0, 5.0], between(0.0, 4.0)),
     (float("nan"), at_most(1.0))],
)  # fmt: skip
def test_a_gate_that_does_not_hold_fails_and_says_so(value: float, limit: gates.Limit) -> None:
    with pytest.raises(AssertionError, match=r"\*\*NO\*\*"):
        gate("Tyres", "value [-]", "a book", value, limit)
    assert "**NO**" in gates.page()


def test_two_gates_may_not_share_a_name() -> None:
    gate("Tyres", "value [-]", "a book", 1.0, at_most(2.0))
    gate("Tyres", "value [-]", "a book", 1.0, at_most(2.0))  # the same once more
    with pytest.raises(AssertionError, match="two gates named"):
        gate("Tyres", "value [-]", "a book", 1.5, at_most(2.0))


def test_sections_stand_in_their_order_and_studies_behind_the_gates(tmp_path: Path) -> None:
    gate("Solver", "b [-]", "x", 1.0, at_most(2.0))
    gate("Tyres", "a [-]", "x", 1.0, at_most(2.0))
    gates.STUDIES.append(Study("Tyres", "What it is.", ("term", "mm/s"), (("one", 1.23456),)))
    gates.write_page(tmp_path / "new")
    page = (tmp_path / "new" / "README.md").read_text(encoding="utf-8")
    assert page.index("| a [-]") < page.index("What it is.") < page.index("| b [-]")
    assert "| one | 1.23 |" in page


def test_unknown_sections_are_refused() -> None:
    with pytest.raises(AssertionError, match="Tires"):
        gate("Tires", "a [-]", "x", 1.0, at_most(2.0))
