"""Every code that a finding may have, its severity, and what it means in a line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal


@dataclass(frozen=True)
class Code:
    """Severity of a kind of finding, and what it is."""

    severity: Literal["error", "warning"]
    meaning: str


def _errors(**meanings: str) -> dict[str, Code]:
    return {name.replace("_", "-"): Code("error", text) for name, text in meanings.items()}


def _warnings(**meanings: str) -> dict[str, Code]:
    return {name.replace("_", "-"): Code("warning", text) for name, text in meanings.items()}


ARCHIVE: Final = {
    **_errors(
        archive_damaged="an entry of the ZIP archive cannot be unpacked",
        backslash_path="an entry's path has backslashes",
        case_collision="two entries differ in upper and lower case alone",
        compression="an entry is compressed by a method that FMI does not allow",
        duplicate_entry="the archive holds a file twice",
        no_model_description="modelDescription.xml is missing or in a folder",
        unsafe_path="an entry is absolute, leaves the folder with '..', or is a link",
        wrong_case="a name differs from what it must be in upper and lower case",
    ),
}
XML: Final = {
    **_errors(
        capability_contradiction="serialised states are promised without states",
        display_unit_exponents="a display unit measures something else than its unit",
        display_unit_factor="a display unit's factor is not what its name means",
        display_unit_offset="a display unit's offset is not what its name means",
        display_unit_undefined="a variable's display unit is not defined",
        duplicate_category="a log category is declared twice",
        duplicate_name="two variables have one name",
        duplicate_unit="a unit is defined twice",
        fmpy="FMPy objects to something that no other code covers",
        illegal_combination="causality, variability, initial and type do not go together",
        independent_variable="not exactly one independent variable",
        min_above_max="a range is upside down",
        model_identifier="the model identifier is no C identifier",
        nominal_negative="a nominal value is negative",
        nominal_zero="a nominal value is zero",
        not_co_simulation="the FMU has no co-simulation interface",
        not_finite="an attribute is NaN or infinite",
        reference_conflict="variables share a value reference and may not",
        schema="the XML breaks the schema of the standard",
        start_count="an array has another number of start values than elements",
        start_missing="a variable that needs a start value has none",
        start_not_allowed="a calculated variable has a start value",
        start_outside_range="a start value is outside min and max",
        step_not_positive="the default step size is zero or negative",
        stop_before_start="the default experiment stops before it starts",
        structure_dependencies="dependencies and dependenciesKind differ in number",
        structure_duplicate="ModelStructure lists a variable twice",
        structure_initial_unknown_extra="InitialUnknowns lists what does not belong there",
        structure_initial_unknown_missing="InitialUnknowns lacks a variable",
        structure_output_extra="Outputs lists what is no output",
        structure_output_missing="Outputs lacks an output",
        structure_unknown_variable="ModelStructure names an index or reference of no variable",
        token_empty="the GUID or instantiation token is empty",
        tolerance_not_positive="the default tolerance is zero or negative",
        type_undefined="a variable's declared type is not defined",
        unit_exponents="a unit's SI exponents are not what its name means",
        unit_factor="a unit's factor is not what its name means",
        unit_offset="a unit's offset is not what its name means",
        unit_undefined="a variable's unit is not defined",
        variable_name="a name breaks the naming convention",
        xml_syntax="an XML file is not well-formed",
    ),
    **_warnings(
        description_missing="parameters, inputs or outputs have no description",
        step_beyond_stop="one default step is longer than the default experiment",
        unit_missing="real inputs or outputs have no unit",
        unit_without_base="a unit that could be converted has no SI base unit",
    ),
}
FILES: Final = {
    **_errors(
        binary_architecture="a binary is for another system or processor than its folder",
        binary_format="a binary is no shared library, or cut short",
        binary_name="a platform's binary is not named by the model identifier",
        build_identifier="the build description is for another model identifier",
        icon_missing="terminals name an icon that is missing",
        no_binary_here="there is no binary for this machine (not with --static)",
        source_missing="a list of sources names a file that is missing",
        symbol_missing="a binary lacks a function of the standard",
        terminal_duplicate="terminals or their members share a name",
        terminal_variable="a terminal names a variable that does not exist",
    ),
    **_warnings(
        absolute_path="a text parameter starts as an absolute path",
        build_description_missing="there are sources without a build description",
        platform_unknown="a folder of binaries/ is no platform",
        resource_missing="a text parameter starts as a file that resources/ lacks",
        symbol_extra="a binary exports symbols that are not of the standard",
        symbol_other_interface="functions of model exchange are missing, wanted since FMI 3.0.1",
    ),
}
RUNNING: Final = {
    **_errors(
        call_failed="a call that must succeed answers Error",
        cannot_load="the system cannot load the binary",
        crash="the FMU crashes its process",
        hang="a call does not return",
        initialise_failed="the default start values do not initialise it",
        instances_share="two instances in one process change each other",
        instantiate_failed="it cannot be instantiated",
        not_deterministic="two runs with the same inputs differ",
        output_not_finite="an output is NaN or infinite",
        path_sensitive="it does not run in a folder with spaces and letters beyond ASCII",
        process_ended="the FMU ends its process",
        reset_incomplete="after reset it is not as a fresh instance",
        serialise_failed="a state cannot go through bytes, though the flag promises it",
        serialised_state_differs="a state that went through bytes goes on differently",
        state_call_failed="a state cannot be got, though the flag promises it",
        state_not_restored="a replay from a saved state differs",
        start_differs="the binary starts a parameter or input at another value than the XML",
        step_failed="a step of the default experiment fails",
        step_size_refused="another step size is refused, though the flag promises it",
        terminate_failed="it cannot be terminated after the last step",
        time_wrong="the time that it tells is not that of the steps",
        token_mismatch="the binary does not accept the token of the XML",
        token_not_checked="a wrong token is accepted",
        value_not_kept="a parameter or input reads back another value than was set",
        version_mismatch="the binary is of another FMI version than the XML",
        wrong_order_accepted="a call at the wrong time answers OK",
    ),
    **_warnings(
        inputs_refused="a step fails when inputs move within their ranges",
        log_category_undeclared="it logs under a category that the XML does not declare",
        memory_growth="memory grows with every life of an instance",
        outputs_constant="continuous outputs do not change though the inputs move",
        set_refused="a value within its range is refused",
        stop_time_ignored="a step past the given stop time answers OK",
        thread_bound="it cannot be stepped on another thread than it was made on",
    ),
}
CODES: Final[dict[str, Code]] = {**ARCHIVE, **XML, **FILES, **RUNNING}


def as_markdown() -> str:
    """Return the tables of docs/check.md: `python -m cosim.check.codes`."""
    titles = {"The archive": ARCHIVE, "The XML": XML, "The files": FILES, "Running": RUNNING}
    parts = []
    for title, codes in titles.items():
        rows = [f"| `{name}` | {code.severity} | {code.meaning} |" for name, code in codes.items()]
        parts.append("\n".join([f"### {title}", "", "| code | severity | what it is |",
                                "|---|---|---|", *rows]))  # fmt: skip
    return "\n\n".join(parts)


if __name__ == "__main__":
    print(as_markdown())
