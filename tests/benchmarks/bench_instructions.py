"""Instructions of the vehicle per 10 ms, which do not depend on the machine's load: the profile in
docs/performance.md. `python tests/benchmarks/bench_instructions.py`; needs valgrind.

Callgrind counts a run of 100 steps and one of 300; their difference is 200 steps without loading
the road and finding the equilibrium. The counts are those of this compiler, with AVX2.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from cosim.course import course_of
from cosim.scenario.load import load

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "fmu"))
import package  # noqa: E402
import toolchain  # noqa: E402
from variables import read_table  # noqa: E402

SCENARIO = ROOT / "scenarios/paper/hockenheim_normal.yaml"
FEW, MANY = 100, 300
LINE = re.compile(r"^ *([\d,]+) \([ \d.]+%\) +(?:.*/)?([^/:]+):(\w+)")


def program(folder: Path) -> Path:
    """Compile the model and its main program as the FMU's build does."""
    model = ROOT / "fmu" / "vehicle"
    sources = package.package_sources(model, read_table(model / "variables.toml"), 3)
    for name in [path.name for path in (ROOT / "fmu" / "common").glob("*.c")]:
        sources.pop(name, None)
    steps = Path(__file__).with_name("vehicle_steps.c")
    for name, content in {**sources, steps.name: steps.read_bytes()}.items():
        (folder / name).write_bytes(content)
    cc = toolchain.compiler(None)
    flags = [*toolchain.FLAGS, "-g", *toolchain.link_time_optimisation(cc)]
    files = sorted(path.name for path in folder.glob("*.c"))
    toolchain.run_compiler([*cc, *flags, *files, "-lm", "-o", "vehicle_steps"], folder)
    return folder / "vehicle_steps"


def counted(binary: Path, road: Path, steps: int) -> Counter[tuple[str, str]]:
    """Count the instructions of a run by source file and function."""
    out = binary.with_name(f"{steps}.out")
    command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={out}"]
    subprocess.run([*command, binary, road, str(steps)], check=True, capture_output=True)
    listed = ["callgrind_annotate", "--threshold=100", "--auto=no", str(out)]
    text = subprocess.run(listed, check=True, capture_output=True, text=True).stdout
    counts: Counter[tuple[str, str]] = Counter()
    for line in text.splitlines():
        if found := LINE.match(line):
            counts[found[2], found[3]] += int(found[1].replace(",", ""))
    return counts


def main() -> None:
    """Print the total and the share of each source file in an evaluation."""
    if shutil.which("valgrind") is None:
        sys.exit("bench_instructions.py needs valgrind (Debian and Ubuntu: apt install valgrind)")
    road = course_of(load(SCENARIO, ["road.surface=A"])).file
    assert road is not None
    with tempfile.TemporaryDirectory() as name:
        binary = program(Path(name))
        few, many = (counted(binary, road, steps) for steps in (FEW, MANY))
    each = {key: (many[key] - few[key]) / (MANY - FEW) for key in many}
    inside: Counter[str] = Counter()
    for (file, function), count in each.items():
        if function.startswith("derivative"):
            inside[file] += count
    total, evaluated = sum(each.values()), sum(inside.values())
    print(f"{total:.0f} instructions per 10 ms, {evaluated:.0f} of them in 12 evaluations\n")
    print("| file | share of an evaluation |\n|---|---|")
    for file, count in inside.most_common():
        print(f"| `{file}` | {100 * count / evaluated:.1f} % |")


if __name__ == "__main__":
    main()
