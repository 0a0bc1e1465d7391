"""What is known of a packed network: a sentence for people, a record for programs."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from sensor.channels import SAMPLE_RATE_HZ
from sensor.packed import PackedNetwork


def sentence(name: str, network: PackedNetwork) -> str:
    """Return what the network is, in a sentence."""
    windowed = network.kind == "windowed"
    memory = f"over {network.window} samples" if windowed else "with carried state"
    residuals = " on wheel-speed residuals" if network.residual else ""
    return (
        f"Suspension velocities of four wheels from 14 signals of a production car, by the network "
        f"{name}: LSTM {memory}{residuals}, {network.units} units, dense layer of {network.hidden}"
    )


def record(model: Path, network: PackedNetwork) -> dict[str, Any]:
    """Return file name, SHA-256, shape and metadata of a network."""
    windowed = {"window": network.window, "wheel_speed_residuals": network.residual}
    return {
        "file": model.name,
        "sha256": hashlib.sha256(model.read_bytes()).hexdigest(),
        "kind": network.kind,
        **(windowed if network.kind == "windowed" else {}),
        "units": network.units,
        "hidden_units": network.hidden,
        "sample_rate_hz": SAMPLE_RATE_HZ,
        "metadata": dict(network.metadata),
    }
