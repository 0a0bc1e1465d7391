"""What the checker says of an FMU: findings with a stable code, and the report of all of them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Literal

from cosim.check.codes import CODES

Severity = Literal["error", "warning"]
LISTED: Final = 5


@dataclass(frozen=True)
class Finding:
    """One defect: its code, the file and line or the call where it shows, and a sentence."""

    code: str
    where: str
    message: str

    @property
    def severity(self) -> Severity:
        """`error` for a defect, `warning` for what a user should know; fixed for each code."""
        return CODES[self.code].severity

    @property
    def order(self) -> tuple[bool, str, str, str]:
        """Errors first, then by code, place and words."""
        return (self.severity != "error", self.code, self.where, self.message)


@dataclass
class Report:
    """All findings of one FMU, and in sentences what could not be judged."""

    path: Path
    fmi_version: str = ""
    findings: list[Finding] = field(default_factory=list)
    not_judged: list[str] = field(default_factory=list)
    trials: list[str] = field(default_factory=list)

    def add(self, findings: Iterable[Finding]) -> None:
        """Add findings; what is already there by code and place is not said twice."""
        known = {(f.code, f.where, f.message) for f in self.findings}
        for raw in findings:
            finding = replace(raw, message=" ".join(raw.message.split()))
            if (finding.code, finding.where, finding.message) not in known:
                self.findings.append(finding)
        self.findings.sort(key=lambda finding: finding.order)

    @property
    def codes(self) -> list[str]:
        """The codes that were found, each once, errors first."""
        return list(dict.fromkeys(finding.code for finding in self.findings))

    def count(self, severity: Severity) -> int:
        """Return the number of findings of one severity."""
        return sum(finding.severity == severity for finding in self.findings)

    @property
    def exit_code(self) -> int:
        """0 without errors, else 1."""
        return 1 if self.count("error") else 0

    def as_json(self) -> dict[str, Any]:
        """The report for programs."""
        return {
            "file": str(self.path),
            "fmi_version": self.fmi_version,
            "errors": self.count("error"),
            "warnings": self.count("warning"),
            "findings": [
                {"code": f.code, "severity": f.severity, "where": f.where, "message": f.message}
                for f in self.findings
            ],
            "trials": self.trials,
            "not_judged": self.not_judged,
        }


def listed(names: Iterable[str], limit: int = LISTED) -> str:
    """Return names in a row, the first few in full and the number of the rest."""
    every = list(names)
    shown = ", ".join(every[:limit])
    return f"{shown} and {len(every) - limit} more" if len(every) > limit else shown


def numbered(count: int, what: str) -> str:
    """Return `1 error`, `2 errors`, `no errors`."""
    return f"{count or 'no'} {what}{'' if count == 1 else 's'}"
