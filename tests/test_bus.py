"""Bench and sensor over a virtual bus: the same estimates, and what happens when frames do not."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from bus_rig import WAITING, Echo, bench, gateway, node, virtual

from cosim.bus.sensor import BusSensor, Waiting
from cosim.bus.transport import Address, Link, option_problem
from cosim.errors import BusError, InputError
from cosim.metrics import BUS_FIGURES

COMMAND = np.full(4, 0.25)


def channels(k: int) -> np.ndarray:
    values = np.linspace(0.1, 0.2, 14)
    values[2] = np.sin(0.3 * k)
    return values


def drive(sensor: BusSensor, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Validity (samples,) and estimates (samples, 4)."""
    valid, estimates = np.zeros(samples, dtype=bool), np.zeros((samples, 4))
    for k in range(samples):
        valid[k] = sensor.step(channels(k), COMMAND)
        estimates[k] = sensor.estimate
    return valid, estimates


def expected(samples: int) -> np.ndarray:
    az = np.array([channels(k)[2] for k in range(samples)])
    return np.repeat(0.01 * az[:, np.newaxis] + 0.25, 4, axis=1)


def test_estimates_come_back_to_the_quantisation_of_both_ways():
    address = virtual()
    with node(address, Echo(warm_up=3)) as there, bench(address) as sensor:
        valid, estimates = drive(sensor, 50)
    assert valid.tolist() == [False] * 3 + [True] * 47
    assert np.isnan(estimates[:3]).all()
    error = np.abs(estimates[3:] - expected(50)[3:])
    assert error.max() <= 0.5 * (0.01 * 0.000981 + 0.0002) * (1 + 1e-9)
    np.testing.assert_allclose(sensor.deviation, 0.01, atol=0.000125)
    figures = sensor.figures()
    assert set(figures) == set(BUS_FIGURES)
    assert figures["samples"] == figures["answers_in_time"] == 50
    for name in ("late_answers", "unanswered_samples", "frames_lost", "values_out_of_range"):
        assert figures[name] == 0
    assert 0 < figures["latency_p50_ms"] <= figures["latency_p99_ms"] <= figures["latency_max_ms"]
    assert figures["age_p50_ms"] <= figures["latency_max_ms"]
    assert there.counts.samples == 50
    assert there.counts.estimates == 47
    assert there.counts.runs == 1


def test_a_second_run_starts_afresh():
    address = virtual()
    with node(address, Echo(warm_up=3)) as there:
        for _ in range(2):
            with bench(address) as sensor:
                assert drive(sensor, 10)[0].tolist() == [False] * 3 + [True] * 7
    assert there.counts.runs == 2
    assert there.counts.fresh_starts == 0


def test_lost_frames_are_bridged_and_counted_on_either_way():
    def passes(identifier: int, nth: int) -> bool:
        to_sensor = identifier == 0x112 and nth in (20, 21, 30)  # three of the front wheels
        from_sensor = identifier == 0x121 and nth == 40  # one of the rear estimates
        return not (to_sensor or from_sensor)

    one, other = virtual(), virtual()
    waiting = Waiting(deadline_s=0.3, oldest_samples=0, connect_s=5.0)
    with gateway(one, other, passes), node(other, Echo(), patience_s=0.02) as there:
        with bench(one, waiting) as sensor:
            valid, _ = drive(sensor, 60)
        figures = sensor.figures()
    assert np.flatnonzero(~valid[3:]).tolist() == [40 - 3]
    assert figures["frames_lost_to_sensor"] == 3
    assert figures["frames_lost_from_sensor"] == 1
    assert figures["frames_lost"] == 4
    assert figures["unanswered_samples"] == 1
    assert figures["answers_in_time"] == 59
    assert there.counts.incomplete_samples == 3


def test_an_estimate_may_be_held_where_the_scenario_allows_it():
    one, other = virtual(), virtual()
    waiting = Waiting(deadline_s=0.2, oldest_samples=1, connect_s=5.0)
    with (
        gateway(one, other, lambda identifier, nth: identifier != 0x120 or nth not in (9, 15, 16)),
        node(other, Echo()),
        bench(one, waiting) as sensor,
    ):
        valid, estimates = drive(sensor, 30)
    assert np.flatnonzero(~valid[3:]).tolist() == [16 - 3]
    np.testing.assert_array_equal(estimates[9], estimates[8])


def test_a_late_answer_is_counted_and_its_sample_is_invalid():
    def work(step: int) -> None:
        if step == 10:
            time.sleep(0.4)

    address = virtual()
    waiting = Waiting(deadline_s=0.2, oldest_samples=0, connect_s=5.0)
    with node(address, Echo(work=work)), bench(address, waiting) as sensor:
        valid, _ = drive(sensor, 30)
    figures = sensor.figures()
    assert not valid[9]
    assert figures["late_answers"] == (~valid[3:]).sum()
    assert figures["answers_in_time"] == 30 - figures["late_answers"]
    assert figures["unanswered_samples"] == figures["frames_lost"] == 0
    assert figures["latency_max_ms"] > 390.0


