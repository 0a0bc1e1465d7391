"""What a batch costs beside stepping: `python tests/benchmarks/bench_batch.py [FOLDER] [JOBS]`.

Runs every scenario of FOLDER (scenarios/paper) with JOBS processes (2) as `cosim run` does, into a
temporary folder, and prints Markdown: once with every road to be built, once with the roads there,
and once for 0.05 s each, which leaves start, checks, assembly, report and provenance.
"""

from __future__ import annotations

import os
import resource
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

ROOT = Path(__file__).parents[2]
SHORT = (("duration=0.05", "--duration 0.05"), ("limits=[]", "--set limits=[]"))


def measure(
    folder: Path, jobs: int, results: Path, overrides: tuple[tuple[str, str], ...] = ()
) -> tuple[str, ...]:
    """Return a row of the table: scenarios, failed, simulated, wall and processor time [s]."""
    from cosim.batch import find_scenarios, plan, run_all

    used, begin = _processor_time(), time.perf_counter()
    files, _ = find_scenarios([folder])
    ended, _ = run_all(plan(files, results, overrides), jobs)
    wall, used = time.perf_counter() - begin, _processor_time() - used
    for one in ended:
        for problem in one.problems:
            print(f"error: {problem}", file=sys.stderr)
    runs = [run for one in ended if one.metrics for run in one.metrics["runs"].values()]
    simulated = sum(run["simulated_s"] for run in runs)
    failed = sum(one.exit_code != 0 for one in ended)
    return str(len(files)), str(failed), f"{simulated:.0f}", f"{wall:.1f}", f"{used:.1f}"


def _processor_time() -> float:
    own, children = (
        resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    return own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime


def main() -> None:
    """Print the table."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "scenarios" / "paper"
    jobs = int(sys.argv[2]) if len(sys.argv) > 2 else 2
    with tempfile.TemporaryDirectory() as scratch:
        os.environ["COSIM_CACHE_DIR"] = str(Path(scratch) / "roads")
        results = Path(scratch) / "results"
        print(f"{folder.name}, {jobs} processes\n")
        print("| | scenarios | failed | simulated, s | wall, s | processor, s |")
        print("|---|---|---|---|---|---|")
        for what, overrides in (("roads built", ()), ("roads there", ()), ("0.05 s each", SHORT)):
            print(f"| {what} | {' | '.join(measure(folder, jobs, results, overrides))} |")


if __name__ == "__main__":
    main()
