"""Description of a run in its recording: the configuration, and copies of the files that it needs.

A recording never names a path to be opened: weights and camera files are attachments of the MCAP file, checked by
their SHA-256, and are read from copies in the user's cache folder that have the digest as their name.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from cad.errors import FileError, ParameterError, printable
from cad.lens import RELEASED_MODULE, camera_module
from cad.materials import silicone
from cad.user_folders import cache_folder
from cad.whole_file import replace_file
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import KEPT, OF_BEFORE, EndcapConfig
from sensing.live.core.model import weights_in_use
from sensing.live.core.seen import Pictures

METADATA = "endcap_live"
FORMAT = 2
WEIGHTS = "weights"
MOST_FILE_BYTES = 1 << 26
NOT_RECORDED = ("zero", "exposure", "rate_hz")  # of an endcap: a replay takes pictures and references as they are


@dataclass(frozen=True)
class CarriedFile:
    """A file that a configuration names: ``weights``, ``weights/NAME`` or ``camera/NAME``."""

    name: str
    data: bytes

    @property
    def digest(self) -> str:
        """SHA-256."""
        return hashlib.sha256(self.data).hexdigest()


def carried_files(config: LiveConfig) -> list[CarriedFile]:
    """The files that a replay needs, also the weights that ship: the next version may ship others.

    Raises:
        FileError: one cannot be read, or is too large to be carried.
    """
    weights = {endcap.name: weights_in_use(config, endcap) for endcap in config.endcaps}
    files = {path for path in weights.values() if path is not None}
    shared = len(files) == 1 and None not in weights.values()
    paths = {WEIGHTS: files.pop()} if shared else {f"{WEIGHTS}/{name}": path for name, path in weights.items() if path}
    paths |= {f"camera/{endcap.name}": endcap.camera for endcap in config.endcaps if endcap.camera is not None}
    return [CarriedFile(name, _content(path)) for name, path in paths.items()]


def about(config: LiveConfig, files: Iterable[CarriedFile], pictures: Pictures = Pictures.FULL) -> dict[str, str]:
    """The configuration as metadata of the recording.

    Args:
        config: what runs.
        files: that it needs.
        pictures: which are recorded.
    """
    endcaps = []
    for endcap in config.endcaps:
        reported = {
            entry.name: getattr(endcap, entry.name) for entry in fields(endcap) if entry.name not in NOT_RECORDED
        }
        reported["source"] = printable(endcap.source)  # no password of a camera lies in a recording
        endcaps.append(reported | {"camera": None, "T_robot_endcap": endcap.T_robot_endcap.tolist()})
    record = {
        "format": FORMAT, "endcaps": endcaps, "model": config.model, "method": config.method,
        "weight_n": config.weight_n, "pictures": pictures.value,
        "files": {file.name: file.digest for file in files},
        "camera_module": camera_module().name,
        "silicones": {each.silicone: _numbers(each.silicone) for each in config.endcaps if each.own_weight != KEPT},
    }  # fmt: skip
    text = json.dumps(record)
    return {"config": text, "sha256": hashlib.sha256(text.encode()).hexdigest()}


@dataclass(frozen=True)
class RecordedConfig:
    """What ran.

    Attributes:
        config: its endcaps read from the recording; without weights and cameras.
        files: digests of those by name.
        pictures: which were recorded.
    """

    config: LiveConfig
    files: dict[str, str]
    pictures: Pictures = Pictures.FULL

    def with_files(self, found: dict[str, bytes], path: Path) -> LiveConfig:
        """The configuration with the files that the recording carries.

        Raises:
            FileError: one is missing or is not what it was.
        """
        kept = {name: _kept(path, name, digest, found.get(name)) for name, digest in self.files.items()}
        endcaps = tuple(replace(endcap, camera=kept.get(f"camera/{endcap.name}")) for endcap in self.config.endcaps)
        own = {endcap.name: kept.get(f"{WEIGHTS}/{endcap.name}") for endcap in endcaps}
        own_weights = {name: file for name, file in own.items() if file is not None}
        return replace(self.config, endcaps=endcaps, weights=kept.get(WEIGHTS), own_weights=own_weights)


def parsed(metadata: dict[str, str], path: Path) -> RecordedConfig:
    """What :func:`about` wrote, its endcaps reading from ``path``.

    Args:
        metadata: of the recording.
        path: of the recording.

    Raises:
        FileError: damaged, of another version, or of dots, a camera module or a silicone that this toolkit does not
            have.
    """
    try:
        text = metadata["config"]
        reported = json.loads(text)
        if not isinstance(reported, dict) or reported.get("format") != FORMAT:
            raise FileError(f"{path}: recorded by another version of the toolkit: replay it there, or record again")
        if hashlib.sha256(text.encode()).hexdigest() != metadata["sha256"]:
            raise ValueError("its digest differs: the file is damaged")
        endcaps = tuple(_endcap(endcap, path) for endcap in reported["endcaps"])
        files = {str(name): str(digest) for name, digest in reported["files"].items()}
        weight_n = float(reported["weight_n"])
        for name, values in reported.get("silicones", {}).items():
            _require_same_silicone(path, name, values)
        config = LiveConfig(endcaps, reported["model"], None, reported["method"], weight_n)
        return RecordedConfig(config, files, Pictures(reported.get("pictures", Pictures.FULL)))
    except FileError:
        raise
    except ParameterError as error:  # its digest is right: whole, but of what this toolkit does not have
        module = reported.get("camera_module", RELEASED_MODULE)
        seen_by = "" if module == camera_module().name else f" (recorded with the camera module {str(module)[:100]})"
        raise FileError(f"{path}: {printable(f'{error}{seen_by}')}") from None
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        said = " ".join(str(error).split())[:200]
        raise FileError(f"{path}: its configuration cannot be read ({said}): the file is damaged") from None


def _endcap(reported: dict[str, Any], path: Path) -> EndcapConfig:
    unknown = set(reported) - {entry.name for entry in fields(EndcapConfig) if entry.name not in NOT_RECORDED}
    if unknown:
        raise ValueError(f"unknown key {', '.join(sorted(unknown))[:80]}")
    return EndcapConfig(**{**OF_BEFORE, **reported, "source": str(path), "camera": None})


def _numbers(name: str) -> dict[str, float]:
    """Numbers of a silicone on which the part of its own weight in a dot's motion depends."""
    row = silicone(name)
    return {"density_g_cm3": row.density_g_cm3, "c10_mpa": row.neo_hooke_c10_mpa}


