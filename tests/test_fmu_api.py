"""The FMI ceremony (fmu/common), on a small model, in both FMI versions."""

import ctypes
import math
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmu_face import ERROR, OK, WARNING, Face, H, instances, refused

Make = Callable[..., Face]


@pytest.fixture(scope="module", params=[2, 3], ids=["fmi2", "fmi3"])
def folder(
    request: pytest.FixtureRequest, fmus: dict[int, Path], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """An unzipped FMU, below a folder whose name needs percent encoding."""
    target = tmp_path_factory.mktemp("a b%20 Fahrwerk-Prüfstand #1 道路")
    fmpy.extract(str(fmus[request.param]), unzipdir=str(target))
    return target


@pytest.fixture
def make(folder: Path) -> Iterator[Make]:
    """Makes instances and frees them."""
    with instances(Face, folder) as new:
        yield new


def test_steps_follow_the_analytic_solution(make: Make) -> None:
    face = make().initialise(In_u=2.0)
    for k in range(10):
        face.step(k)
    assert face["Out.FL"] == pytest.approx(2.0 * (1.0 - math.exp(-1.0 / 0.5)), rel=1e-14)
    assert face["Out.RR"] == pytest.approx(2.0 * (1.0 - math.exp(-1.0 / 2.0)), rel=1e-14)
    assert face["Out.Above"] is True
    if face.version == 3:
        assert face["time"] == pytest.approx(10 * H)


def test_fmi2_and_fmi3_agree_bit_for_bit(fmus: dict[int, Path]) -> None:
    results = [
        fmpy.simulate_fmu(
            str(fmus[version]),
            validate=True,
            start_values={"Lag.Gain": 2.0, "Gain.File": "gain.txt"},
            output=[f"Out.{corner}" for corner in ("FL", "FR", "RL", "RR")],
        )
        for version in (2, 3)
    ]
    np.testing.assert_array_equal(results[0], results[1])
    assert len(results[0]) == 21
    assert results[0]["Out.RL"][-1] == pytest.approx(3.0)  # 2 * 2.5 * (1 - e^-2), saturated


def test_the_token_is_checked(make: Make) -> None:
    with pytest.raises(Exception, match="instantiate"):
        make(token="{00000000-0000-0000-0000-000000000000}")


def test_calls_in_the_wrong_order_are_refused(make: Make) -> None:
    face = make()
    assert "DoStep was called before initialization mode" in refused(face, lambda: face.step(0))
    assert "ExitInitializationMode" in refused(face, face.fmu.exitInitializationMode)
    assert "Terminate" in refused(face, face.fmu.terminate)
    assert "has no value" in refused(face, lambda: face["Out.FL"])
    face.initialise()  # a refused call has changed nothing
    assert "EnterInitializationMode" in refused(face, face.fmu.enterInitializationMode)
    face.step(0)
    face.fmu.terminate()
    assert "after termination" in refused(face, lambda: face.step(1))
    assert "after termination" in refused(face, lambda: face.__setitem__("In.u", 1.0))
    assert face["Out.FL"] > 0.0


def test_fmi2_wants_setup_experiment_first(make: Make) -> None:
    face = make()
    if face.version == 2:
        assert "before fmi2SetupExperiment" in refused(face, face.fmu.enterInitializationMode)


def test_step_sizes_and_times_are_checked(make: Make) -> None:
    face = make().initialise(stop=2.0)
    assert "step size is 0 s" in refused(face, lambda: face.fmu.doStep(0.0, 0.0))
    assert "step size is -0.1" in refused(face, lambda: face.fmu.doStep(0.0, -0.1))
    assert "step size is nan" in refused(face, lambda: face.fmu.doStep(0.0, math.nan))
    for elsewhere in (0.5, math.inf, -math.inf, math.nan):
        message = refused(face, lambda t=elsewhere: face.fmu.doStep(t, H))
        assert "instance stands at 0 s" in message
    assert "pass the stop time 2 s" in refused(face, lambda: face.fmu.doStep(0.0, 2.5))
    for k in range(20):
        face.step(k)
    assert "pass the stop time" in refused(face, lambda: face.step(20))


def test_the_start_time_is_the_importers(make: Make) -> None:
    face = make()
    if face.version == 2:
        face.fmu.setupExperiment(startTime=100.0)
        face.fmu.enterInitializationMode()
    else:
        face.fmu.enterInitializationMode(startTime=100.0)
    face.fmu.exitInitializationMode()
    assert "instance stands at 100 s" in refused(face, lambda: face.step(0))
    face.fmu.doStep(100.0, H)


def test_added_up_time_is_accepted(make: Make) -> None:
    face = make().initialise(stop=1000.0)
    t = 0.0
    for _ in range(10_000):
        face.fmu.doStep(t, H)
        t += H
    assert t != 10_000 * H


def test_step_sizes_may_vary(make: Make) -> None:
    face = make().initialise(In_u=2.0)
    face.fmu.doStep(0.0, 0.25)
    face.fmu.doStep(0.25, 0.75)
    assert face["Out.FL"] == pytest.approx(2.0 * (1.0 - math.exp(-2.0)), rel=1e-14)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("Lag.TimeRR", 1e-9, "Lag.TimeRR cannot be set to 1e-09 s; its range is 0.001 to 100 s"),
        ("Lag.Gain", 5.5, "Lag.Gain cannot be set to 5.5 1; its range is 0 to 5 1"),
        ("In.u", math.nan, "In.u cannot be set to nan"),
        ("In.u", math.inf, "In.u cannot be set to inf"),
        ("Out.FL", 1.0, "Out.FL is an output"),
        ("Gain.File", "x" * 1024, "Gain.File cannot be set to a text of 1024 bytes"),
    ],
)
def test_bad_values_are_refused_by_name(make: Make, name: str, value: object, words: str) -> None:
    face = make()
    before = None if name.startswith("Out") else face[name]
    assert words in refused(face, lambda: face.__setitem__(name, value))
    assert before is None or face[name] == before


