"""The checker calls every type of both FMI versions by its own functions."""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from fmu_mutants import MODEL, mutate, put
from types_fmu_build import TYPES, types_fmu

from cosim.check.checker import check

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="compiles an ELF library")


@pytest.fixture(scope="module", params=[2, 3], ids=["fmi2", "fmi3"])
def fmu(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return types_fmu(tmp_path_factory.mktemp("types") / "types.fmu", request.param)


def test_an_fmu_of_every_type_is_sound(fmu: Path) -> None:
    report = check(fmu)
    assert [(f.code, f.message) for f in report.findings] == []
    assert len(report.trials) == 15
    assert report.not_judged == []


def test_the_start_value_of_every_type_is_compared(fmu: Path, tmp_path: Path) -> None:
    version = int(check(fmu, static=True).fmi_version[0])
    kinds = [kind for kind in TYPES[version] if kind != "String"]
    others = {"Boolean": "true", "Enumeration": "3"}

    def edit(root: ET.Element) -> None:
        for kind in kinds:
            put(f"{kind}.input", start=others.get(kind, "5"))(root)

    report = check(mutate(fmu, tmp_path / "m.fmu", {MODEL: edit}))
    assert report.codes == ["start-differs"]
    assert [f.where for f in report.findings] == sorted(f"{kind}.input" for kind in kinds)