def test_without_a_deadline_the_estimates_are_those_of_samples_before():
    address = virtual()
    waiting = Waiting(deadline_s=0.0, oldest_samples=2, connect_s=5.0)
    with node(address, Echo(warm_up=0)), bench(address, waiting) as sensor:
        found = []
        for k in range(20):
            valid = sensor.step(channels(k), COMMAND)
            found.append(sensor.estimate.copy() if valid else None)
            time.sleep(0.05)
    truth = expected(20)
    for k, estimate in enumerate(found):
        if estimate is not None:
            nearest = np.abs(truth[: k + 1] - estimate).max(axis=1)
            assert nearest[max(k - 2, 0) : k + 1].min() < 2e-4
    assert sum(estimate is not None for estimate in found) >= 15
    assert sensor.figures()["late_answers"] >= 15


def test_a_sensor_that_dies_costs_two_seconds_at_most_and_its_samples_are_invalid():
    address = virtual()
    waiting = Waiting(deadline_s=0.5, oldest_samples=0, connect_s=5.0)
    with node(address, Echo()):
        sensor = BusSensor(address, waiting)
        sensor.open()
        drive(sensor, 10)
    begin = time.perf_counter()
    valid, estimates = drive(sensor, 400)
    sensor.close()
    assert time.perf_counter() - begin < 6.0
    assert not valid.any()
    assert np.isnan(estimates).all()
    figures = sensor.figures()
    assert figures["unanswered_samples"] == 400
    assert "frames_lost" not in figures  # nobody is there to tell


def test_no_sensor_is_one_sentence():
    begin = time.perf_counter()
    sensor = BusSensor(virtual(), Waiting(0.1, 0, 0.3))
    with pytest.raises(BusError, match=r"no sensor answers on bus virtual .* cosim sensor-node"):
        sensor.open()
    assert time.perf_counter() - begin < 3.0
    assert sensor.figures()["samples"] == 0


def test_two_sensors_on_one_bus_are_found():
    address = virtual()
    with (
        node(address, Echo()),
        node(address, Echo()),
        pytest.raises(BusError, match="more than one sensor"),
        bench(address),
    ):
        pass


def test_two_benches_on_one_bus_are_found():
    address = virtual()
    with node(address, Echo()), bench(address) as sensor:
        other = BusSensor(address, WAITING)
        opened = threading.Thread(target=lambda: (other.open(), other.close()))
        opened.start()
        opened.join()
        with pytest.raises(BusError, match="another bench works on bus virtual"):
            drive(sensor, 10)


def test_another_estimator_than_the_scenarios_is_refused():
    address = virtual()
    with node(address, Echo(), fingerprint=17):
        for mark in (17, 0):
            with bench(address, fingerprint=mark):
                pass
        with (
            pytest.raises(BusError, match="another estimator than the scenario names"),
            bench(address, fingerprint=18),
        ):
            pass


def test_a_channel_that_is_nan_is_no_value_on_the_bus():
    address = virtual()
    with node(address, Echo(warm_up=0)) as there, bench(address) as sensor:
        for k in range(20):
            given = channels(k)
            given[9] = np.nan if k == 10 else given[9]
            assert sensor.step(given, COMMAND)
    assert there.counts.incomplete_samples == 1


def test_an_interface_that_is_none_names_the_nearest():
    with pytest.raises(InputError, match=r"'soketcan' is not an interface .* mean 'socketcan'"):
        Link(Address("soketcan"))


def test_an_interface_that_cannot_be_opened_is_one_sentence():
    with pytest.raises(BusError, match=r"cannot open bus socketcan no_such_can0: \w+"):
        Link(Address("socketcan", "no_such_can0"))
    with pytest.raises(BusError, match=r"cannot open bus udp_multicast 10\.0\.0\.1: \w+"):
        Link(Address("udp_multicast", "10.0.0.1"))


@pytest.mark.parametrize(
    ("interface", "option", "nearest"),
    [
        ("udp_multicast", "prot", "port"),
        ("virtual", "rx_queue", "rx_queue_size"),
        ("socketcan", "local_loop", "local_loopback"),
    ],
)
def test_an_option_that_python_can_would_leave_out_without_a_word(interface, option, nearest):
    sentence = f"'{option}' is not an option of {interface}; did you mean '{nearest}'"
    with pytest.raises(InputError, match=sentence):
        Link(Address(interface, None, {option: 1}))
    assert option_problem(interface, {nearest: 1, "bitrate": 500_000}) is None


@pytest.mark.parametrize("port", [0, 65536, "47000", 1.5])
def test_a_port_that_is_none(port):
    with pytest.raises(InputError, match="port must be a whole number from 1 to 65535, not"):
        Link(Address("udp_multicast", None, {"port": port}))
