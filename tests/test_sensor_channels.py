import subprocess
import sys

import numpy as np
import pytest

import sensor
from cosim.fmi import Description
from cosim.vehicle import builtin_fmu
from sensor.channels import (
    CHANNEL_NAMES,
    CHANNEL_UNITS,
    CHANNELS,
    COMMANDS,
    OUTPUTS,
    ROAD,
    STAGE,
    check_channels,
    stage_channels,
)
from sensor.errors import SensorError
from sensor.paper import PRINTED_MEAN_ACCURACY, paper_rows, search_rows


def test_channels_follow_table_2() -> None:
    assert [channel.paper_number for channel in CHANNELS] == list(range(1, 15))
    assert [channel.paper_number for channel in OUTPUTS] == [1, 2, 3, 4]
    assert len(set(CHANNEL_NAMES)) == 14
    degrees = [channel.name for channel in CHANNELS if "deg" in channel.paper_unit]
    assert degrees == [channel.name for channel in CHANNELS if "rad" in channel.unit]


def test_the_vehicle_has_every_signal_under_its_name_and_unit() -> None:
    description = Description(builtin_fmu())
    for signal in (*CHANNELS, *STAGE, *COMMANDS, *ROAD):
        unit = description.unit_of(signal.name)
        assert (unit or "1") == signal.unit, signal.name


def test_production_sensors_stand_in_the_places_of_the_ideal_channels() -> None:
    """By name: the mount's accelerations and rates, the ESC's speed, the teeth's wheel speeds."""
    assert len(STAGE) == 11
    channels = np.arange(28.0).reshape(2, 14)
    stage = 100.0 + np.arange(22.0).reshape(2, 11)
    staged = stage_channels(channels, stage)
    kept = ("Car.SteerAngleFL", "Car.SteerAngleFR", "Steer.WhlAng")
    last = [signal.name.rsplit(".", 1)[1] for signal in STAGE]
    for i, name in enumerate(CHANNEL_NAMES):
        there = name in kept
        expected = channels[:, i] if there else stage[:, last.index(name.rsplit(".", 1)[1])]
        np.testing.assert_array_equal(staged[:, i], expected)
    np.testing.assert_array_equal(stage_channels(channels[1], stage[1]), staged[1])
    np.testing.assert_array_equal(channels, np.arange(28.0).reshape(2, 14))


def test_every_difference_is_named() -> None:
    check_channels("net", CHANNEL_NAMES, CHANNEL_UNITS, CHANNELS)
    names, units = list(CHANNEL_NAMES), list(CHANNEL_UNITS)
    names[0], units[5] = "Car.aq", "deg/s"
    with pytest.raises(SensorError) as caught:
        check_channels("net", names, units, CHANNELS)
    for part in ("net", "'Car.aq'", "'Car.ax'", "'Car.YawRate'", "'deg/s'", "'rad/s'"):
        assert part in str(caught.value)
    with pytest.raises(SensorError, match="13 names"):
        check_channels("net", CHANNEL_NAMES[:13], CHANNEL_UNITS[:13], CHANNELS)


def test_every_public_name_can_be_had() -> None:
    for name in sensor.__all__:
        assert getattr(sensor, name) is not None
    with pytest.raises(AttributeError):
        _ = sensor.nothing


def test_run_time_needs_no_training_packages() -> None:
    code = (
        "import sys, sensor.runtime, sensor.baselines, sensor.body_motion, sensor.metrics\n"
        "print([m for m in ('torch', 'onnx', 'pandas', 'pyarrow') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_papers_tables() -> None:
    rows = paper_rows()
    assert len(rows) == len({row.scenario for row in rows}) == 29
    assert not any("Offensive" in row.scenario for row in rows)
    assert rows[22].scenario == "Sine with Dwell 80 deg at 80 km/h"
    assert rows[19].scenario == "Sine with Dwell 60 deg at 80 km/h"
    assert sum(row.accuracy for row in rows) / 29 == pytest.approx(PRINTED_MEAN_ACCURACY, abs=0.1)
    assert rows[8].truth_rms == pytest.approx(0.0081 / 0.042)
    best = min(search_rows(), key=lambda row: row.rmse)
    assert (best.window, best.units, best.hidden) == (19, 167, 256)