def _require_same_silicone(path: Path, name: str, recorded: dict[str, float]) -> None:
    """Refuse a recording whose silicone has other numbers here: own weight would be taken out by other ones."""
    if (here := _numbers(name)) != recorded:
        then, now = (", ".join(f"{key}={value:g}" for key, value in each.items()) for each in (recorded, here))
        raise FileError(
            f"{path}: recorded with {name} of {then}, and its row of cad/materials.csv has {now}: a replay would give "
            "other forces; give the row the recorded numbers while you replay it"
        )


def _content(path: Path) -> bytes:
    try:
        if path.stat().st_size > MOST_FILE_BYTES:
            raise FileError(f"{path}: larger than {MOST_FILE_BYTES >> 20} MiB: a recording cannot carry it")
        return path.read_bytes()
    except OSError as error:
        raise FileError(f"{path}: {error.strerror}: the recording needs it") from None


def _kept(path: Path, name: str, digest: str, data: bytes | None) -> Path:
    """A copy that nothing but its content has named."""
    if data is None:
        raise FileError(f"{path}: does not carry its {name}: the file is damaged")
    if hashlib.sha256(data).hexdigest() != digest:
        raise FileError(f"{path}: its {name} are not those that were recorded: the file is damaged")
    folder = cache_folder() / "recorded"
    copy = folder / digest
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not copy.is_file() or copy.read_bytes() != data:
            replace_file(copy, data)
    except OSError as error:
        raise FileError(
            f"{folder}: {error.strerror}: the recording's files are kept there: set XDG_CACHE_HOME to a folder"
        ) from None
    return copy