def test_a_refused_call_sets_none_of_its_values(make: Make) -> None:
    face = make()
    references = [face.variables[n].valueReference for n in ("Lag.Start", "Lag.TimeFL")]
    setter = face.fmu.setReal if face.version == 2 else face.fmu.setFloat64
    refused(face, lambda: setter(references, [7.0, -1.0]))
    assert face["Lag.Start"] == 0.0


def test_an_input_beyond_its_range_acts_at_its_limit(make: Make) -> None:
    """docs/decisions/0008: one warning, then the limit in silence; a parameter is refused."""
    limit, beyond, low = make().initialise(), make().initialise(), make().initialise()
    limit["In.u"], beyond["In.u"], low["In.u"] = 10.0, 11.0, -1e300
    for k in range(5):
        assert beyond.set_status("In.u", 11.0 + k) == OK  # it has been said
        for face in (limit, beyond, low):
            face.step(k)
    assert beyond.run(5, 8) == limit.run(5, 8)
    assert (beyond["In.u"], low["In.u"]) == (limit["In.u"], -10.0)
    setter = "fmi2SetReal" if beyond.version == 2 else "fmi3SetFloat64"
    assert beyond.messages == [
        (
            WARNING,
            "logStatusWarning",
            f"{setter}: In.u = 11 rad is beyond its range of -10 to 10 rad and acts as 10 rad;"
            " this is said once.",
        )
    ]


def test_the_warning_of_an_input_comes_again_after_reset(make: Make) -> None:
    face = make()
    assert [face.set_status("In.u", 11.0) for _ in range(3)] == [WARNING, OK, OK]
    face.fmu.reset()
    assert [face.set_status("In.u", -11.0) for _ in range(2)] == [WARNING, OK]


def test_unknown_references_and_types_are_refused(make: Make) -> None:
    face = make()
    getter = face.fmu.getReal if face.version == 2 else face.fmu.getFloat64
    integers = face.fmu.getInteger if face.version == 2 else face.fmu.getInt32
    assert "value reference 4711" in refused(face, lambda: getter([4711]))
    assert "no" in refused(face, lambda: integers([0]))
    if face.version == 3:
        message = refused(face, lambda: face.fmu.getFloat64([0], nValues=2))
        assert "1 value references need 1 values, not 2" in message


def test_fixed_parameters_are_fixed_and_tunable_ones_are_not(make: Make) -> None:
    face = make().initialise()
    message = refused(face, lambda: face.__setitem__("Lag.TimeFL", 1.0))
    assert "Lag.TimeFL is a fixed parameter" in message
    face["Lag.Gain"] = 2.0
    face.step(0)
    assert face["Out.RL"] == pytest.approx(2.0 * (1.0 - math.exp(-0.1)))


