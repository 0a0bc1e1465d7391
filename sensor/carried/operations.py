"""The operations of the network with carried state from a sample to estimate and next state: what
`sensor.carried.graph` writes as ONNX and `sensor.packed` knows it by.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from sensor.body_motion import Geometry
from sensor.carried.features import DELAYED, STEER, FeatureConfig, scales
from sensor.channels import SAMPLE_RATE_HZ
from sensor.features import WHEEL_SPEEDS, Slip
from sensor.operation import DOUBLE, FLOAT, INT64, NONE, Operation, operation

Arrays = dict[str, npt.NDArray[Any]]


def operations(units: int) -> list[Operation]:
    """Return all operations, each behind those whose results it takes."""
    return [*_residual(), *_slow(), *_delay(), *_assembled(), *_recurrent(units)]


def _residual() -> list[Operation]:
    """Wheel-speed residuals: `sensor.features`, in double precision, as they are small differences
    of large speeds; cos x = 1 - 2 sin(x/2)^2 keeps its digits with a sine in single precision.
    """
    return [
        operation("Gather", "measured i_ax", "ax", axis=1),
        operation("Gather", "measured i_ay", "ay", axis=1),
        operation("Gather", "measured i_yaw", "yaw", axis=1),
        operation("Gather", "measured i_vx", "vx", axis=1),
        operation("Gather", "measured i_road_wheels", "road_wheels", axis=1),
        operation("Mul", "road_wheels half", "half_angles"),
        operation("Sin", "half_angles", "half_sines"),
        operation("Cast", "half_sines", "half_sines_64", to=DOUBLE),
        operation("Mul", "half_sines_64 half_sines_64", "half_squares"),
        operation("Mul", "half_squares two_64", "versines"),
        operation("Sub", "one_64 versines", "cosines"),
        operation("Concat", "cosines ones_64", "headings", axis=1),
        operation("Cast", "measured", "measured_64", to=DOUBLE),
        operation("Gather", "measured_64 i_ax", "ax_64", axis=1),
        operation("Gather", "measured_64 i_ay", "ay_64", axis=1),
        operation("Gather", "measured_64 i_yaw", "yaw_64", axis=1),
        operation("Gather", "measured_64 i_vx", "vx_64", axis=1),
        operation("Gather", "measured_64 i_wheel_speeds", "wheel_speeds", axis=1),
        operation("Mul", "yaw_64 wheel_y", "turning"),
        operation("Sub", "vx_64 turning", "forward"),
        operation("Div", "forward headings", "rolling"),
        operation("Mul", "ax_64 per_ax", "slip_x"),
        operation("Mul", "ay_64 per_ay", "slip_y"),
        operation("Add", "slip_x slip_y", "slip_xy"),
        operation("Add", "slip_xy axle", "slip"),
        operation("Mul", "rolling slip", "driving"),
        operation("Sub", "wheel_speeds driving", "left_over_64"),
        operation("Cast", "left_over_64", "left_over", to=FLOAT),
        operation("Clip", "left_over residual_least residual_most", "residual"),
    ]


def _slow() -> list[Operation]:
    """Slow means and leaky integrals."""
    return [
        operation("Max", "vx least_speed", "speed"),
        operation("Add", "samples one", "next_samples"),
        operation("Add", "next_samples zeros_before", "all_samples"),
        operation("Div", "one all_samples", "part_of_all"),
        operation("Max", "part_of_all slowest_rates", "all_rates"),
        operation("Split", "all_rates rate_split", "rates energy_rate", axis=1),
        operation("Div", "residual speed", "relative"),
        operation("Clip", "relative slip_least slip_most", "relative_clipped"),
        operation("Gather", "measured i_free", "imu", axis=1),
        operation("Concat", "relative_clipped imu", "slow_sample", axis=1),
        operation("Sub", "slow_sample means", "news"),
        operation("Mul", "news rates", "taken_over"),
        operation("Add", "means taken_over", "next_means"),
        operation("Split", "next_means mean_split", "mean_slip mean_imu", axis=1),
        operation("Mul", "mean_slip speed", "slow_residual"),
        operation("Sub", "residual slow_residual", "wheel"),
        operation("Sub", "imu mean_imu", "free"),
        operation("Mul", "integrals integral_keep", "kept"),
        operation("Mul", "free sample_time", "gained"),
        operation("Add", "kept gained", "next_integrals"),
    ]


def _delay() -> list[Operation]:
    """The delay line, and what it held one wheelbase ago."""
    return [
        operation("Concat", "wheel free ax ay yaw", "source", axis=1),
        operation("Gather", "line first_row", "before", axis=0),
        operation("Gather", "line second_row", "before_that", axis=0),
        operation("Sub", "source before", "difference"),
        operation("Sub", "before before_that", "difference_before"),
        operation("Sub", "difference difference_before", "second_difference"),
        operation("Slice", "line line_first line_last", "line_kept"),
        operation("Concat", "source line_kept", "next_line", axis=0),
        operation("Div", "free typical", "level_parts"),
        operation("Mul", "level_parts level_parts", "level_squares"),
        operation("ReduceMean", "level_squares", "energy_now", axes=[1], keepdims=1),
        operation("Sub", "energy_now energy", "energy_news"),
        operation("Mul", "energy_news energy_rate", "energy_gained"),
        operation("Add", "energy energy_gained", "next_energy"),
        operation("Add", "next_energy least_energy", "energy_kept_up"),
        operation("Sqrt", "energy_kept_up", "level"),
        operation("Div", "wheelbase_samples speed", "delay"),
        operation("Sub", "delay leads", "age_free"),
        operation("Clip", "age_free age_least age_most", "age"),
        operation("Floor", "age", "age_whole"),
        operation("Sub", "age age_whole", "age_part"),
        operation("Reshape", "age_part column", "part"),
        *_lagrange(),
        operation("Reshape", "age_whole flat", "number_real"),
        operation("Cast", "number_real", "number", to=INT64),
        operation("Sub", "number one_row", "number_before"),
        operation("Max", "number_before no_row", "newer"),
        operation("Add", "number one_row", "older"),
        operation("Add", "number two_rows", "oldest"),
        operation("Gather", "next_line i_delayed", "delayed_signals", axis=1),
        *(
            node
            for place, row in enumerate(("newer", "number", "older", "oldest"))
            for node in (
                operation("Gather", f"delayed_signals {row}", f"rows{place}", axis=0),
                operation("Mul", f"rows{place} weight{place}", f"share{place}"),
            )
        ),
        operation("Sum", "share0 share1 share2 share3", "delayed_rows"),
        operation("Reshape", "delayed_rows row", "delayed"),
    ]


def _lagrange() -> list[Operation]:
    """Weights of four neighbouring samples: `sensor.carried.features.lagrange`."""
    return [
        operation("Add", "part one", "p_after"),
        operation("Sub", "one part", "p_rest"),
        operation("Sub", "two part", "p_rest2"),
        operation("Mul", "part p_rest", "p01"),
        operation("Mul", "p01 p_rest2", "p012"),
        operation("Div", "p012 minus_six", "weight0"),
        operation("Mul", "p_after p_rest", "q01"),
        operation("Mul", "q01 p_rest2", "q012"),
        operation("Div", "q012 two", "weight1"),
        operation("Mul", "p_after part", "r01"),
        operation("Mul", "r01 p_rest2", "r012"),
        operation("Div", "r012 two", "weight2"),
        operation("Mul", "r01 p_rest", "s012"),
        operation("Div", "s012 minus_six", "weight3"),
    ]


def _assembled() -> list[Operation]:
    """All features in their order, standardised."""
    return [
        operation("Div", "vx speed_unit", "vx_feature"),
        operation("Div", "slowness_unit speed", "slowness"),
        operation("Log", "level", "log_level"),
        operation("Gather", "measured i_steer", "steer", axis=1),
        operation(
            "Concat",
            "wheel free next_integrals difference second_difference delayed",
            "moving",
            axis=1,
        ),
        operation("Div", "moving level", "moving_level"),
        operation("Div", "moving_level moving_scales", "moving_free"),
        operation("Clip", "moving_free moving_least moving_most", "moving_clipped"),
        operation(
            "Concat",
            "ax ay yaw vx_feature slowness log_level steer command moving_clipped",
            "features",
            axis=1,
        ),
        operation("Sub", "features mean", "centred"),
        operation("Div", "centred std", "standardised"),
    ]


def _recurrent(units: int) -> list[Operation]:
    """Dense layer, one step of the LSTM, the outputs."""
    return [
        operation("Gemm", "standardised front_W front_B", "front_sum", transB=1),
        operation("Tanh", "front_sum", "front"),
        operation("Unsqueeze", "front first_axis", "front_step"),
        Operation(
            "LSTM",
            ("front_step", "lstm_W", "lstm_R", "lstm_B", NONE, "hidden", "cell"),
            (NONE, "next_hidden", "next_cell"),
            {"hidden_size": units},
        ),
        operation("Squeeze", "next_hidden first_axis", "ahead"),
        operation("Gemm", "ahead hidden_W hidden_B", "hidden_sum", transB=1),
        operation("Relu", "hidden_sum", "hidden_layer"),
        operation("Gemm", "hidden_layer output_W output_B", "bent", transB=1),
        operation("Gemm", "standardised straight_W", "straight", transB=1),
        operation("Add", "bent straight", "velocity"),
        operation("Mul", "velocity scale", "velocity_scaled"),
        operation("Mul", "velocity_scaled level", "estimate"),
        operation("Gemm", "hidden_layer deviation_W deviation_B", "deviation_sum", transB=1),
        operation("Clip", "deviation_sum deviation_least deviation_most", "log_deviation"),
        operation("Exp", "log_deviation", "deviation_ratio"),
        operation("Mul", "deviation_ratio deviation_scale", "deviation_scaled"),
        operation("Mul", "deviation_scaled level", "deviation"),
    ]


def feature_constants(c: FeatureConfig) -> Arrays:
    """Return the constants of the features, by name."""
    g, s = Geometry(), Slip()
    y = np.array([g.left_y, g.right_y, g.left_y, g.right_y])
    h = 1.0 / SAMPLE_RATE_HZ
    slow = [c.slip_time] * 4 + [c.bias_time] * 3 + [c.level_time]
    settling = [c.settling[0]] * 4 + [c.settling[1]] * 3 + [0.25 * c.level_time]
    reals = {
        "one": [[1.0]], "half": 0.5,
        "residual_least": -s.limit, "residual_most": s.limit,
        "slip_least": -c.slip_limit, "slip_most": c.slip_limit, "least_speed": c.least_speed,
        "slowest_rates": [[h / time for time in slow]],
        "zeros_before": [[time / h for time in settling]],
        "typical": c.typical, "least_energy": c.least_level**2,
        "moving_scales": scales(c), "moving_least": -c.largest, "moving_most": c.largest,
        "integral_keep": 1.0 - h / np.array([c.heave_time, c.angle_time, c.angle_time]),
        "sample_time": h, "wheelbase_samples": c.wheelbase * SAMPLE_RATE_HZ,
        "leads": np.array([c.leads]), "age_least": 0.0, "age_most": c.depth - 3.0,
        "two": 2.0, "minus_six": -6.0,
        "speed_unit": 30.0, "slowness_unit": 10.0,
    }  # fmt: skip
    doubles = {
        "wheel_y": y, "ones_64": [[1.0, 1.0]], "one_64": 1.0, "two_64": 2.0,
        "per_ax": s.per_ax, "per_ay": -s.per_ay * np.sign(y),
        "axle": 1.0 + np.array([s.front, s.front, s.rear, s.rear]),
    }  # fmt: skip
    wholes = {
        "i_ax": [0], "i_ay": [1], "i_free": [2, 3, 4], "i_yaw": [5], "i_vx": [6],
        "i_road_wheels": [7, 8], "i_wheel_speeds": WHEEL_SPEEDS, "i_steer": STEER,
        "i_delayed": DELAYED, "first_row": [0], "second_row": [1],
        "mean_split": [4, 3], "rate_split": [7, 1], "line_first": [0], "line_last": [c.depth - 1],
        "column": [-1, 1], "flat": [-1], "row": [1, -1], "first_axis": [0],
        "no_row": [0], "one_row": [1], "two_rows": [2],
    }  # fmt: skip
    return {
        **{name: np.asarray(value, dtype=np.float32) for name, value in reals.items()},
        **{name: np.asarray(value, dtype=np.float64) for name, value in doubles.items()},
        **{name: np.asarray(value, dtype=np.int64) for name, value in wholes.items()},
    }
