"""Data set of labelled frames: records, shear fields for a network, and tensors."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sensing.records_labelled import LabelledSet

if TYPE_CHECKING:
    from sensing.learning.samples import Samples
    from sensing.learning.torch_data import FieldDataset


class DataSet(LabelledSet):
    """Labelled frames by index (:class:`sensing.records_labelled.LabelledSet`).

    Raises:
        FileError: no manifest, or a manifest of another format.
    """

    def samples(self, method: str = "dots", shape: tuple[int, int] = (16, 16)) -> Samples:
        """Shear fields with their wrenches, made once and stored beside the data.

        Args:
            method: ``dots`` tracks the pictures; ``markers`` simulates those of other sensors for the same motion.
            shape: (H, W) of the field.

        Raises:
            ParameterError: unknown method.
            FileError: no frames, or frames of another dot pattern.
        """
        from sensing.learning.samples import read_samples

        return read_samples(self.folder, method, shape)

    def torch(self, method: str = "dots", shape: tuple[int, int] = (16, 16)) -> FieldDataset:
        """The samples as a ``torch.utils.data.Dataset`` of (field (2, H, W), wrench (6,)), for a network of your own.

        Args:
            method, shape: as in :meth:`samples`.
        """
        from sensing.learning.torch_data import FieldDataset

        return FieldDataset(self.samples(method, shape))
