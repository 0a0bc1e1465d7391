"""What FMPy's validation finds and the checks here have not said already."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final

from cosim.check.archive import MODEL_DESCRIPTION
from cosim.check.finding import Finding, Report

# FMPy's sentences and the codes that say the same
_SAME: Final = (
    (r"name .* is not unique", ("duplicate-name",)),
    (r"must have variability", ("illegal-combination",)),
    (r"[Cc]ombination (of )?causality", ("illegal-combination",)),
    (r"has no start value", ("start-missing",)),
    (r"provides a start value", ("start-not-allowed",)),
    (r"^The unit ", ("unit-undefined",)),
    (r"display unit", ("display-unit-undefined",)),
    (r"same value reference", ("reference-conflict",)),
    (r"ModelStructure/Outputs", ("structure-output-missing", "structure-output-extra")),
    (r"InitialUnknowns", ("structure-initial-unknown-missing", "structure-initial-unknown-extra")),
    (r"independent variable", ("independent-variable",)),
    (r"dependenciesKind", ("structure-dependencies",)),
    (r"backslash", ("backslash-path", "unsafe-path")),
    (r"declaredType", ("type-undefined",)),
    (r"The attribute|Element '|level ERROR|column", ("schema",)),
)


def other_tool_findings(report: Report) -> Iterator[Finding]:
    """Yield what FMPy objects to, unless a code of the same meaning has been found.

    Where the XML itself is unreadable, or refers to what does not exist, FMPy stops with a message
    of its own insides; the findings here stand for it.
    """
    from fmpy import read_model_description
    from fmpy.model_description import ValidationError

    broken = {"xml-syntax", "schema", "structure-unknown-variable", "no-model-description",
              "wrong-case", "archive-damaged", "type-undefined"}  # fmt: skip
    if broken & set(report.codes):
        return
    try:
        read_model_description(
            str(report.path), validate=True,
            validate_variable_names=False, validate_model_structure=True,
        )  # fmt: skip
        problems = []
    except ValidationError as error:
        problems = list(error.problems)
    except Exception as error:  # FMPy raises what it likes
        problems = [str(error) or type(error).__name__]
    for problem in problems:
        codes = next((codes for pattern, codes in _SAME if re.search(pattern, problem)), ())
        if not set(codes) & set(report.codes):
            line = re.search(r"line (\d+)", problem)
            where = f"{MODEL_DESCRIPTION}:{line[1]}" if line else MODEL_DESCRIPTION
            yield Finding("fmpy", where, " ".join(problem.split()))
