"""The frames: what the DBC says, against the channels, the standard's bounds and bytes by hand."""

from __future__ import annotations

import math
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.bus.codec import (
    ANSWERED,
    GIVEN,
    age_ms,
    answer_signals,
    database,
    decode_one,
    from_sensor,
    to_sensor,
)
from cosim.bus.dbc import DBC, dbc_text
from cosim.bus.frame_table import bus_load_percent, frame_table
from cosim.bus.messages import CONTROL, FRAMES, STATUS, TO_SENSOR, UNITS, bus_name
from sensor.channels import CHANNELS, COMMANDS, OUTPUTS, STAGED
from sensor.conditions import PRODUCTION, Measurement

ROOT = Path(__file__).parents[1]
GRAVITY, DEGREE, KMH = 9.81, math.pi / 180.0, 1.0 / 3.6


def test_the_shipped_dbc_is_the_one_that_the_table_makes():
    assert DBC.read_text(encoding="utf-8") == dbc_text()


def test_every_channel_is_on_the_bus_once_in_a_unit_of_its_quantity():
    signals = [s for frame in TO_SENSOR for s in database().get_message_by_name(frame.name).signals]
    for channel in (*CHANNELS, *COMMANDS):
        found = [signal for signal in signals if signal.name == bus_name(channel.name)]
        assert len(found) == 1, channel.name
        assert UNITS[found[0].unit or ""][0] == channel.unit
    assert len(signals) == len(CHANNELS) + len(COMMANDS) + len(TO_SENSOR)  # a counter in each


def test_the_page_has_the_table_of_the_dbc():
    assert frame_table() in (ROOT / "docs" / "can.md").read_text(encoding="utf-8")
    assert all(f"**{frame.name}**" in frame_table() for frame in FRAMES)


def test_the_largest_load_is_that_of_135_bits_for_a_frame_of_8_bytes():
    frames = [m for m in database().messages if m.cycle_time == 10]
    assert sorted(m.length for m in frames) == [5, 7, 7, 8, 8, 8, 8, 8, 8, 8]
    bits = 7 * 135 + 2 * (47 + 56 + 22) + (47 + 40 + 18)  # by hand: 89 // 4 and 73 // 4 stuff bits
    assert bus_load_percent() == pytest.approx(100.0 * bits / 5000.0)


def test_the_frames_are_classic_can():
    messages = database().messages
    assert {m.name for m in messages} == {frame.name for frame in FRAMES}
    assert len({m.frame_id for m in messages}) == len(messages)
    for message in messages:
        assert message.length <= 8
        assert message.frame_id <= 0x7FF
        assert not message.is_extended_frame
        assert not message.is_fd


def test_a_sample_in_bytes():
    values = dict.fromkeys(GIVEN, 0.0)
    values["Car.ax"] = 1.962  # 2000 steps of 0.000981 m/s2
    values["Car.az"] = -GRAVITY
    values["Car.YawRate"] = 10.0 * DEGREE
    values["Car.vFL"], values["Car.vFR"] = 100.0 * KMH, -1.0 * KMH
    values["Steer.WhlAng"] = -90.0 * DEGREE
    values["Car.SuspControl.DamperRR.CtrlOut"] = 1.0
    frames = dict(to_sensor().encode(np.array(list(values.values())), SampleCounter=0x1234))
    assert frames[0x110] == struct.pack("<Hhhh", 0x1234, 2000, 0, -10000)
    assert frames[0x111] == struct.pack("<Hhhh", 0x1234, 0, 0, 2000)
    speeds = (204800 & 0xFFFFF) | ((-2048 & 0xFFFFF) << 20)
    assert frames[0x112] == struct.pack("<H", 0x1234) + speeds.to_bytes(5, "little")
    assert frames[0x115] == struct.pack("<Hhhh", 0x1234, -3600, 0, 0)
    assert frames[0x116] == struct.pack("<HHI", 0x1234, 0, 4000 << 20)


