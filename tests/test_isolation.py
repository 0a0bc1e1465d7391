"""Work in processes of its own: what comes home, and what is known of those who do not."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import isolated_work as work
import pytest

from cosim.errors import CosimError
from cosim.isolation import Children, Death, Journal, Watch, WorkError
from cosim.isolation.death import death_of, last_line

NEEDS_FORK = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")


@pytest.fixture(autouse=True)
def _importable(monkeypatch: pytest.MonkeyPatch) -> None:
    """The functions of isolated_work are looked up in the other process."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)


@pytest.fixture
def children() -> Iterator[Children]:
    with Children() as made:
        yield made


def test_answers_come_home_each_from_another_process(
    children: Children, capfd: pytest.CaptureFixture[str]
) -> None:
    answers = [children.run(work.double, value) for value in (1.5, 2.5)]
    assert [answer["twice"] for answer in answers if isinstance(answer, dict)] == [3.0, 5.0]
    processes = {answer["process"] for answer in answers if isinstance(answer, dict)}
    assert len(processes | {os.getpid()}) == 3
    assert all(answer["threads"] == "1" for answer in answers if isinstance(answer, dict))
    assert children.run(work.nothing, 0) is None
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("forks", [True, False])
def test_a_crash_is_told_with_signal_call_words_and_place(forks: bool) -> None:
    with Children(forks=forks) as children:
        death = children.run(work.abort, 0)
        assert isinstance(death, Death)
        assert (death.kind, death.signal) == ("crash", "SIGABRT")
        assert (death.call, death.message) == ("the eleventh step", "low on oil")
        assert death.manner == "crashed (SIGABRT, it gave up)"
        assert death.said == "; its last message was: low on oil; it printed: assertion: x > 0"
        assert death.frame.startswith("abort (isolated_work.py, line ")
        death = children.run(work.segfault, 0)
        assert isinstance(death, Death)
        assert (death.kind, death.signal, death.said) == ("crash", "SIGSEGV", "")
        assert death.frame.startswith("string_at (__init__.py, line ")
        answer = children.run(work.double, 2.0)
        assert isinstance(answer, dict)
        assert answer["twice"] == 4.0


@pytest.mark.parametrize("how", [work.leave, work.exit_in_c])
@pytest.mark.parametrize("code", [0, 3])
def test_whoever_ends_the_process_brings_no_answer(
    children: Children, how: Callable[[int, Journal], None], code: int
) -> None:
    death = children.run(how, code)
    assert isinstance(death, Death)
    assert (death.kind, death.signal, death.call) == ("process-ended", "", "the exit")
    assert death.manner == "ended the whole process"


def test_a_process_that_is_killed_from_outside(children: Children) -> None:
    death = children.run(work.killed, 0)
    assert isinstance(death, Death)
    assert (death.kind, death.signal) == ("crash", "SIGKILL")
    assert "want of memory" in death.manner


@pytest.mark.parametrize("forks", [True, False])
def test_a_hang_ends_after_the_timeout_and_tells_where(forks: bool) -> None:
    with Children(forks=forks) as children:
        begin = time.monotonic()
        death = children.run(work.sleep_in_c, 600.0, Watch(0.5))
        assert time.monotonic() - begin < 30.0
        assert isinstance(death, Death)
        assert (death.kind, death.call, death.timeout) == ("hang", "the long step", 0.5)
        assert death.manner == "did not go on for 0.5 s"
        assert death.frame.startswith("sleep_in_c (isolated_work.py, line ")


def test_whoever_goes_on_does_not_hang(tmp_path: Path) -> None:
    """Each step is shorter than the timeout, all of them are longer."""
    grown = tmp_path / "grown"
    with Children() as children:
        assert children.run(work.goes_on, 8, Watch(0.7)) == "there"
        pulse: Callable[[], int] = lambda: grown.stat().st_size if grown.exists() else 0  # noqa: E731
        assert children.run(work.grows, str(grown), Watch(0.7, pulse)) == "there"
        death = children.run(work.grows, str(tmp_path / "unwatched"), Watch(0.7))
        assert isinstance(death, Death)
        assert death.kind == "hang"


def test_without_a_timeout_it_may_take_as_long_as_it_likes(children: Children) -> None:
    assert children.run(work.sleep_in_c, 0.5) is None


def test_an_exception_is_a_mistake_of_the_work(children: Children) -> None:
    with pytest.raises(WorkError, match=r"raises is at fault:(.|\n)*ZeroDivisionError: of its own"):
        children.run(work.raises, 0)
    assert issubclass(WorkError, CosimError)


def test_a_process_that_does_not_start(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with Children() as children, pytest.raises(WorkError, match="did not start"):
        children.run(work.double, 1.0)


def _gone(*processes: int) -> bool:
    """Whether processes end within two seconds."""
    for _ in range(100):
        if not any(_alive(process) for process in processes):
            return True
        time.sleep(0.02)
    return False


def _alive(process: int) -> bool:
    try:
        state = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"


def _written(file: Path) -> list[int]:
    """Return what `has_a_child` writes down, once it has."""
    for _ in range(1000):
        text = file.read_text() if file.exists() else ""
        if text.endswith("\n"):
            return [int(word) for word in text.split()]
        time.sleep(0.02)
    raise AssertionError("it did not begin")


@NEEDS_FORK
def test_an_interrupt_ends_the_work_and_all_that_it_has_started(tmp_path: Path) -> None:
    file, deaths = tmp_path / "pids", []
    with Children() as children:
        thread = threading.Thread(
            target=lambda: deaths.append(children.run(work.has_a_child, str(file)))
        )
        thread.start()
        processes = _written(file)
        assert all(map(_alive, processes))
        children.interrupt()
        thread.join(20.0)
    assert [death.kind for death in deaths] == ["interrupted"]
    assert _gone(*processes)


@NEEDS_FORK
def test_nothing_goes_on_when_whoever_asked_is_gone(tmp_path: Path) -> None:
    """As when a bench kills the whole test run."""
    file = tmp_path / "pids"
    program = (
        "import isolated_work as work\nfrom cosim.isolation import Children\n"
        f"with Children() as children: children.run(work.has_a_child, {str(file)!r})"
    )
    root = Path(__file__).parents[1]
    path = os.pathsep.join([str(root), str(root / "tests")])
    asker = subprocess.Popen(
        [sys.executable, "-c", program], env={**os.environ, "PYTHONPATH": path}
    )
    try:
        processes = _written(file)
        asker.send_signal(signal.SIGKILL)
        asker.wait()
        assert _gone(*processes)
    finally:
        with contextlib.suppress(ProcessLookupError):
            asker.kill()


def test_deaths_of_other_kinds() -> None:
    windows = death_of(0xC0000005, "a call", "", "", "")
    assert (windows.kind, windows.signal) == ("crash", "0xc0000005")
    assert death_of(-40, "a call", "", "", "").signal == "signal 40"
    assert death_of(1, "", "", "a\n  last words \n\n", "").printed == "last words"
    assert len(last_line("x" * 5000)) == 200
    assert death_of(-11, "", "", "", "no frames").frame == ""
