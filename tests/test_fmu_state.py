"""States and instances of the FMUs: what is saved comes back bit for bit."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import shipped_fmus as fmus
from fmu_face import Face, instances, refused
from sensor_rig import Sensor
from vehicle_rig import INPUTS, cosine_bump, output_names, straight_road

Make = Callable[..., "Car"]
Rows = list[tuple[float, ...]]
H = 0.01
WARM = 60  # samples


class Car(Face):
    """An instance of the vehicle on a bumpy road, driven by inputs that change at each step."""

    def __init__(self, folder: Path, road: str) -> None:
        super().__init__(folder)
        kind = ctypes.c_uint * len(INPUTS), ctypes.c_double * len(INPUTS)
        self._inputs = kind[0](*(self.variables[n].valueReference for n in INPUTS))
        self._held = kind[1]()
        self._outputs = [self.variables[n].valueReference for n in output_names()]
        self.road = road

    def start(self, speed: float = 12.0) -> Car:
        """Onto the road, rolling."""
        self.enter()
        self["Road.File"], self["Init.Velocity"] = self.road, speed
        self.fmu.exitInitializationMode()
        return self

    def drive(self, first: int, last: int, side: float = 1.0) -> Rows:
        """All outputs after each of the steps `first` to `last` - 1."""
        read = self.fmu.getReal if self.version == 2 else self.fmu.getFloat64
        setter = "SetReal" if self.version == 2 else "SetFloat64"
        rows = []
        for k in range(first, last):
            t = k * H
            dampers = [0.5 + 0.5 * math.sin(9.0 * t + i) for i in range(4)]
            self._held[:] = [side * math.sin(2.0 * t), 0.4, 0.0, 1.0, *dampers]
            assert self.call(setter, *self.sized(self._inputs, len(INPUTS), self._held)) == 0
            self.step(k, H)
            rows.append(tuple(read(self._outputs)))
        return rows


@pytest.fixture(scope="module")
def road(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("road") / "bump.crg"
    return straight_road(path, lambda s, v: cosine_bump(s, 2.0, 3.0, 0.05) + 0.0 * v)


@pytest.fixture(scope="module", params=(*fmus.VEHICLES, *fmus.SMALL), ids=str)
def fmu(request: pytest.FixtureRequest) -> fmus.Shipped:
    return request.param


@pytest.fixture(scope="module")
def folder(fmu: fmus.Shipped) -> Iterator[Path]:
    with fmus.unzipped(fmu) as path:
        yield path


class WarmSensor(Sensor):
    """A sensor that has warmed up when it starts: its estimates move from then on."""

    def start(self, speed: float = 12.0) -> WarmSensor:
        """Ready, after samples enough for every network; another speed is another drive."""
        super().start()
        super().drive(0, WARM, speed / 12.0)
        return self

    def drive(self, first: int, last: int, side: float = 1.0) -> Rows:
        """All outputs after each of the steps after those of the start."""
        return super().drive(WARM + first, WARM + last, side)


def new(fmu: fmus.Shipped, folder: Path, road: str) -> Car | Sensor:
    """An instance that can start and drive."""
    return Car(folder, road) if fmu.model == "vehicle" else WarmSensor(folder)


@pytest.fixture
def make(fmu: fmus.Shipped, folder: Path, road: str) -> Iterator[Make]:
    with instances(new, fmu, folder, road) as make_one:
        yield make_one


def test_a_saved_state_replays_bit_for_bit(make: Make) -> None:
    car = make().start()
    car.drive(0, 30)
    state = car.fmu.getFMUState()
    first = car.drive(30, 60)
    assert len(set(first)) == 30
    for _ in range(2):
        car.fmu.setFMUState(state)
        assert car.drive(30, 60) == first
    car.fmu.freeFMUState(state)


def test_serialised_bytes_replay_bit_for_bit_elsewhere(make: Make) -> None:
    """In an instance that was never initialised: road and equilibrium are rebuilt."""
    car, other = make().start(), make()
    car.drive(0, 30)
    data = car.serialize()
    assert data == car.serialize()
    other.restore(data)
    assert other.serialize() == data
    assert other.drive(30, 60) == car.drive(30, 60)


def test_serialised_bytes_replay_in_another_process(
    make: Make, fmu: fmus.Shipped, folder: Path, road: str
) -> None:
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    car = make().start()
    car.drive(0, 20)
    data = car.serialize()
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        rows = pool.submit(replay, fmu, folder, road, data).result()
    assert rows == car.drive(20, 30)


def replay(fmu: fmus.Shipped, folder: Path, road: str, data: bytes) -> Rows:
    """What a fresh process makes of serialised bytes."""
    car = new(fmu, folder, road)
    car.restore(data)
    rows = car.drive(20, 30)
    car.free()
    return rows


def test_reset_equals_a_fresh_instance(make: Make) -> None:
    used, fresh = make().start(20.0), make()
    used.drive(0, 25, side=-1.0)
    used.fmu.reset()
    assert used.serialize() == fresh.serialize()
    assert used.start().drive(0, 20) == fresh.start().drive(0, 20)
    assert used.serialize() == fresh.serialize()


def test_instances_do_not_touch_each_other(make: Make) -> None:
    alone = make().start().drive(0, 30)
    one, two = make().start(), make().start(25.0)
    rows: Rows = []
    for k in range(30):
        rows += one.drive(k, k + 1)
        two.drive(k, k + 1, side=-0.5)
    assert rows == alone


def test_threads(make: Make) -> None:
    """Instantiated on one, stepped on another; and two instances on two threads at once."""
    here = make().start().drive(0, 30)
    with ThreadPoolExecutor(1) as first, ThreadPoolExecutor(1) as second:
        car = first.submit(make).result()
        assert second.submit(lambda: car.start().drive(0, 30)).result() == here
        one, two = make(), make()
        runs = [first.submit(lambda: one.start().drive(0, 30)),
                second.submit(lambda: two.start().drive(0, 30))]  # fmt: skip
        assert [run.result() for run in runs] == [here, here]


def test_two_thousand_instances_leave_no_memory_behind(make: Make, folder: Path) -> None:
    """Growth of the process over 2000 instances with a state each; the sanitizers look closer
    (make sanitize).
    """

    def resident() -> int:
        pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[1]
        return int(pages) * 4096

    if not Path("/proc/self/statm").exists():
        pytest.skip("needs /proc")
    car = make()
    place, token = resources(folder, car.version), car.fmu.guid.encode()
    arguments: tuple[Any, ...]
    if car.version == 2:
        make_one, free = car.fmu.dll.fmi2Instantiate, car.fmu.dll.fmi2FreeInstance
        arguments = (b"n", 1, token, place, None, 0, 0)
    else:
        make_one, free = car.fmu.dll.fmi3InstantiateCoSimulation, car.fmu.dll.fmi3FreeInstance
        arguments = (b"n", token, place, *[False] * 4, None, 0, None, None, None)
    make_one = ctypes.CFUNCTYPE(ctypes.c_void_p)(ctypes.cast(make_one, ctypes.c_void_p).value)
    free = ctypes.CFUNCTYPE(None)(ctypes.cast(free, ctypes.c_void_p).value)
    before = 0
    for n in range(2100):
        if n == 100:
            before = resident()
        component = ctypes.c_void_p(make_one(*map(as_argument, arguments)))
        assert component.value
        car.fmu.component, keep = component.value, car.fmu.component
        car.serialize()
        car.fmu.component = keep
        free(component)
    assert resident() - before < 2_000_000  # an instance alone has 15 kB and more


def resources(folder: Path, version: int) -> bytes:
    """Where an instance finds its resources, as its version of FMI says it."""
    path = folder / "resources"
    return path.as_uri().encode() if version == 2 else f"{path}/".encode()


def test_the_state_of_another_network_is_refused(folder: Path, fmu: fmus.Shipped) -> None:
    """Its bytes may be as many: the token tells them apart."""
    if fmu.model == "vehicle":
        pytest.skip("there is one vehicle")
    other = fmus.Shipped(fmu.model.removeprefix("small "), fmu.version)
    with (
        fmus.unzipped(other) as path,
        instances(Sensor, folder) as make_one,
        instances(Sensor, path) as make_another,
    ):
        one, another = make_one(), make_another().start()
        assert one.fmu.guid != another.fmu.guid
        data = another.serialize()
        assert "not a serialised state" in refused(one, lambda: one.restore(data))
        with pytest.raises(Exception, match="instantiate"):
            make_one(token=another.fmu.guid)


def as_argument(value: Any) -> Any:
    """A value as ctypes passes it without a prototype."""
    if isinstance(value, bytes):
        return ctypes.c_char_p(value)
    return ctypes.c_void_p(None) if value is None else ctypes.c_size_t(int(value))
