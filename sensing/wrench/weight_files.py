"""Files of weights: those that ship, those that `sensing.train --design` wrote, and their format."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from cad.design_arguments import design_words
from cad.errors import FileError, ParameterError
from cad.identity import MUST_AGREE, differing, identity, recorded
from cad.materials import DEFAULT_SILICONE
from cad.params import EndcapParams
from cad.user_folders import data_folder
from sensing.camera.chosen_module import endcap_label
from sensing.interpreter import typed_command

FORMAT = "endcap-wrench-2"
SIMULATED = "simulated"  # key of what weights state of themselves: no frame of their training was real
MADE_BY, BY_SIMILARITY = "made_by", "similarity"  # another; its value for weights from the library of solved states
SHIPPED = Path(__file__).parents[1] / "weights"


def weights_folder() -> Path:
    """The user's folder of weights: ``endcap-toolkit/weights`` in XDG_DATA_HOME or ~/.local/share."""
    return data_folder() / "weights"


def weights_name(params: EndcapParams, silicone: str = DEFAULT_SILICONE) -> str:
    """File name of a design's weights: ``D180_T10.safetensors``, ``D180_T10_Dragon-Skin-30.safetensors``.

    Args:
        params: the design.
        silicone: row of cad/materials.csv.
    """
    return f"{endcap_label(params, silicone)}.safetensors"


def find_weights(params: EndcapParams, silicone: str = DEFAULT_SILICONE) -> Path | None:
    """The file that ships for a design, else the user's own; None where there is neither.

    Of two files, one whose silicone or camera has other numbers than its row has now comes second: after a user has
    measured the default silicone, the file that ships would otherwise hide that user's own for ever.

    Args:
        params: the design.
        silicone: row of cad/materials.csv.
    """
    name = weights_name(params, silicone)
    found = [path for path in (SHIPPED / f"default_{name}", weights_folder() / name) if path.is_file()]
    if len(found) < 2:
        return next(iter(found), None)
    return next((path for path in found if are_for(path, params, silicone)), found[0])


def are_for(path: Path, params: EndcapParams, silicone: str = DEFAULT_SILICONE) -> bool:
    """Whether the weights of a file are for an endcap as the tables have it now; False of a damaged file.

    Args:
        path: the file.
        params: the design.
        silicone: row of cad/materials.csv.

    Raises:
        ParameterError: an unknown silicone.
    """
    wanted = identity(params, silicone)
    try:
        about = read_weights(path)[1]
        return not differing(recorded(about.get("identity"), EndcapParams(**about["design"])), wanted, MUST_AGREE)
    except (FileError, ParameterError, KeyError, TypeError, ValueError, AttributeError, OverflowError):
        return False


def command_for(params: EndcapParams, silicone: str = DEFAULT_SILICONE) -> str:
    """The command that makes the weights of a design, with the interpreter that runs now: another lacks the libraries.

    Args:
        params: the design.
        silicone: row of cad/materials.csv.
    """
    other = () if silicone == DEFAULT_SILICONE else ("--silicone", silicone)
    _, diameter, _, wall, *dots = design_words(params)
    return typed_command("sensing.train", "--design", diameter, wall, *dots, *other)


def read_weights(path: Path) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Tensors and metadata of a file in this toolkit's format; nothing is unpickled.

    Raises:
        FileError: the file is missing, damaged, of another kind, or a checkpoint of PyTorch.
    """
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="numpy") as file:
            extra = file.metadata() or {}
            if extra.get("format") != FORMAT:
                raise FileError(f"{path}: no weights of this toolkit (format {extra.get('format')}): give {FORMAT}")
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            strange = [f"{name} of {tensor.dtype}" for name, tensor in tensors.items() if tensor.dtype.kind not in "fu"]
            if strange:  # other libraries teach numpy types that it does not compute with
                raise ValueError(strange[0])
            return tensors, _corrected(json.loads(extra["about"]))
    except FileError:
        raise
    except OSError as error:
        raise FileError(f"{path}: cannot read the weights ({error}): check the path") from error
    except (SafetensorError, ValueError, TypeError, KeyError, RecursionError) as error:
        if _is_checkpoint(path):
            raise FileError(
                f"{path}: a checkpoint of PyTorch, such as the authors' wrench_regression_model.pth, where weights of "
                "sensing.train (.safetensors) are meant: python -m sensing.live takes it with --model paper"
            ) from error
        raise FileError(f"{path}: damaged weights ({error}): train again") from error


def _corrected(about: Any) -> Any:
    """Metadata of a file; weights by similarity made before 29 November 2026 state that they saw a real frame."""
    if isinstance(about, dict) and about.get(MADE_BY) == BY_SIMILARITY:
        return {**about, SIMULATED: True}
    return about


def _is_checkpoint(path: Path) -> bool:
    """Whether a file begins as torch.save begins one: an archive, or a pickle before torch 1.6."""
    with path.open("rb") as stream:
        return stream.read(4).startswith((b"PK\x03\x04", b"\x80\x02"))