def test_outputs_follow_start_values_in_initialization_mode(make: Make) -> None:
    face = make()
    face.enter()
    assert face["Out.FL"] == 0.0
    face["Lag.Start"] = 1.5
    assert (face["Out.FL"], face["Out.Above"]) == (1.5, True)
    face["Lag.Start"] = 0.5
    face.fmu.exitInitializationMode()
    assert (face["Out.FL"], face["Out.Above"]) == (0.5, False)


def test_a_missing_file_is_named(make: Make) -> None:
    face = make()
    with pytest.raises(FMICallException):
        face.initialise(Gain_File="none.txt")
    status, category, message = face.messages[-1]
    assert (status, category) == (ERROR, "logGain")
    assert "none.txt" in message
    assert "after an error" in refused(face, lambda: face.step(0))
    face.fmu.reset()
    face.initialise(Gain_File="gain.txt")


def test_resources_path_with_spaces_and_letters(make: Make, folder: Path) -> None:
    face = make().initialise(Gain_File="gain.txt")
    assert Path(face["Out.Resources"]) == folder / "resources"


def test_messages_are_formatted_for_their_fmi_version(make: Make) -> None:
    face = make().initialise(Gain_File="gain.txt")
    percent = "%%" if face.version == 2 else "%"  # FMI 2 messages are printf formats
    assert face.last == f"The gain is 2.5 (100 {percent} of ##1)."  # "#1#" would be a variable
    assert face.messages[-1][:2] == (0, "logGain")


def test_log_categories(make: Make) -> None:
    face = make()
    message = refused(face, lambda: face.fmu.setDebugLogging(True, ["logGain", "logGian"]))
    assert '"logGian" is not a log category' in message
    face.messages.clear()
    face.fmu.setDebugLogging(True, ["logStatusError"])
    face.initialise(Gain_File="gain.txt")
    assert face.messages == []
    face.fmu.setDebugLogging(False, [])
    refused(face, lambda: face.step(7))  # errors always speak


def test_one_category_is_switched_off(make: Make) -> None:
    """FMI 3 switches the given categories; in FMI 2 off means all of them."""
    face = make()
    face.fmu.setDebugLogging(False, ["logStatusWarning"])
    face.set_status("In.u", 11.0)
    assert face.messages == []
    face.initialise(Gain_File="gain.txt")
    assert [m[1] for m in face.messages] == ([] if face.version == 2 else ["logGain"])


def test_without_logging_only_errors_speak(make: Make) -> None:
    face = make(logging=False)
    assert face.set_status("In.u", 11.0) == WARNING
    face.initialise(Gain_File="gain.txt")
    assert face.messages == []
    assert "stands at 0 s" in refused(face, lambda: face.step(7))
    face.messages.clear()
    face.fmu.setDebugLogging(True, [])
    face.fmu.reset()
    face.initialise(Gain_File="gain.txt")
    assert [m[1] for m in face.messages] == ["logGain"]


def test_an_instance_needs_a_name(make: Make) -> None:
    for name in ("", " \t\n"):
        with pytest.raises(Exception, match="instantiate"):
            make(name=name)


def test_null_pointers_are_refused(make: Make) -> None:
    """Where the standard gives them no meaning; with nothing to read or write they are fine."""
    face = make().initialise()
    kind = {2: "Real", 3: "Float64"}[face.version]
    value = (ctypes.c_double * 1)(0.5)
    for of_type, name in ((kind, "In.u"), ("Boolean", "In.Hold"), ("String", "Gain.File")):
        reference = (ctypes.c_uint * 1)(face.variables[name].valueReference)
        for call in (f"Get{of_type}", f"Set{of_type}"):
            assert "null pointer" in face.refusal(call, *face.sized(reference, 1, None))
            assert "null pointer" in face.refusal(call, *face.sized(None, 1, value))
            assert face.call(call, *face.sized(None, 0, None)) == OK
    for call in ("GetFMUstate", "DeSerializeFMUstate"):
        bytes_and_size = (b"x", ctypes.c_size_t(1)) if call.startswith("De") else ()
        face.refusal(call, *bytes_and_size, None)
    for call in ("SetFMUstate", "SerializedFMUstateSize"):
        face.refusal(call, *(None,) * (2 if "Size" in call else 1))
    assert face.call("FreeFMUstate", None) == OK
    face.refusal("SetDebugLogging", 1, ctypes.c_size_t(1), None)
    face.step(0)