def test_an_answer_in_bytes():
    values = np.array([0.1, -0.1, 1.0, -1.0, 0.01, 0.02, 0.03, math.nan])
    frames = dict(from_sensor().encode(values, **answer_signals(65535, 1.23, True)))
    assert frames[0x120] == struct.pack("<HhhH", 65535, 500, -500, 123 | 1 << 15)
    assert frames[0x121] == struct.pack("<HhhH", 65535, 5000, -5000, 123 | 1 << 15)
    deviations = 40 | 80 << 12 | 120 << 24 | 0xFFF << 36
    assert frames[0x122] == struct.pack("<H", 65535) + deviations.to_bytes(6, "little")


TO_AND_FROM = (to_sensor(), from_sensor())


@given(st.data())
def test_a_value_comes_back_to_half_a_step_and_nothing_stays_nothing(data):
    frames = data.draw(st.sampled_from(TO_AND_FROM))
    number = st.floats(-1.0, 1.0) | st.just(math.nan)
    shares = np.array([data.draw(number) for _ in frames.step])
    reach = np.where(frames.low < 0, frames.high, 0.5 * frames.high) * frames.step
    values = shares * reach + np.where(frames.low < 0, 0.0, reach)
    back = np.full(len(values), np.nan)
    for identifier, content in frames.encode(values, **answer_signals(7, 0.5, True)):
        assert frames.decode(identifier, content, back)["SampleCounter"] == 7
    np.testing.assert_array_equal(np.isnan(back), np.isnan(values))
    there = np.isfinite(values)
    assert (np.abs(back - values)[there] <= 0.5 * frames.step[there] * (1 + 1e-9)).all()
    np.testing.assert_array_equal(back[there], frames.quantised(values)[there])
    assert frames.out_of_range == 0


def test_what_is_beyond_a_signal_is_sent_as_its_end_and_counted():
    frames = to_sensor()
    values = np.zeros(len(GIVEN))
    values[[0, 2, 6]] = 50.0, -np.inf, -1e30
    back = np.zeros(len(GIVEN))
    for identifier, content in frames.encode(values, SampleCounter=0):
        frames.decode(identifier, content, back)
    assert back[0] == pytest.approx(32767 * 0.000981)
    assert np.isnan(back[2])
    assert back[6] == pytest.approx(-256.0 * KMH, rel=1e-4)
    assert frames.out_of_range == 2


def test_a_production_measurement_passes_the_bus_unchanged_but_for_the_road_wheels():
    random = np.random.default_rng(5)
    ideal = random.normal(0.0, [1, 1, 1, 0.1, 0.1, 0.1, 5, 0.02, 0.02, 5, 5, 5, 5, 0.3], (500, 14))
    measured = Measurement("production", 3).apply(ideal, ideal[:, STAGED])
    frames = to_sensor()
    on_bus = frames.quantised(np.hstack([measured, np.zeros((500, 4))]))[:, :14]
    steered = [i for i, c in enumerate(CHANNELS) if c.name.startswith("Car.Steer")]
    others = [i for i in range(14) if i not in steered]
    np.testing.assert_allclose(on_bus[:, others], measured[:, others], rtol=1e-12, atol=1e-15)
    steps = np.array([PRODUCTION[i].step for i in steered])
    assert (np.abs(on_bus - measured)[:, steered] < 0.2 * steps).all()


def test_the_age_stops_at_what_it_can_say():
    assert age_ms(answer_signals(0, 1e9, True)["Age"]) == pytest.approx(327.66)
    assert age_ms(answer_signals(0, 12.344, True)["Age"]) == pytest.approx(12.34)


def test_data_that_are_too_short_are_none():
    back = np.zeros(len(GIVEN))
    with pytest.raises(ValueError, match="bytes"):
        to_sensor().decode(0x110, b"\0\0\0", back)
    assert decode_one(CONTROL, b"") is None
    assert decode_one(STATUS, b"\1\0\2\0\3\0\0\0") == {
        "Session": 1, "FramesLost": 2, "Fingerprint": 3,
    }  # fmt: skip


def test_what_is_answered():
    assert ANSWERED[:4] == tuple(o.name for o in OUTPUTS)
    assert ANSWERED[4:] == tuple(f"VRel.Deviation.{w}" for w in ("FL", "FR", "RL", "RR"))
