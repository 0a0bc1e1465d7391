"""The body of `cosim export-ssp`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from cosim import show
from cosim.errors import InputError, did_you_mean
from cosim.inspect.facts import size_of
from cosim.scenario.controllers import Controller
from cosim.scenario.load import load_labelled
from cosim.scenario.schema import Scenario
from cosim.ssp.export import export


def run(
    scenario: str,
    out: Path,
    controller: str | None,
    overrides: Sequence[tuple[str, str]],
    components_only: bool = False,
) -> None:
    """Write the package and say what is in it. Raises what `export` raises."""
    _check_place(out)
    settings = load_labelled(scenario, overrides)
    chosen = _controller(settings, controller)
    with show.progress() as progress:

        def tell(done: int, total: int) -> None:
            if progress is not None:
                progress(chosen.label, done, total)

        package = export(settings, chosen, tell, components_only)
    part = out.with_name(f".{out.name}.part")
    try:
        part.write_bytes(package.content)
        part.replace(out)
    except OSError as error:
        raise InputError(f"cannot write '{out}': {error.strerror or error}") from None
    finally:
        part.unlink(missing_ok=True)
    parts, wires = package.structure.components, package.structure.connections
    print(
        f"{out}: {' and '.join(part.name for part in parts)}, {len(wires)} connections, "
        f"{size_of(len(package.content))}\n"
        f"The commands of {package.run.stop_s:g} s with controller {chosen.label} and the sensor's "
        f"estimates are in it too.",
        file=sys.stderr,
    )


def _check_place(out: Path) -> None:
    """Raise `InputError` where no package can be written, before there is any work."""
    if out.suffix != ".ssp":
        raise InputError(f"'{out}': the name of a package ends in .ssp")
    if not out.parent.is_dir():
        raise InputError(f"'{out}': there is no folder '{out.parent}'")


def _controller(scenario: Scenario, label: str | None) -> Controller:
    """Return the controller whose commands are recorded, the first if none is named."""
    by_label = {controller.label: controller for controller in scenario.controllers}
    if label is None:
        return scenario.controllers[0]
    if label not in by_label:
        known = ", ".join(by_label)
        raise InputError(
            f"--controller {label}: the scenario has {known}{did_you_mean(label, by_label)}"
        )
    return by_label[label]
