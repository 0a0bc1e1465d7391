"""`check`: one FMU file, all checks, one report."""

from __future__ import annotations

from pathlib import Path

from cosim.check.archive import MODEL_DESCRIPTION, Archive, archive_findings
from cosim.check.binaries import binary_findings, missing_here
from cosim.check.contents import resource_findings, source_findings, terminal_findings
from cosim.check.description import Description
from cosim.check.dynamic import run_trials
from cosim.check.experiment import experiment_findings, interface_findings
from cosim.check.finding import Report
from cosim.check.other_tool import other_tool_findings
from cosim.check.schema import XmlError, parse, schema_findings
from cosim.check.structure import structure_findings
from cosim.check.units import unit_findings
from cosim.check.variables import variable_findings
from cosim.errors import InputError


def check(path: Path, static: bool = False, timeout: float = 20.0) -> Report:
    """Return all that is wrong with an FMU; with `static` it is only read, not run.

    `timeout` is how long one call of the FMU may take [s]. Raises `InputError` if the file is no
    readable archive, or of another FMI version than 2.0, 3.0, and `WorkError` if the checker
    itself is at fault.
    """
    report = Report(path)
    archive = Archive(path)
    try:
        report.add(archive_findings(archive))
        description = _description(archive, report)
        if description is None:
            return report
        _static(archive, description, report)
        if not static and description.simulation is not None:
            report.add(missing_here(archive, description))
        report.add(other_tool_findings(report))
        if not static and description.simulation is not None:
            run_trials(archive, description, report, timeout)
    finally:
        archive.close()
    return report


def _description(archive: Archive, report: Report) -> Description | None:
    """Read the model description, None if there is none that can be read."""
    name = MODEL_DESCRIPTION
    if name not in archive:
        name = archive.other_case(name) or ""
        if not name:
            return None
    if "archive-damaged" in report.codes and any(f.where == name for f in report.findings):
        return None
    try:
        root = parse(archive, name)
    except XmlError as error:
        report.add([error.finding])
        return None
    version = str(root.get("fmiVersion") or "")
    if root.tag != "fmiModelDescription" or not version.startswith(("2.", "3.")):
        what = f"of FMI {version}" if version else f"without an FMI version (<{root.tag}>)"
        raise InputError(f"{archive.path}: an FMU {what}; this checker reads FMI 2.0 and 3.0")
    report.fmi_version = version
    description = Description(root)
    report.add(schema_findings(root, description.major, MODEL_DESCRIPTION))
    return description


def _static(archive: Archive, description: Description, report: Report) -> None:
    for of_description in (
        interface_findings, experiment_findings, variable_findings, unit_findings,
        structure_findings,
    ):  # fmt: skip
        report.add(of_description(description))
    for of_both in (source_findings, terminal_findings, resource_findings):
        report.add(of_both(archive, description))
    if description.simulation is not None:
        report.add(binary_findings(archive, description))
