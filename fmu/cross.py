"""FMUs for all platforms from this one: ``python fmu/cross.py [--model vehicle] [--out dist]``.

Clang and the C libraries of every target come with the ``ziglang`` wheel (extra ``cross``). What
was compiled before is kept in the cache until the sources change; ``cosim pack --platform`` takes
the sensor's binaries from there. Where wine or qemu-user is installed, the smoke test runs on the
foreign platform and must give the figures of this one.
"""

import argparse
import importlib.util
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import build
from cosim.pack.platforms import FMI2_PLATFORMS, cross_cache
from package import FMU_DIRECTORY, instantiation_token, write_zip
from toolchain import FLAGS, VERSIONS, BuildError
from variables import TableError, read_table

TARGETS = {  # FMI 3 platform: Zig's target
    "x86_64-linux": "x86_64-linux-gnu.2.17",
    "aarch64-linux": "aarch64-linux-gnu.2.17",
    "x86_64-windows": "x86_64-windows-gnu",
    "x86_64-darwin": "x86_64-macos",
    "aarch64-darwin": "aarch64-macos",
}
EMULATORS = {  # platform: static target of the smoke test, commands that may run it
    "aarch64-linux": ("aarch64-linux-musl", ("qemu-aarch64", "qemu-aarch64-static")),
    "x86_64-windows": ("x86_64-windows-gnu", ("wine64", "wine", "/usr/lib/wine/wine64")),
}
MOVING = {  # what the smoke test drives, by model
    "vehicle": ["Init.Velocity=20", "DM.Gas=0.3", "DM.Steer.Ang=0.5"],
    "sensor": ["--lives=5", "Car.vx=15", "Car.ay=1.5", "Car.az=-2"],
}
SMOKE_NETWORK = FMU_DIRECTORY.parent / "sensor" / "models" / "bilstm_w19_ideal.onnx"
ROUNDING = 1e-5  # m/s: processors round a network's sums differently


def zig(target: str) -> str:
    """The C compiler for a target."""
    if importlib.util.find_spec("ziglang") is None:
        raise BuildError(
            "Cross compilation needs Zig: pip install 'suspension-cosim[cross]' (or: ziglang)."
        )
    return f"{sys.executable} -m ziglang cc -target {target}"


def compiled(model: Path, platform: str) -> list[Path]:
    """FMUs of one platform, from the cache if its sources are the same."""
    folder = cross_cache(instantiation_token(model), platform)
    known = sorted(folder.glob("*.fmu"))
    if len(known) == len(VERSIONS):
        return known
    print(f"{platform}: compiling", flush=True)
    with tempfile.TemporaryDirectory() as name:
        paths = build.build(model, Path(name), zig(TARGETS[platform]), target=platform)
        folder.mkdir(parents=True, exist_ok=True)
        return [Path(shutil.copy2(path, folder / path.name)) for path in paths]


def merge(own: Path, others: list[Path], out: Path) -> Path:
    """The FMU ``own`` with the binaries of ``others``, which are the same FMU elsewhere."""
    with zipfile.ZipFile(own) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    for other in others:
        with zipfile.ZipFile(other) as archive:
            for name in archive.namelist():
                if name.startswith("binaries/"):
                    files.setdefault(name, archive.read(name))
    out.mkdir(parents=True, exist_ok=True)
    write_zip(out / own.name, files)
    return out / own.name


def smoke(model: Path, compiler: str | None, emulator: list[str], arguments: list[str]) -> str:
    """What the smoke test says, FMI 2 and 3, on the machine that ``emulator`` runs."""
    flags = [*FLAGS, "-static"] if emulator else FLAGS
    with tempfile.TemporaryDirectory() as name:
        said = []
        programs = build.trial_programs(model, Path(name), compiler, flags, ("smoke",))
        for program in programs.values():
            command = [*emulator, str(program), *arguments]
            result = subprocess.run(command, capture_output=True, text=True, check=False)
            if result.returncode != 0:
                raise BuildError(f"{' '.join(emulator)}: {result.stderr.strip()}")
            said.append(result.stdout.strip())
        return "\n".join(said)


def alike(one: str, other: str, rounding: float) -> bool:
    """Whether two smoke tests say the same, but for the numbers that their lines end with."""
    pairs = zip(one.splitlines(), other.splitlines(), strict=True)
    return all(
        a.rpartition(" ")[0] == b.rpartition(" ")[0]
        and abs(float(a.rpartition(" ")[2]) - float(b.rpartition(" ")[2])) <= rounding
        for a, b in pairs
    )


def try_out(model: Path) -> None:
    """Run the smoke test here and wherever an emulator is installed; BuildError if they differ."""
    with tempfile.TemporaryDirectory() as name:
        needed = read_table(model / "variables.toml").model["needs"]
        rounding = ROUNDING if needed else 0.0
        arguments = [*MOVING.get(model.name, []), *(packed_network(Path(name)) if needed else [])]
        here = smoke(model, None, [], arguments)
        print(f"here: {here}")
        for platform, (target, names) in EMULATORS.items():
            found = next((path for name in names if (path := shutil.which(name))), None)
            if found is None:
                print(f"{platform}: not tried out, {' and '.join(names)} are not installed")
                continue
            there = smoke(model, zig(target), [found], arguments)
            if not alike(here, there, rounding):
                raise BuildError(f"{platform} gives other figures:\n{there}")
            print(f"{platform}: the same")


def packed_network(folder: Path) -> list[str]:
    """The smoke test's arguments for the resources and the token of a packed network."""
    from cosim.fmi import Description
    from cosim.pack.packing import pack

    path = pack(SMOKE_NETWORK, folder / "sensor.fmu").path
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    token = Description(path).model.guid
    return [f"--resources={folder / 'resources'}", f"--token={token}"]


def collect(model: Path, out: Path) -> None:
    """Compile a model for every platform; whole FMUs go to `out`, those that need something first
    stay in the cache.
    """
    fmus = {platform: compiled(model, platform) for platform in TARGETS}
    if read_table(model / "variables.toml").model["needs"]:
        print(f"{model.name}: binaries for cosim pack --platform {' '.join(TARGETS)}")
        return
    for index, fmi in enumerate(VERSIONS):
        platforms = FMI2_PLATFORMS if fmi == 2 else tuple(TARGETS)
        first, *others = [fmus[platform][index] for platform in platforms]
        print(merge(first, others, out))


def main(argv: list[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(description="FMUs with binaries for every platform.")
    parser.add_argument("--model", help="folder of fmu/, or a path; all of fmu/ by default")
    parser.add_argument("--out", type=Path, default=FMU_DIRECTORY.parent / "dist")
    options = parser.parse_args(argv)
    try:
        for model in build.model_folders(options.model):
            collect(model, options.out)
            try_out(model)
    except (BuildError, TableError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