def test_no_logger(make: Make) -> None:
    face = make(logger=False)
    with pytest.raises(FMICallException):
        face.step(0)
    face.initialise()
    face.step(0)


def test_an_output_that_is_not_finite_is_an_error(make: Make) -> None:
    face = make().initialise(In_u=-7.5)
    assert "the output Out.FR became nan" in refused(face, lambda: face.step(0))
    assert "after an error" in refused(face, lambda: face.step(0))


def test_state_replays_bit_for_bit(make: Make) -> None:
    face = make().initialise(Gain_File="gain.txt")
    face.run(0, 5)
    state = face.fmu.getFMUState()
    first = face.run(5, 12)
    face.fmu.setFMUState(state)
    assert face.run(5, 12) == first
    face.fmu.freeFMUState(state)


def test_serialised_state_moves_to_another_instance(make: Make) -> None:
    face, other = make().initialise(Gain_File="gain.txt"), make()
    face.run(0, 5)
    data = face.serialize()
    assert data == face.serialize()
    other.restore(data)  # an instance of other parameters, never initialised
    assert other.run(5, 12) == face.run(5, 12)
    assert other["Gain.File"] == "gain.txt"


def test_restoring_other_parameters_rebuilds_what_follows_from_them(make: Make) -> None:
    plain, geared = make().initialise(), make().initialise(Gain_File="gain.txt")
    start = plain.serialize()
    expected = plain.run(0, 3)
    geared.restore(start)
    assert geared.run(0, 3) == expected


def test_a_state_before_initialisation_can_be_restored(make: Make) -> None:
    face = make()
    face["Lag.Start"] = 2.0
    data = face.serialize()
    face.initialise()
    face.step(0)
    face.restore(data)
    face.initialise()
    assert face["Out.FL"] == 2.0


def test_foreign_bytes_are_refused(make: Make) -> None:
    face = make()
    data = face.serialize()
    assert "not a serialised state" in refused(face, lambda: face.restore(data[:-1]))
    assert "not a serialised state" in refused(face, lambda: face.restore(b"?" + data[1:]))
    for place in (64, 80, len(data) // 2, len(data) - 1):
        damaged = bytearray(data)
        damaged[place] ^= 1
        message = refused(face, lambda damaged=damaged: face.restore(bytes(damaged)))
        assert "are a damaged state of Lag" in message


def test_memory_that_is_no_state_is_left_alone(make: Make) -> None:
    face = make()
    foreign = ctypes.create_string_buffer(b"?" * 64)
    handle = ctypes.c_void_p(ctypes.addressof(foreign))
    for call in ("GetFMUstate", "FreeFMUstate"):
        assert "not a state of Lag" in face.refusal(call, ctypes.byref(handle))
    assert "not a state of Lag" in face.refusal("SetFMUstate", handle)
    assert foreign.raw[:64] == b"?" * 64


def test_reset_equals_a_fresh_instance(make: Make) -> None:
    used, fresh = make().initialise(Lag_Start=1.0, Gain_File="gain.txt"), make()
    used["Lag.Gain"] = 3.0
    used.run(0, 7)
    used.fmu.reset()
    assert used.serialize() == fresh.serialize()
    assert used.initialise().run(0, 5) == fresh.initialise().run(0, 5)
    assert used.serialize() == fresh.serialize()


def test_instances_do_not_touch_each_other(make: Make) -> None:
    alone = make().initialise().run(0, 6)
    one, two = make().initialise(), make().initialise(Lag_Start=2.0, Gain_File="gain.txt")
    rows = []
    for k in range(6):
        rows += one.run(k, k + 1)
        two.run(k, k + 1, u=-1.0)
    assert rows == alone


def test_instantiate_on_one_thread_and_step_on_another(make: Make) -> None:
    here = make().initialise().run(0, 6)
    with ThreadPoolExecutor(1) as first, ThreadPoolExecutor(1) as second:
        face = first.submit(lambda: make().initialise()).result()
        assert second.submit(lambda: face.run(0, 6)).result() == here


def test_what_is_not_offered_says_so(make: Make) -> None:
    face = make().initialise()
    call = face.fmu.cancelStep if face.version == 2 else face.fmu.enterEventMode
    assert "is not available" in refused(face, call)
